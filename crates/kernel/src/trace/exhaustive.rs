//! Rays through the whole binary tree without ever stopping: every box they hit, every primitive they
//! hit. What orders and collapses are learned from.

use antumbra_simd::{Simd, Width, WithSimd};

use super::setup::RaySetup;
use crate::aabb::Aabb;
use crate::build::binary::{BinaryKind, BinaryTree};
use crate::build::layout::set_triangles;
use crate::geometry::BLOCK;
use crate::geometry::triangle::TriangleBlock;
use crate::primitives::Primitives;
use crate::ray::Ray;

/// What rays meet in a binary tree, one ray after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Met {
    /// Nodes entered, ascending for each ray, as depth-first order has them. The root counts as entered
    /// by every ray, whatever its box: no traversal tests that. [`Met::HIT`] marks leaves of which a
    /// primitive was hit.
    pub nodes: Vec<u32>,
    /// How long `nodes` was after each ray. Rays that cannot hit anything are left out.
    pub ends: Vec<usize>,
    /// The primitives hit, by their places in [`BinaryTree::prims`].
    pub prims: Vec<u32>,
}

impl Met {
    /// Leaves are at most 2³⁰, so node indices leave this bit free.
    pub const HIT: u32 = 1 << 31;
}

/// Follows rays to their ends, one by one.
pub(crate) struct Exhaustive<'a> {
    pub primitives: &'a Primitives,
    /// Has at least one node.
    pub tree: &'a BinaryTree,
    pub rays: &'a [Ray],
}

impl WithSimd<BLOCK> for Exhaustive<'_> {
    type Output = Met;

    #[inline(always)]
    fn with_simd<S: Simd + Width<BLOCK>>(self, simd: S) -> Met {
        let Self {
            primitives,
            tree,
            rays,
        } = self;
        let reach = tree.nodes[0].bounds.reach();
        let mut met = Met::default();
        let mut blocks = Blocks::new(primitives, tree);
        let mut stack = Vec::new();
        for ray in rays {
            let Some(setup) = RaySetup::new(ray, reach) else {
                continue;
            };
            stack.push(0);
            while let Some(index) = stack.pop() {
                met.nodes.push(index as u32);
                match tree.nodes[index].kind {
                    BinaryKind::Inner { right } => {
                        let (left, right) = (index + 1, index + right as usize);
                        if hits_box(&setup, &tree.nodes[right].bounds) {
                            stack.push(right);
                        }
                        if hits_box(&setup, &tree.nodes[left].bounds) {
                            stack.push(left);
                        }
                    }
                    BinaryKind::Leaf { first, count } => {
                        let mut hits = match blocks.get(index) {
                            Some(block) => block.hits(simd, &setup),
                            None => sphere_hits(primitives, tree, &setup, first, count),
                        };
                        if hits != 0 {
                            let last = met.nodes.len() - 1;
                            met.nodes[last] |= Met::HIT;
                        }
                        while hits != 0 {
                            met.prims.push(first + hits.trailing_zeros());
                            hits &= hits - 1;
                        }
                    }
                }
            }
            met.ends.push(met.nodes.len());
        }
        met
    }
}

/// Which of the spheres in a leaf the ray hits, as bits.
fn sphere_hits(
    primitives: &Primitives,
    tree: &BinaryTree,
    ray: &RaySetup,
    first: u32,
    count: u32,
) -> u32 {
    let mut hits = 0;
    for lane in 0..count {
        let prim = tree.prims[(first + lane) as usize] as usize;
        let sphere = primitives.spheres[prim - primitives.triangles.len()];
        hits |= u32::from(sphere.hit(ray).is_some()) << lane;
    }
    hits
}

/// Blocks of the triangle leaves that some ray has come to: rays that follow each other meet much the same
/// ones, and few rays meet but a small part of a large scene.
struct Blocks<'a> {
    primitives: &'a Primitives,
    tree: &'a BinaryTree,
    blocks: Vec<TriangleBlock>,
    /// Per node, the place of its block after the next one; 0 if it has none yet.
    places: Vec<u32>,
}

impl<'a> Blocks<'a> {
    fn new(primitives: &'a Primitives, tree: &'a BinaryTree) -> Self {
        Self {
            primitives,
            tree,
            blocks: Vec::new(),
            places: vec![0; tree.nodes.len()],
        }
    }

    /// The block of a leaf; `None` if that is one of spheres.
    #[inline(always)]
    fn get(&mut self, leaf: usize) -> Option<&TriangleBlock> {
        if self.places[leaf] == 0 {
            self.fill(leaf)?;
        }
        Some(&self.blocks[self.places[leaf] as usize - 1])
    }

    #[inline(never)]
    fn fill(&mut self, leaf: usize) -> Option<()> {
        let BinaryKind::Leaf { first, count } = self.tree.nodes[leaf].kind else {
            return None;
        };
        let prims = &self.tree.prims[first as usize..][..count as usize];
        if self.primitives.is_sphere(*prims.first()? as usize) {
            return None;
        }
        let mut block = TriangleBlock::EMPTY;
        set_triangles(&mut block, self.primitives, prims);
        self.blocks.push(block);
        self.places[leaf] = self.blocks.len() as u32;
        Some(())
    }
}

/// The conservative box test of all traversals, for one box.
#[inline(always)]
pub(crate) fn hits_box(ray: &RaySetup, bounds: &Aabb) -> bool {
    let (mut enter, mut leave) = (ray.tnear, ray.tfar);
    for axis in 0..3 {
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        let (near, far) = if !ray.negative(axis) {
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
