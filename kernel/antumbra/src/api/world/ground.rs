//! The ground of a world: a tree that lies in the world itself.
//!
//! Instances are close to it, so a top level over its root would have boxes that overlap. It is taken apart into
//! subtrees, and these are items of the top level beside the instances.

use alloc::vec::Vec;

use super::Joined;
use crate::aabb::Aabb;
use crate::builder::top_level::{TopChild, TopItem, take_apart};
use crate::tree::node::{Child, ChildKind};
use crate::tree::refit::TreePlaces;
use crate::tree::wide::Tree;

/// The ground is taken apart into at least this many subtrees, and one per instance up to [`MOST_SUBTREES`].
const SUBTREES: usize = 64;
const MOST_SUBTREES: usize = 1024;

/// Weight of a subtree.
const WEIGHT: f32 = 2.0;

/// Subtrees of the ground; none in a world without one.
#[derive(Clone, Debug, Default)]
pub(super) struct Ground {
    pub items: Vec<TopItem>,
    /// Its nodes, of which those above the subtrees are empty, and its leaves.
    pub places: TreePlaces,
    /// Primitives that a refit must find sound.
    pub kept: usize,
    /// Levels of nodes.
    pub depth: usize,
}

impl Ground {
    /// Takes apart a tree that has joined, for this number of instances.
    pub fn new(tree: &mut Tree, joined: Joined, instances: usize) -> Self {
        let count = instances.clamp(SUBTREES, MOST_SUBTREES);
        let whole = (Child::inner(joined.places.nodes.start), tree.bounds);
        let children = |child: Child| {
            let ChildKind::Inner(index) = child.kind() else {
                return None;
            };
            let children: Vec<_> = tree.nodes.get(index).children().collect();
            tree.nodes.clear(index);
            Some(children.into_iter())
        };
        let parts = take_apart(whole, count, children).into_iter();
        Self {
            items: parts.map(|(child, bounds)| item(child, bounds)).collect(),
            places: joined.places,
            kept: joined.kept,
            depth: joined.depth,
        }
    }

    /// Adjusts the places after the tree moved back by `by` nodes.
    pub fn move_back(&mut self, by: usize) {
        let nodes = &mut self.places.nodes;
        *nodes = nodes.start + by..nodes.end + by;
        for item in &mut self.items {
            item.move_back(by);
        }
    }

    /// Finds the boxes of subtrees that were refitted.
    pub fn measure(&mut self, tree: &Tree) {
        for item in &mut self.items {
            if let TopChild::Subtree(child) = item.child {
                item.bounds = match child.kind() {
                    ChildKind::Inner(index) => tree.nodes.get(index).all_bounds(),
                    ChildKind::Leaf(leaf) => {
                        let place = TreePlaces::of_leaf(leaf);
                        let prims = tree.prim_bounds(&place);
                        prims.fold(Aabb::EMPTY, |all, bounds| all.union(&bounds))
                    }
                    ChildKind::Instance(_) => item.bounds,
                };
            }
        }
    }
}

/// A subtree as an item of the top level.
pub(super) fn item(child: Child, bounds: Aabb) -> TopItem {
    TopItem {
        bounds,
        weight: WEIGHT,
        child: TopChild::Subtree(child),
    }
}
