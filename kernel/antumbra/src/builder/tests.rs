//! The binary tree of every builder is valid, complete and shallow, whatever it is built over.

use alloc::format;
use alloc::vec;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::builder::Builder;
use crate::geometry::BLOCK;
use crate::geometry::primitives::Primitives;
use crate::geometry::test_primitives::primitives;
use crate::tree::binary::BinaryKind;
use crate::tree::binary::BinaryTree;
use antumbra_testkit::{Rng, mesh};

/// A leaf and its box.
type Leaf<'a> = (&'a [u32], Aabb);

/// Checks the subtree at `index` and collects its leaves. Returns where it ends and how deep it is.
fn check<'a>(tree: &'a BinaryTree, index: usize, leaves: &mut Vec<Leaf<'a>>) -> (usize, usize) {
    let node = &tree.nodes[index];
    match node.kind {
        BinaryKind::Leaf { first, count } => {
            let before: usize = leaves.iter().map(|leaf| leaf.0.len()).sum();
            assert_eq!(
                first as usize, before,
                "leaves own ranges in depth-first order"
            );
            let prims = &tree.prims[first as usize..][..count as usize];
            assert!((1..=BLOCK).contains(&prims.len()));
            leaves.push((prims, node.bounds));
            (index + 1, 1)
        }
        BinaryKind::Inner { right } => {
            let right = index + right as usize;
            let (left_end, left_depth) = check(tree, index + 1, leaves);
            assert_eq!(left_end, right, "depth-first order");
            let (end, right_depth) = check(tree, right, leaves);
            let both = [index + 1, right].map(|child| tree.nodes[child].bounds);
            assert!(node.bounds.contains(&both[0].union(&both[1])));
            (end, 1 + left_depth.max(right_depth))
        }
    }
}

fn check_tree(primitives: &Primitives, tree: &BinaryTree, place: &str) {
    let mut leaves = Vec::new();
    if primitives.is_empty() {
        assert!(tree.nodes.is_empty(), "{place}");
        return;
    }
    let (end, depth) = check(tree, 0, &mut leaves);
    assert_eq!(end, tree.nodes.len(), "{place}");
    assert!(depth <= 95, "{place}: {depth} levels");
    assert!(
        tree.nodes[0].bounds.contains(&primitives.bounds()),
        "{place}"
    );
    let mut found = vec![false; primitives.len()];
    for (prims, bounds) in &leaves {
        let kind = primitives.kind(prims[0] as usize);
        for &prim in *prims {
            let prim = prim as usize;
            assert_eq!(primitives.kind(prim), kind, "{place}");
            assert!(bounds.contains(&primitives.bounds_of(prim)), "{place}");
            assert!(!found[prim], "{place}: {prim} is there twice");
            found[prim] = true;
        }
    }
    assert!(!found.contains(&false), "{place}: one is lost");
}

fn check_builders(primitives: &Primitives, place: &str) {
    for builder in Builder::ALL {
        let place = format!("{builder}, {place}");
        let tree = BinaryTree::build(primitives, builder);
        check_tree(primitives, &tree, &place);
    }
}

/// Every generator of the test kit is also seen flat and so large that areas overflow.
#[test]
fn trees_are_valid_and_complete() {
    let mut rng = Rng::new(61);
    for generate in mesh::ALL {
        for size in [1, 8, 9, 40, 700] {
            for spheres in [0, 3, size] {
                let mesh = generate(&mut rng, size);
                let flat = mesh.map("flat", |[x, _, z]| [x, 0.25, z]);
                let huge = mesh.map("huge", |p| p.map(|x| x * 1e30));
                for mesh in [&mesh, &flat, &huge] {
                    let primitives = primitives(mesh, spheres, &mut rng);
                    let place = format!("{} {size} with {spheres} spheres", mesh.name);
                    check_builders(&primitives, &place);
                }
            }
        }
    }
}
