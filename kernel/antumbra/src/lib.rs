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
//! assert_eq!(bvh.batch(&rays).occluded(), [true, false]);
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
//! Objects are stored once and placed any number of times:
//!
//! | | made from | top level | moves |
//! |---|---|---|---|
//! | [`Bvh::build`] of [`Primitives::with_instances`] | geometries | learned, together with the objects | no |
//! | [`World::new`], [`World::on_ground`] | finished [`Object`]s | built by areas, again whenever something moves | yes |
//!
//! ```
//! # use antumbra::{Geometry, Ray, Recipe};
//! # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
//! # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
//! use antumbra::{Bvh, Instance, Primitives};
//!
//! let place = |x| Instance::new(0, [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
//! let scene = Primitives::with_instances(&[], &[geometry], &[place(0.0), place(5.0)])?;
//! let row = Bvh::build(&scene, &Recipe::default())?;
//! let ray = Ray::new([5.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
//! assert_eq!(row.intersect(&ray).map(|hit| hit.inst_id), Some(1));
//! # Ok::<(), antumbra::Error>(())
//! ```
//!
//! ## When the top level learns
//! A tree of both levels follows training rays through the top level into the objects, so nodes and child orders of both
//! suit the rays. A world has objects that learned by themselves. [`World::relearn`] learns the child order of
//! its top level as well, until something moves. Answers are the same.
//!
//! # Scenes that change
//! An [`Object`] is built once. When instances of a [`World`] move, only the nodes above the objects are built again.
//! [`Bvh::refit`] moves vertices and keeps the nodes. [`Bvh::relearn`] learns the child order again for the rays of today.
//!
//! For motion blur, [`Geometry::moving`] and [`Instance::moving`] move while rays are traced, and each ray looks at a time of
//! its own: [`Batch::at`].
//!
//! # Where things are
//! [`Geometry`] and [`Primitives`] go in, a [`Recipe`] says how, [`Bvh`] answers. [`Bvh::batch`] takes many rays, also
//! from separate arrays ([`RayColumns`]), [`Bvh::points`] many points, and [`Bvh::write`] saves a tree. [`shapes`] has
//! kinds of geometry one by one and primitives of your own, [`cutout`] partly transparent triangles. [`Bvh::query`] adds
//! [`Masks`] and filters to a query. [`Brute`] gives the same answers without any tree. [`Build`] has every choice of a
//! build, [`Stage`] makes many trees from one.
//!
//! # Features
//! - `parallel` (default): builds and batches use the threads of rayon's pool.
//! - `std` (default): detects what the CPU has, keeps memory of queries between calls, reads and writes files. Without
//!   it the kernel needs only `alloc`, takes the instruction set that it is compiled for, and a batch takes memory from
//!   the allocator.
//! - `bytemuck`: `Pod` for [`Ray`] and [`Hit`].
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
mod words;

pub use aabb::Aabb;
pub use antumbra_simd::Isa;
pub use api::batch::Batch;
pub use api::build::Build;
pub use api::bvh::Bvh;
pub use api::child_order::ChildOrder;
pub use api::group::{Directions, Group};
pub use api::hit_lists::HitLists;
pub use api::object::Object;
pub use api::points::{ClosestPoint, Points};
pub use api::ray_memory::RayMemory;
pub use api::ray_order::RayOrder;
pub use api::ray_query::RayQuery;
pub use api::recipe::Recipe;
pub use api::report::BuildReport;
pub use api::stage::Stage;
pub use api::world::World;
pub use error::Error;
pub use geometry::masks::Masks;
pub use geometry::primitives::Primitives;
pub use geometry::{Geometry, Instance, LocalOrigin, NestedInstances};
pub use monitor::BuildMonitor;
pub use prim_id::PrimId;
pub use ray::{Hit, INVALID_ID, Ray};
pub use ray_columns::RayColumns;
pub use trace::brute::Brute;
pub use trace::surface::Surface;
pub use trace::visit::Visit;
pub use tree::width::Width;

