//! The public interface: a tree of any width, how it is made and how it is queried.
//!
//! - `bvh`: the tree;  `recipe`: every choice that makes one;  `build`: making one in one call
//! - `report`: what was built;  `times`: how long the steps took
//! - `save`: trees, objects and worlds in files
//! - `object`: a tree to be placed in worlds;  `world`: objects that are placed, and move
//! - `refit`: other vertices in the same tree;  `points`: what is near a point or around it
//! - `stage`: a binary tree that can still learn;  `steps`: the steps of learning one by one
//! - `single`: queries of one ray, and the normal of a hit
//! - `ray_query`: queries of one ray with masks and filters, and visits of all its hits
//! - `batch`: queries of many rays;  `hit_lists`: all hits of many rays;  `visit_many`: visits of them, with a state
//! - `group`: rays from many points in the same directions
//! - `ray_order`: how they are sorted
//! - `child_order`: learning while running;  `ray_memory`: a sample of rays to learn from
//! - `query`: how all of them reach the traversals;  `prefetch`: whether batches prefetch

pub(crate) mod batch;
pub(crate) mod build;
pub(crate) mod bvh;
pub(crate) mod child_order;
pub(crate) mod group;
pub(crate) mod hit_lists;
pub(crate) mod moving;
pub(crate) mod object;
pub(crate) mod points;
mod prefetch;
mod query;
pub(crate) mod ray_memory;
pub(crate) mod ray_order;
pub(crate) mod ray_query;
pub(crate) mod recipe;
mod refit;
pub(crate) mod report;
pub(crate) mod save;
mod single;
pub(crate) mod stage;
pub(crate) mod steps;
pub(crate) mod times;
mod visit_many;
pub(crate) mod world;
