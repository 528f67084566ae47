//! The data structures of a tree, and the promises they keep.
//!
//! - `binary`: the binary tree that every builder makes;  `costs`: what a node and a primitive cost
//! - `node`: a node of N children and its references to them;  `nodes`: a list of nodes of any width
//! - `wide`: the N-wide tree;  `leaves`: its leaf blocks by kind
//! - `recollapse`: a tree of one width made from a tree of another
//! - `arena`: a tree put together from trees of objects;  `refit`: boxes and leaf blocks of primitives that moved
//! - `validate`: a check of every promise of the wide tree;  `statistics`: its bytes and its cost
//! - `width`: how many children a node has
//! - `motion`: what moves between two keys
//! - `saved`: trees as words of a file, see [`crate::words`]
//! - `slot_order`: a permutation of the slots of a tree

pub(crate) mod arena;
pub(crate) mod binary;
pub(crate) mod costs;
pub(crate) mod leaves;
pub(crate) mod motion;
pub(crate) mod node;
pub(crate) mod nodes;
pub(crate) mod recollapse;
pub(crate) mod refit;
pub(crate) mod saved;
pub(crate) mod slot_order;
mod statistics;
pub(crate) mod validate;
pub(crate) mod wide;
pub(crate) mod width;
