//! A ray tracing kernel built around the occlusion query: *is anything between these two points?*
//!
//! Build a tree over your geometry, query it, and let it learn from your own rays:
//!
//! ```
//! use antumbra::{Bvh, Geometry, Ray, Recipe};
//!
//! let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
//! let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
//! let bvh = Bvh::build(&geometry, &Recipe::default())?;
//!
//! let rays = [Ray::between([0.2, 0.2, 0.0], [0.2, 0.2, 2.0]), Ray::between([2.0; 3], [3.0; 3])];
//! let mut occluded = [false; 2];
//! bvh.occluded_batch(&rays, &mut occluded);
//! assert_eq!(occluded, [true, false]);
//!
//! let learned = Bvh::learn(&geometry, &rays, &Recipe::default())?;
//! let hit = learned.intersect(&rays[0]).expect("a triangle is in the way");
//! assert_eq!((hit.t, hit.prim_id), (0.5, 0));
//! assert_eq!(learned.normal(&rays[0], &hit), Some([0.0, 0.0, 1.0]));
//! # Ok::<(), antumbra::Error>(())
//! ```
//!
//! An occlusion query stops at the first occluder, so the order in which the children of a node are visited decides
//! its cost. The kernel learns that order, and which nodes the tree has, from training rays (after Ogaki and
//! Derouet-Jourdan 2016): yours, or synthetic rays between the surfaces.
//!
//! # What holds of every answer
//! - The same bits for every recipe, instruction set, batch size and number of threads.
//! - Closed meshes do not leak: the triangle test is watertight along edges and around corners, and finds the distance
//!   of thin triangles as well as of others. A ray that begins at least 2⁻²⁰ of the scene extent inside a closed mesh
//!   hits it.
//! - The interval of a ray is open, `tnear < t < tfar`; [`Ray::closed`] closes it. Rays with NaN, of zero length or
//!   infinite hit nothing.
//! - Tracing cannot fail; building returns errors.
//!
//! # Instances
//! Objects are stored once and placed any number of times. A [`World`] places them:
//!
//! | | made from | top level | moves |
//! |---|---|---|---|
//! | [`World::fixed`] | geometries | learned, together with the objects | no |
//! | [`World::new`], [`World::on_ground`] | finished [`Object`]s | built by areas, again whenever something moves | yes |
//!
//! ```
//! # use antumbra::{Geometry, Ray, Recipe};
//! # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
//! # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
//! use antumbra::{Instance, World};
//!
//! let place = |x| Instance::new(0, [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
//! let row = World::fixed(&[], &[geometry], &[place(0.0), place(5.0)], &[], &Recipe::default())?;
//! let ray = Ray::new([5.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
//! assert_eq!(row.intersect(&ray).map(|hit| hit.inst_id), Some(1));
//! # Ok::<(), antumbra::Error>(())
//! ```
//!
//! ## When the top level learns
//! [`World::fixed`] follows training rays through the top level into the objects, so nodes and child orders of both levels
//! suit the rays. A world that moves has objects that learned by themselves. [`World::relearn`] learns the child order of
//! its top level as well, until something moves. Answers are the same.
//!
//! # Scenes that change
//! An [`Object`] is built once. When instances of a [`World`] move, only the nodes above the objects are built again.
//! [`Bvh::refit`] moves vertices and keeps the nodes. [`Bvh::relearn`] learns the child order again for the rays of today.
//!
//! A [`MovingBvh`] has motion blur: meshes and instances that move while rays are traced, each ray at a time of its own.
//!
//! # Where things are
//! [`Geometry`] and [`Primitives`] go in, a [`Recipe`] says how, [`Bvh`] answers. [`Bvh::batch`] takes many rays, also
//! from separate arrays ([`RayColumns`]), and [`Bvh::write`] saves a tree. [`cutout`] has partly transparent triangles,
//! [`UserGeometry`] primitives of your own. [`Bvh::query`] adds [`Masks`] and filters to a query. [`Brute`] gives the
//! same answers without any tree. [`Build`] has every choice of a build, [`Stage`] makes many trees from one.
//!
//! # Features
//! - `parallel` (default): builds and batches use the threads of rayon's pool.
//! - `std` (default): detects what the CPU has, keeps memory of queries between calls, reads and writes files. Without
//!   it the kernel needs only `alloc`, takes the instruction set that it is compiled for, and a batch takes memory from
//!   the allocator.
//! - `bytemuck`: `Pod` for [`Ray`] and [`Hit`].
//! - `lab`: builders, collapses and child orders for comparisons, training logs, and queries that count. Off by default.
//!
//! WebAssembly runs on the level `simd128` where the program is compiled with `-C target-feature=+simd128`, and otherwise in
//! plain code, with the same bits.
//!
//! In a debug build the kernel is hundreds of times slower. Have it optimised there, too:
//! `[profile.dev.package.antumbra] opt-level = 3`, and the same for `antumbra-simd`.
#![no_std]
#![cfg_attr(not(feature = "bytemuck"), forbid(unsafe_code))]
#![cfg_attr(feature = "bytemuck", deny(unsafe_code))]