/// Kinds of geometry one by one, primitives of your own, and what a build leaves out and why.
pub mod shapes {
    pub use crate::geometry::primitives::dropped::{DropReason, Dropped};
    pub use crate::geometry::{
        CubicSegments, CurveBasis, Curves, Disk, QuadMesh, Sphere, TriangleMesh, UserGeometry,
        UserHit,
    };
}

/// What calls take in several forms: they take `impl Into` one of these.
pub mod inputs {
    pub use crate::api::build::Source;
    pub use crate::ray_columns::{Column, Distance, Rays};
}

/// Reading files of trees, objects and worlds whose functions are given again.
pub mod saved {
    pub use crate::api::save::Saved;
    pub use crate::geometry::functions::{Functions, GeometryId};
}

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
    pub use crate::trace::engine::Engine;
    pub use crate::tree::costs::CostModel;
}

/// What trees are made of and learn from, for builders, collapses and child orders of your own, and for queries that are
/// observed.
///
/// A [`Recipe`] names what the kernel has. Others plug in: a builder as [`Builder::Other`](recipe::Builder::Other), a
/// collapse as [`Collapse::Other`](recipe::Collapse::Other), a child order as [`Order::Other`](recipe::Order::Other).
/// None of them changes an answer.
///
/// - [`Grow`](parts::Grow) makes a [`BinaryTree`](parts::BinaryTree).
/// - [`Contract`](parts::Contract) says which of its nodes become nodes of the wide tree, for training rays in a
///   [`TreeLog`](parts::TreeLog).
/// - [`Plan`](parts::Plan) puts the children of every node of a wide [`Tree`](parts::Tree) in order, for training rays in a
///   [`Log`](parts::Log).
/// - [`Steps`](parts::Steps) has the steps of learning one by one, and queries that count what they do;
///   [`observe`](parts::observe) reports all of it to an [`Observer`](parts::Observer).
///
/// ```
/// use antumbra::parts::{Cost, Steps};
/// use antumbra::recipe::Order;
/// use antumbra::{Build, Geometry, Ray, Recipe};
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// let rays = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])];
///
/// // One binary tree, many orders.
/// let stage = Build::new(&geometry).stage()?;
/// for order in Order::ALL {
///     let bvh = stage.learn(&rays, &Recipe::default().order(order), &())?;
///     let (mut occluded, mut costs) = ([false], [Cost::default()]);
///     bvh.occluded_batch_counted(&rays, &mut occluded, &mut costs);
///     assert_eq!((occluded[0], costs[0].node_tests), (true, 1));
/// }
/// # Ok::<(), antumbra::Error>(())
/// ```
pub mod parts {
    pub use antumbra_simd::Row;

    pub use crate::api::steps::{Steps, observe};
    pub use crate::builder::Grow;
    pub use crate::builder::binned_sah::subtree as binned_subtree;
    pub use crate::builder::cost::Cost as SplitCost;
    pub use crate::collapse::skeleton::{Children, Contraction};
    pub use crate::collapse::{Contract, Contractor, Learning};
    pub use crate::geometry::BLOCK;
    pub use crate::geometry::primitives::PrimKind;
    pub use crate::geometry::ray_setup::{RaySetup, is_sane};
    pub use crate::hash::Random;
    pub use crate::learn::surface_rays::surface_rays;
    pub use crate::learn::{Log, LogKind, TreeLog};
    pub use crate::order::Plan;
    pub use crate::order::arrange::{Costs, arrange};
    pub use crate::order::ratio::{ChildCost, area_shares, cost_any};
    pub use crate::trace::binary::{LeafHits, Witness, follow};
    pub use crate::trace::observe::{Cost, NodeVisit, Observer, Place};
    pub use crate::tree::binary::{BinaryKind, BinaryNode, BinaryTree};
    pub use crate::tree::node::{ChildKind, Leaf, MAX_WIDTH, NodeRef, PerSlot};
    pub use crate::tree::slot_order::{Pick, SlotOrder};
    pub use crate::tree::wide::Tree;
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
