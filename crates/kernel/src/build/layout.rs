//! From the skeleton of a wide tree to its nodes and leaf blocks in memory.

use antumbra_simd::{Scalar, Simd};

use super::binary::{BinaryKind, BinaryTree};
use super::parallel;
use super::skeleton::Skeleton;
use crate::aabb::Aabb;
use crate::bvh::Bvh;
use crate::geometry::BLOCK;
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::TriangleBlock;
use crate::node::{Child, Leaf, Node};
use crate::order::tree_log::TreeLog;
use crate::primitives::Primitives;

/// Nodes or blocks that are written at one go: so many at least, and in so many pieces at most.
const MIN_CHUNK: usize = 256;
const MAX_CHUNKS: usize = 64;
/// Primitives are fetched from memory so many blocks before they are written.
const AHEAD: usize = 3;

/// A tree over nothing: a root without children.
pub(crate) fn empty<const N: usize>() -> Bvh<N> {
    Bvh {
        nodes: vec![Node::EMPTY],
        triangle_blocks: vec![TriangleBlock::EMPTY],
        sphere_blocks: Vec::new(),
        bounds: Aabb::EMPTY,
        reach: 0.0,
        depth: 1,
        front_to_back: false,
    }
}

/// Writes the tree. Slots are as the skeleton has them; primitives of a leaf by how often `log` saw them
/// hit, if it is given. Nodes and blocks stand in visiting order, depth first.
pub(crate) fn lay_out<const N: usize>(
    primitives: &Primitives,
    tree: &BinaryTree,
    skeleton: &Skeleton<N>,
    log: Option<&TreeLog>,
) -> Bvh<N> {
    let order = skeleton.visiting_order();
    let mut places = vec![0; order.len()];
    for (place, &index) in order.iter().enumerate() {
        places[index] = place;
    }
    // Binary nodes. No leaf stands for triangle block 0.
    let (mut triangle_leaves, mut sphere_leaves) = (vec![], vec![]);
    let mut references = vec![[Child::EMPTY; N]; order.len()];
    for (references, &index) in references.iter_mut().zip(&order) {
        for (reference, child) in references.iter_mut().zip(skeleton.nodes[index].children()) {
            *reference = match tree.nodes[child.binary as usize].kind {
                BinaryKind::Inner { .. } => Child::inner(places[index + child.offset as usize]),
                BinaryKind::Leaf { first, .. } => {
                    if primitives.is_sphere(tree.prims[first as usize] as usize) {
                        sphere_leaves.push(child.binary);
                        Child::leaf(Leaf::Spheres(sphere_leaves.len() - 1))
                    } else {
                        triangle_leaves.push(child.binary);
                        Child::leaf(Leaf::Triangles(triangle_leaves.len()))
                    }
                }
            };
        }
    }

    let chunk = |count: usize| count.div_ceil(MAX_CHUNKS).max(MIN_CHUNK);
    let nodes = parallel::fill(order.len(), chunk(order.len()), |places, slots| {
        for place in places {
            let node = slots.push(Node::EMPTY);
            let children = skeleton.nodes[order[place]].children();
            for (slot, child) in children.iter().enumerate() {
                let bounds = &tree.nodes[child.binary as usize].bounds;
                node.set(slot, references[place][slot], bounds);
            }
        }
    });
    let count = triangle_leaves.len() + 1;
    let triangle_blocks = parallel::fill(count, chunk(count), |places, slots| {
        for place in places {
            let block = slots.push(TriangleBlock::EMPTY);
            if let Some(leaf) = place.checked_sub(1) {
                if let Some(&later) = triangle_leaves.get(leaf + AHEAD) {
                    prefetch_triangles(primitives, tree, later);
                }
                let prims = LeafPrims::new(tree, triangle_leaves[leaf], log);
                set_triangles(block, primitives, prims.as_slice());
            }
        }
    });
    let sphere_blocks = parallel::map(sphere_leaves.len(), MIN_CHUNK, |leaf| {
        sphere_block(
            primitives,
            LeafPrims::new(tree, sphere_leaves[leaf], log).as_slice(),
        )
    });
    let bounds = tree.nodes[0].bounds;
    Bvh {
        nodes,
        triangle_blocks,
        sphere_blocks,
        bounds,
        reach: bounds.reach(),
        depth: skeleton.depth(),
        front_to_back: false,
    }
}

/// The primitives of a leaf, in the order in which its lanes hold them.
struct LeafPrims {
    prims: [u32; BLOCK],
    len: usize,
}

impl LeafPrims {
    /// Those hit more often come first; where `log` does not tell, as the binary tree has them.
    fn new(tree: &BinaryTree, leaf: u32, log: Option<&TreeLog>) -> Self {
        let BinaryKind::Leaf { first, count } = tree.nodes[leaf as usize].kind else {
            unreachable!("not a leaf");
        };
        let (first, len) = (first as usize, count as usize);
        let mut prims = [0; BLOCK];
        prims[..len].copy_from_slice(&tree.prims[first..][..len]);
        let hits = |place: usize| log.map_or(0.0, |log| log.prim_hits(place));
        // Most leaves are met by no ray of the log.
        if (first..first + len).any(|place| hits(place) > 0.0) {
            let mut places: [usize; BLOCK] = core::array::from_fn(|lane| first + lane);
            places[..len].sort_by(|&a, &b| hits(b).total_cmp(&hits(a)));
            for (prim, place) in prims.iter_mut().zip(&places[..len]) {
                *prim = tree.prims[*place];
            }
        }
        Self { prims, len }
    }

    fn as_slice(&self) -> &[u32] {
        &self.prims[..self.len]
    }
}

/// Asks for the triangles of a leaf, which stand anywhere.
fn prefetch_triangles(primitives: &Primitives, tree: &BinaryTree, leaf: u32) {
    let BinaryKind::Leaf { first, count } = tree.nodes[leaf as usize].kind else {
        return;
    };
    for &prim in &tree.prims[first as usize..][..count as usize] {
        let [first, _, last] = &primitives.triangles[prim as usize];
        Scalar.prefetch(first);
        Scalar.prefetch(last);
        Scalar.prefetch(&primitives.triangle_refs[prim as usize]);
    }
}

/// Fills an empty block with these triangles, in this order.
pub(crate) fn set_triangles(block: &mut TriangleBlock, primitives: &Primitives, prims: &[u32]) {
    for (lane, &prim) in prims.iter().enumerate() {
        let index = prim as usize;
        let id = primitives.triangle_refs[index];
        block.set(lane, &primitives.triangles[index], id);
    }
}

fn sphere_block(primitives: &Primitives, prims: &[u32]) -> SphereBlock {
    let mut block = SphereBlock::EMPTY;
    for &prim in prims {
        let index = prim as usize - primitives.triangles.len();
        block.push(primitives.spheres[index], primitives.sphere_refs[index]);
    }
    block
}
