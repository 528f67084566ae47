//! Tracing: from a ray to an answer.
//!
//! Read in this order; each step uses those before it:
//!
//! 1. [`crate::geometry::ray_setup`] checks a ray and prepares it, and proves that no box that matters is missed.
//! 2. `view`: what is at an index for a ray, now or at its time. `step`: the node step and the leaf step that every traversal
//!    consists of; `stack`: children still to visit.
//! 3. `query`: how occlusion and closest hits differ. `judge`: whether the lanes of a leaf count, by a `condition`.
//! 4. `single`: one ray after another, the shortest of the loops.
//! 5. `ray_batch`: rays of a batch, with conditions and reports. `stream`: many rays in flight, one step of each in turn;
//!    `deferred`: their hits of cut-outs; `leaf_places`: how leaves are prefetched.
//! 6. `packet`: rays that go the same way, side by side.
//! 7. `instrumented`: one ray after another, in any order (`pick`), while an observer counts or logs (`observe`).
//! 8. `visit`: all hits of a ray, front to back; `several`: the nearest hits of many rays, in a stream.
//! 9. `binary`: all nodes and hits of a ray in a binary tree.
//!
//! Points have queries of their own: `nearest`, what is near one, and `inside`, what is around one.
//!
//! `ray_sort` sorts the rays of a batch. `surface` computes position and normal of a hit from its leaf; `locate` finds the leaf
//! again from the ids of a hit. `memory` keeps stacks between queries.
//! `brute` uses no tree at all and is the oracle of the tests.
//!
//! `engine` is the table of all that is compiled for a width and a level.
//!
//! Loops 4 to 6 are compiled for each query per width and level, and know one order of children: ascending slots for
//! occlusion, by distance for closest hits. Everything else goes through loop 7, which is compiled once per width and
//! level. Logs and orders are made elsewhere, by those who observe.

pub(crate) mod binary;
pub(crate) mod brute;
pub(crate) mod brute_points;
pub(crate) mod condition;
mod deferred;
pub(crate) mod engine;
pub(crate) mod inside;
pub(crate) mod instrumented;
pub(crate) mod judge;
mod leaf_places;
pub(crate) mod locate;
pub(crate) mod memory;
pub(crate) mod nearest;
pub(crate) mod observe;
pub(crate) mod packet;
pub(crate) mod pick;
pub(crate) mod query;
pub(crate) mod ray_batch;
pub(crate) mod ray_sort;
pub(crate) mod several;
pub(crate) mod single;
pub(crate) mod stack;
pub(crate) mod step;
pub(crate) mod stream;
pub(crate) mod surface;
pub(crate) mod view;
pub(crate) mod visit;
