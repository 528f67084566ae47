//! The laboratory: builders, logs, collapses and orders one by one, with what they cost.
//!
//! Users who want rays answered need none of this. [`Laboratory`] has the steps that [`Bvh::learn`](crate::Bvh::learn)
//! takes, as methods of the tree; [`BinaryStage`] is a binary tree from which many wide trees are made.
//!
//! ```
//! use antumbra::lab::{BinaryStage, Cost, Laboratory};
//! use antumbra::{Bvh, Geometry, Order, Primitives, Ray, Recipe};
//!
//! let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
//! let primitives = Primitives::new(&[Geometry::triangles(&positions[..], vec![[0, 1, 2]])])?;
//! let rays = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])];
//!
//! // One binary tree, many orders.
//! let stage = BinaryStage::new(&primitives, &rays, &Recipe::default());
//! for order in Order::ALL {
//!     let bvh = stage.learn(&primitives, &rays, &Recipe::default().order(order));
//!     let (mut occluded, mut costs) = ([false], [Cost::default()]);
//!     bvh.occluded_batch_counted(&rays, &mut occluded, &mut costs);
//!     assert_eq!((occluded[0], costs[0].node_tests), (true, 1));
//! }
//! # Ok::<(), antumbra::Error>(())
//! ```

pub use antumbra_simd::Unavailable;

pub use crate::api::lab::Laboratory;
pub use crate::api::learn::BinaryStage;
pub use crate::api::times::{BuildTimes, Clock};
pub use crate::collapse::Learning;
pub use crate::geometry::BLOCK;
pub use crate::learn::surface_rays::surface_rays;
pub use crate::learn::{Log, LogKind, TreeLog};
pub use crate::order::Visits;
pub use crate::order::exclusive::Events;
pub use crate::shape::Shape;
pub use crate::trace::observe::Cost;
pub use crate::tree::binary::BinaryTree;
pub use crate::tree::slot_order::SlotOrder;
