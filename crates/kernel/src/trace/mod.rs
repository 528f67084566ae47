//! Tracing: from a ray to an answer.
//!
//! - `setup`: checks a ray and prepares it; the argument why boxes are conservative
//! - `step`: one node step, one leaf step
//! - `instance`: into an instance and out again;  `best`: the best hit so far
//! - `query`: what makes a traversal an occlusion or a closest-hit query
//! - `single`: one ray after another;  `wave`: many in flight, and `waiting`, their hits of cut-outs;  `packet`: many side by side, of `packet_rays`
//! - `pick`: which hit child is next;  `observe`: counting and logging
//! - `stack`: children still to visit;  `memory`: where stacks live between queries
//! - `follow`: everything a ray meets in a wide tree;  `exhaustive`: in a binary one, as `node_lists`
//! - `brute`: no tree at all, the oracle

pub(crate) mod binary;
pub(crate) mod brute;
mod deferred;
pub(crate) mod instrumented;
mod leaf_places;
pub(crate) mod memory;
pub(crate) mod observe;
pub(crate) mod packet;
pub(crate) mod pick;
pub(crate) mod query;
pub(crate) mod single;
pub(crate) mod stack;
pub(crate) mod step;
pub(crate) mod stream;
