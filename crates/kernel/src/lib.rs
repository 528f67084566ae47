//! A ray tracing kernel built around the occlusion query: *is anything between these two points?*
//!
//! Give it geometry, get a tree of 4, 8 or 16 children per node, ask `occluded` (anything in the way?)
//! or `intersect` (what is hit first?), one ray at a time or in batches. An occlusion query stops at the
//! first occluder, so the order in which children are visited decides its cost: the kernel *learns* that
//! order, and which nodes the tree has, from a sample of rays: yours, or ones that it makes up from the
//! surfaces (after Ogaki and Derouet-Jourdan 2016).
//!
//! ```
//! use antumbra::{AnyBvh, Geometry, Ray};
//!
//! let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
//! let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
//! let bvh = AnyBvh::build(&geometry, &Default::default())?;
//!
//! // One by one ...
//! let mut tracer = bvh.tracer();
//! assert!(tracer.occluded(&Ray::between([0.2, 0.2, 0.0], [0.2, 0.2, 2.0])));
//! let hit = tracer.intersect(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])).expect("in front");
//! assert_eq!((hit.t, hit.prim_id), (1.0, 0));
//!
//! // ... or many at once.
//! let rays = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]), Ray::new([2.0, 2.0, 0.0], [0.0, 0.0, 1.0])];
//! let mut occluded = [false; 2];
//! bvh.occluded_batch(&rays, &mut occluded);
//! assert_eq!(occluded, [true, false]);
//!
//! // Learn the tree and its order from a sample of the rays to come. Surface rays in the same log keep
//! // other kinds of rays fast.
//! use antumbra::{BinaryTree, Builder, Isa, Learning, Primitives, TreeLog, Width, surface_rays};
//! let primitives = Primitives::new(&geometry)?;
//! let tree = BinaryTree::build(&primitives, Builder::default());
//! let mut log = TreeLog::new(&tree);
//! log.add(&primitives, &tree, &rays, 1.0);
//! log.add(&primitives, &tree, &surface_rays(&primitives, 512, 1), 1.0);
//! let (learning, isa) = (Learning::default(), Isa::best());
//! let width = Width::auto(isa.level());
//! let learned = AnyBvh::collapse_logged(&primitives, &tree, &log, &learning, width, isa);
//! learned.occluded_batch(&rays, &mut occluded);
//! assert_eq!(occluded, [true, false]);
//!
//! // Objects are stored once and stand in the world as often as they are placed.
//! use antumbra::Instance;
//! let place = |x| Instance {
//!     object: 0,
//!     transform: [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
//! };
//! let row = Primitives::with_instances(&[], &[geometry], &[place(0.0), place(5.0)])?;
//! let bvh = AnyBvh::build_over(&row, &Default::default());
//! let ray = Ray::new([5.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
//! assert_eq!(bvh.tracer().intersect(&ray).map(|hit| hit.inst_id), Some(1));
//! # Ok::<(), antumbra::Error>(())
//! ```
//!
//! What holds of every answer:
//! - The same bits for every order, width, builder, instruction set and batch size.
//! - Closed meshes do not leak: the triangle test is watertight along edges and around corners.
//! - The interval of a ray is open, `tnear < t < tfar`. Rays with NaN, of zero length or infinite hit
//!   nothing. Tracing cannot fail; building returns errors.
//!
//! Leaves cut out of rectangles, and other surfaces that let a part of the rays through, have an [`Opacity`].
//!
//! Where things are: [`Geometry`] and [`Primitives`] go in, [`BinaryTree`] is built over them,
//! [`AnyBvh::collapse`] makes it wide by area and [`AnyBvh::collapse_logged`] by what a [`TreeLog`] has
//! seen. [`Order`] and [`Log`] are the paper's orders of a wide tree, to be compared. [`Brute`] gives the same
//! answers without any tree.
#![forbid(unsafe_code)]

mod aabb;
mod api;
mod builder;
mod collapse;
mod error;
mod geometry;
mod hash;
mod learn;
mod order;
mod parallel;
mod ray;
mod shape;
#[cfg(feature = "steps")]
pub mod steps;
mod trace;
mod tree;

pub use aabb::Aabb;
pub use antumbra_simd::{Isa, Level, Unavailable, UnknownLevel};
pub use api::build::{BuildOptions, BuildReport};
pub use api::bvh::AnyBvh;
pub use api::times::{BuildTimes, Clock};
pub use api::tracer::Tracer;
pub use builder::{Builder, UnknownBuilder};
pub use collapse::{Collapse, Learning, UnknownCollapse};
pub use error::Error;
pub use geometry::primitives::Primitives;
pub use geometry::{
    BLOCK, Candidate, Coverage, Geometry, Instance, LocalOrigin, Opacity, Pattern, QueryKind,
    Sphere, TriangleMesh,
};
pub use learn::{Log, LogKind, TreeLog, surface_rays};
pub use order::{Order, UnknownOrder, Visits};
pub use ray::{Hit, INVALID_ID, Ray};
pub use shape::Shape;
pub use trace::brute::Brute;
pub use trace::observe::Cost;
pub use tree::binary::BinaryTree;
pub use tree::costs::CostModel;
pub use tree::slot_order::SlotOrder;
pub use tree::width::{UnknownWidth, Width};