extern crate alloc;
#[cfg(any(feature = "std", test))]
extern crate std;

mod aabb;
mod api;
mod builder;
mod collapse;
mod error;
mod geometry;
mod hash;
#[cfg(feature = "lab")]
pub mod lab;
mod learn;
#[cfg(test)]
mod list_tests;
mod math;
mod monitor;
mod order;
mod parallel;
#[cfg(feature = "bytemuck")]
mod pod;
mod prim_id;
mod ray;
mod ray_columns;
mod shape;
mod trace;
mod tree;

pub use aabb::Aabb;
pub use antumbra_simd::Isa;
pub use api::batch::Batch;
pub use api::build::{Build, Source};
pub use api::bvh::Bvh;
pub use api::child_order::ChildOrder;
pub use api::group::{Directions, Group};
pub use api::hit_lists::HitLists;
pub use api::moving::{Motion, MovingBvh};
pub use api::object::Object;
pub use api::points::ClosestPoint;
pub use api::ray_memory::RayMemory;
pub use api::ray_order::RayOrder;
pub use api::ray_query::RayQuery;
pub use api::recipe::Recipe;
pub use api::report::BuildReport;
pub use api::save::Saved;
pub use api::stage::Stage;
pub use api::world::World;
pub use error::Error;
pub use geometry::masks::Masks;
pub use geometry::primitives::Primitives;
pub use geometry::primitives::dropped::{DropReason, Dropped};
pub use geometry::{
    CubicSegments, CurveBasis, Curves, Disk, Functions, Geometry, GeometryId, Instance,
    LocalOrigin, MovingGeometry, MovingInstance, MovingMesh, MovingScene, NestedInstances,
    QuadMesh, Sphere, TriangleMesh, UserGeometry, UserHit,
};
pub use monitor::BuildMonitor;
pub use prim_id::PrimId;
pub use ray::{Hit, INVALID_ID, Ray};
pub use ray_columns::{Column, Distance, RayColumns, Rays};
pub use trace::brute::Brute;
pub use trace::surface::Surface;
pub use trace::visit::Visit;
pub use tree::width::Width;

/// Choices of a [`Recipe`], most of them by name.
///
/// [`Builder`](recipe::Builder), [`Collapse`](recipe::Collapse), [`Order`](recipe::Order) and
/// [`Preset`](recipe::Preset) are tables: every row has a name, a sentence and a source, and is parsed from its name.
pub mod recipe {
    pub use antumbra_simd::{Level, UnknownName};

    pub use crate::api::recipe::{Preset, Training, TrainingRays};
    pub use crate::api::times::{BuildTimes, Clock};
    pub use crate::builder::Builder;
    pub use crate::collapse::Collapse;
    pub use crate::order::Order;
    pub use crate::tree::costs::CostModel;
}

/// Partly transparent triangles: leaves cut out of rectangles, nets, veils.
///
/// A mesh made by [`Geometry::cutouts`] has an [`Opacity`](cutout::Opacity), which is called where a ray hits it.
pub mod cutout {
    pub use crate::geometry::{Candidate, Coverage, Opacity, Pattern, QueryKind};
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
