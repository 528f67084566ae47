//! Leaves of fewer primitives than a leaf block holds.
//!
//! Builders stop when primitives fit a block, which is tested in one step. Other software stops earlier: pbrt-v3 at 4
//! primitives. Counts of primitive tests can be compared with its counts only if leaves are as small.

use alloc::vec::Vec;
use core::ops::Range;

use crate::aabb::Aabb;
use crate::geometry::primitives::Primitives;
use crate::tree::binary::{BinaryKind, BinaryNode, BinaryTree};

/// The tree with every leaf of more than `most` primitives split, by the surface area heuristic over all places on all
/// axes, until none has more. `most` is at least 1. No primitive is in two leaves. The trees of objects are left as they are.
pub(crate) fn with_leaves_of(
    primitives: &Primitives,
    tree: &BinaryTree,
    most: usize,
) -> BinaryTree {
    let mut made = BinaryTree {
        nodes: Vec::with_capacity(2 * tree.nodes.len()),
        prims: tree.prims.clone(),
        objects: tree.objects.clone(),
        identity: tree.identity.clone(),
    };
    let mut moved = Vec::with_capacity(tree.nodes.len());
    for node in &tree.nodes {
        moved.push(made.nodes.len() as u32);
        match node.kind {
            BinaryKind::Inner { .. } => made.nodes.push(*node),
            BinaryKind::Leaf { first, count } => {
                let places = first as usize..(first + count) as usize;
                split(primitives, &mut made, node.bounds, places, most);
            }
        }
    }
    for (index, node) in tree.nodes.iter().enumerate() {
        if let BinaryKind::Inner { right } = node.kind {
            let right = moved[index + right as usize] - moved[index];
            made.nodes[moved[index] as usize].kind = BinaryKind::Inner { right };
        }
    }
    made
}

/// Appends the nodes over the primitives of some places, which lie in `whole`.
fn split(
    primitives: &Primitives,
    made: &mut BinaryTree,
    whole: Aabb,
    places: Range<usize>,
    most: usize,
) {
    let count = places.len();
    let node = made.nodes.len();
    made.nodes.push(BinaryNode {
        bounds: whole,
        kind: BinaryKind::Leaf {
            first: places.start as u32,
            count: count as u32,
        },
    });
    if count <= most {
        return;
    }
    let bounds = |prim: u32| primitives.bounds_of(prim as usize);
    let around = |prims: &[u32]| {
        prims
            .iter()
            .fold(Aabb::EMPTY, |all, prim| all.union(&bounds(*prim)))
    };
    let (mut least, mut best) = (
        f32::INFINITY,
        (made.prims[places.clone()].to_vec(), count / 2),
    );
    for axis in 0..3 {
        let mut prims = made.prims[places.clone()].to_vec();
        let middle = |prim: &u32| {
            let bounds = bounds(*prim);
            bounds.min[axis] + bounds.max[axis]
        };
        prims.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        for left in 1..count {
            let side = |prims: &[u32]| around(prims).half_area() * prims.len() as f32;
            let cost = side(&prims[..left]) + side(&prims[left..]);
            if cost < least {
                (least, best) = (cost, (prims.clone(), left));
            }
        }
    }
    let (prims, left) = best;
    let sides = [around(&prims[..left]), around(&prims[left..])];
    made.prims[places.clone()].copy_from_slice(&prims);
    let middle = places.start + left;
    split(primitives, made, sides[0], places.start..middle, most);
    let right = (made.nodes.len() - node) as u32;
    made.nodes[node].kind = BinaryKind::Inner { right };
    split(primitives, made, sides[1], middle..places.end, most);
}
