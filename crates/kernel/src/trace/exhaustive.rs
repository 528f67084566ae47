//! A ray through the whole binary tree without ever stopping: every box it hits, every primitive it hits.
//! What orders and collapses are learned from.

use super::setup::RaySetup;
use crate::aabb::Aabb;
use crate::build::binary::{BinaryKind, BinaryTree};
use crate::geometry::triangle;
use crate::primitives::Primitives;

/// What one ray after another meets in a binary tree.
pub(crate) struct Exhaustive<'a> {
    primitives: &'a Primitives,
    tree: &'a BinaryTree,
    stack: Vec<usize>,
}

/// Receives what a ray meets.
pub(crate) trait Meeting {
    /// The ray enters a node, whose box it hits. Nodes come in ascending order: depth first.
    fn node(&mut self, node: usize);
    /// It hits the primitive at this place of [`BinaryTree::prims`]. Comes after the leaf's
    /// [`Meeting::node`], before any other node's.
    fn prim(&mut self, place: usize);
}

impl<'a> Exhaustive<'a> {
    pub fn new(primitives: &'a Primitives, tree: &'a BinaryTree) -> Self {
        Self {
            primitives,
            tree,
            stack: Vec::new(),
        }
    }

    /// Follows a ray to its end. The root counts as entered by every ray, whatever its box: no traversal
    /// tests it.
    pub fn trace(&mut self, ray: &RaySetup, meeting: &mut impl Meeting) {
        if self.tree.nodes.is_empty() {
            return;
        }
        self.stack.push(0);
        while let Some(index) = self.stack.pop() {
            meeting.node(index);
            match self.tree.nodes[index].kind {
                BinaryKind::Inner { right } => {
                    for child in [index + right as usize, index + 1] {
                        if hits_box(ray, &self.tree.nodes[child].bounds) {
                            self.stack.push(child);
                        }
                    }
                }
                BinaryKind::Leaf { first, count } => {
                    let places = first as usize..(first + count) as usize;
                    for place in places {
                        if self.hits_prim(ray, self.tree.prims[place] as usize) {
                            meeting.prim(place);
                        }
                    }
                }
            }
        }
    }

    fn hits_prim(&self, ray: &RaySetup, prim: usize) -> bool {
        match prim.checked_sub(self.primitives.triangles.len()) {
            None => triangle::hit(&self.primitives.triangles[prim], ray).is_some(),
            Some(sphere) => self.primitives.spheres[sphere].hit(ray).is_some(),
        }
    }
}

/// The conservative box test of all traversals, for one box.
#[inline(always)]
pub(crate) fn hits_box(ray: &RaySetup, bounds: &Aabb) -> bool {
    let (mut enter, mut leave) = (ray.tnear, ray.tfar);
    for axis in 0..3 {
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        let (near, far) = if ray.negative[axis] == 0 {
            (low, high)
        } else {
            (high, low)
        };
        let near = near * ray.rdir[axis] - ray.near_offset[axis];
        let far = far * ray.rdir[axis] - ray.far_offset[axis];
        enter = if near > enter { near } else { enter };
        leave = if far < leave { far } else { leave };
    }
    enter <= leave
}
