//! The laboratory: builders, logs, collapses and orders one by one, with what they cost.
//!
//! Only there with the feature `lab`. Users who want rays answered need none of this: what they use is compiled without
//! it. The feature adds rows to the lists [`Builder`](crate::recipe::Builder), [`Collapse`](crate::recipe::Collapse) and
//! [`Order`](crate::recipe::Order), the trait [`Laboratory`] with the steps of learning and with queries that count,
//! and the logs as objects.
//!
//! ```
//! use antumbra::lab::{Cost, Laboratory};
//! use antumbra::recipe::Order;
//! use antumbra::{Build, Geometry, Ray, Recipe};
//!
//! let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
//! let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
//! let rays = [Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])];
//!
//! // One binary tree, many orders.
//! let stage = Build::new(&geometry).stage()?;
//! for order in Order::ALL {
//!     let bvh = stage.learn(&rays, &Recipe::default().order(order), &())?;
//!     let (mut occluded, mut costs) = ([false], [Cost::default()]);
//!     bvh.occluded_batch_counted(&rays, &mut occluded, &mut costs);
//!     assert_eq!((occluded[0], costs[0].node_tests), (true, 1));
//! }
//! # Ok::<(), antumbra::Error>(())
//! ```
//!
//! - `laboratory`: the steps of learning, and queries that count;  `oracle`: a bound for every order
//! - `orders`: child orders of the laboratory: `random`, `rtsah`, and the one that looks at the ray (`by_ray`)
//! - `builders`: builders of the laboratory: `ploc`, `sbvh`, `ray_driven`, `pbrt`;
//!   `pieces` and `candidates` serve them
//! - `rsc`: a collapse by visits
//! - `saved`: orders and logs in files;  `steps`: single steps of a traversal, for benches

pub(crate) mod builders;
pub(crate) mod by_ray;
pub(crate) mod candidates;
mod laboratory;
mod oracle;
pub(crate) mod orders;
mod pbrt;
pub(crate) mod pieces;
pub(crate) mod ploc;
mod random;
pub(crate) mod ray_driven;
pub(crate) mod rsc;
mod rtsah;
mod saved;
pub(crate) mod sbvh;
pub mod steps;

pub use laboratory::Laboratory;
pub use oracle::Visits;

pub use crate::collapse::Learning;
pub use crate::geometry::BLOCK;
pub use crate::learn::surface_rays::surface_rays;
pub use crate::learn::{Log, LogKind, TreeLog};
pub use crate::shape::Shape;
pub use crate::trace::observe::Cost;
pub use crate::tree::binary::BinaryTree;
pub use crate::tree::slot_order::SlotOrder;
