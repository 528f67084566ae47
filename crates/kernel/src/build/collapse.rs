//! From the binary tree to N children per node.

use super::binary::{BinaryKind, BinaryTree};
use crate::aabb::Aabb;
use crate::bvh::Bvh;
use crate::geometry::BLOCK;
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::TriangleBlock;
use crate::node::{Child, Leaf, Node};
use crate::primitives::Primitives;

/// Surface area contraction (Wald, Benthin and Boulos 2008): a node starts with the two children of a
/// binary node; the one with the largest area is replaced by its own two, in its place, until there are N
/// or only leaves are left. Slots are so in the depth-first order of the binary tree.
pub(crate) fn by_area<const N: usize>(primitives: &Primitives, tree: &BinaryTree) -> Bvh<N> {
    let bounds = tree.nodes.first().map_or(Aabb::EMPTY, |root| root.bounds);
    let mut bvh = Bvh {
        nodes: vec![Node::EMPTY],
        triangle_blocks: vec![TriangleBlock::EMPTY],
        sphere_blocks: Vec::new(),
        bounds,
        reach: bounds.reach(),
        depth: 1,
        front_to_back: false,
    };
    if tree.nodes.is_empty() {
        return bvh;
    }
    // (binary node, index of the wide node that takes its children, its level)
    let mut open = vec![(0, 0, 1)];
    while let Some((binary, index, level)) = open.pop() {
        bvh.depth = bvh.depth.max(level);
        let mut node = Node::EMPTY;
        let deferred = open.len();
        for (slot, child) in children::<N>(tree, binary).into_iter().enumerate() {
            let reference = match tree.nodes[child].kind {
                BinaryKind::Inner { .. } => {
                    let index = bvh.nodes.len();
                    bvh.nodes.push(Node::EMPTY);
                    open.push((child, index, level + 1));
                    Child::inner(index)
                }
                BinaryKind::Leaf { first, count } => {
                    let prims = &tree.prims[first as usize..][..count as usize];
                    Child::leaf(push_leaf(&mut bvh, primitives, prims))
                }
            };
            node.set(slot, reference, &tree.nodes[child].bounds);
        }
        // The last one pushed is opened first: let that be the first child.
        open[deferred..].reverse();
        bvh.nodes[index] = node;
    }
    bvh
}

/// The binary nodes that become the children of one wide node.
fn children<const N: usize>(tree: &BinaryTree, binary: usize) -> Vec<usize> {
    let mut children = Vec::with_capacity(N);
    match tree.children(binary) {
        Some(pair) => children.extend(pair),
        // Only the root can be a leaf here.
        None => children.push(binary),
    }
    while children.len() < N {
        let largest = children
            .iter()
            .enumerate()
            .filter_map(|(place, &child)| {
                let pair = tree.children(child)?;
                Some((place, pair, tree.nodes[child].bounds.half_area()))
            })
            // The first of equals, so that the result is one and the same everywhere.
            .reduce(|best, other| if other.2 > best.2 { other } else { best });
        let Some((place, pair, _)) = largest else {
            break;
        };
        children.splice(place..=place, pair);
    }
    children
}

fn push_leaf<const N: usize>(bvh: &mut Bvh<N>, primitives: &Primitives, prims: &[u32]) -> Leaf {
    debug_assert!((1..=BLOCK).contains(&prims.len()));
    let triangles = primitives.triangles.len();
    if primitives.is_sphere(prims[0] as usize) {
        let mut block = SphereBlock::EMPTY;
        for &prim in prims {
            let index = prim as usize - triangles;
            block.push(primitives.spheres[index], primitives.sphere_refs[index]);
        }
        bvh.sphere_blocks.push(block);
        Leaf::Spheres(bvh.sphere_blocks.len() - 1)
    } else {
        let mut block = TriangleBlock::EMPTY;
        for (lane, &prim) in prims.iter().enumerate() {
            let index = prim as usize;
            block.set(
                lane,
                &primitives.triangles[index],
                primitives.triangle_refs[index],
            );
        }
        bvh.triangle_blocks.push(block);
        Leaf::Triangles(bvh.triangle_blocks.len() - 1)
    }
}
