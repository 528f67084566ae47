//! Trees keep their leaves, are valid and never worse; moves are as good as they promise.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use crate::builder::binned_sah;
use crate::builder::reinsertion::*;
use crate::geometry::Geometry;
use crate::geometry::primitives::Primitives;
use crate::geometry::test_primitives::primitives;
use crate::tree::binary::BinaryKind;
use antumbra_testkit::{Rng, mesh};

/// Checks the subtree at `index`, whose leaves own `prims` from `first` on. Returns where both end and how
/// many levels there are below the root.
fn check(tree: &BinaryTree, index: usize, first: usize) -> (usize, usize, usize) {
    let node = &tree.nodes[index];
    match node.kind {
        BinaryKind::Leaf {
            first: leaf_first,
            count,
        } => {
            assert_eq!(leaf_first as usize, first, "depth-first order");
            (index + 1, first + count as usize, 0)
        }
        BinaryKind::Inner { right } => {
            let right = index + right as usize;
            let (left_end, middle, left_height) = check(tree, index + 1, first);
            assert_eq!(left_end, right, "depth-first order");
            let (end, last, right_height) = check(tree, right, middle);
            let both = [index + 1, right].map(|child| tree.nodes[child].bounds);
            assert_eq!(both[0].union(&both[1]), node.bounds);
            (end, last, 1 + left_height.max(right_height))
        }
    }
}

/// Checks the whole tree and returns its height.
fn height(tree: &BinaryTree) -> usize {
    let (end, last, height) = check(tree, 0, 0);
    assert_eq!((end, last), (tree.nodes.len(), tree.prims.len()));
    height
}

/// The primitives of all leaves, and their boxes.
fn leaves(tree: &BinaryTree) -> Vec<(Vec<u32>, String)> {
    let mut leaves: Vec<_> = tree
        .nodes
        .iter()
        .filter_map(|node| match node.kind {
            BinaryKind::Leaf { first, count } => {
                let prims = tree.prims[first as usize..][..count as usize].to_vec();
                Some((prims, format!("{:?}", node.bounds)))
            }
            BinaryKind::Inner { .. } => None,
        })
        .collect();
    leaves.sort();
    leaves
}

fn sum_of_areas(tree: &BinaryTree) -> f64 {
    tree.nodes.iter().map(|node| area(&node.bounds)).sum()
}

/// Checks all that is promised of an improved tree, and returns the sum of its areas as a share of what it
/// was before.
fn check_improved(primitives: &Primitives, place: &str) -> f64 {
    let before = binned_sah::build(primitives, &());
    let after = improved(&before, &());
    assert_eq!(leaves(&before), leaves(&after), "{place}");
    if before.nodes.is_empty() {
        return 1.0;
    }
    assert!(height(&after) <= MAX_DEPTH, "{place}");
    let (before, after) = (sum_of_areas(&before), sum_of_areas(&after));
    // Sums are rounded.
    assert!(after <= before * (1.0 + 1e-12), "{place}: {before} {after}");
    after / before
}

#[test]
fn the_same_leaves_under_better_nodes() {
    let seed = 71;
    let mut rng = Rng::new(seed);
    for generate in mesh::ALL {
        for size in [1, 7, 8, 9, 17, 40, 300, 3000] {
            for spheres in [0, 3, size] {
                let mesh = generate(&mut rng, size);
                let primitives = primitives(&mesh, spheres, &mut rng);
                let place = format!("seed {seed} {} {size} {spheres}", mesh.name);
                check_improved(&primitives, &place);
            }
        }
    }
}

/// Areas that overflow, or that are nothing, give no gain but do no harm.
#[test]
fn any_scale_is_fine() {
    let mut rng = Rng::new(72);
    let mesh = mesh::soup(&mut rng, 500);
    for scale in [1e-40, 1e-20, 1e15, 1e19, 1e38] {
        let mut scaled = mesh.clone();
        for position in &mut scaled.positions {
            *position = position.map(|x| x * scale);
        }
        check_improved(&primitives(&scaled, 0, &mut rng), &format!("{scale:e}"));
    }
}

/// Crossing triangles leave the splits of a builder much to improve.
#[test]
fn much_is_gained_where_primitives_cross() {
    let mut rng = Rng::new(73);
    let positions: Vec<_> = (0..3 * 5000).map(|_| rng.point(1.0)).collect();
    let indices: Vec<_> = (0..5000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let geometries = [Geometry::triangles(positions, indices)];
    let primitives = Primitives::new(&geometries).expect("indices in range");
    let share = check_improved(&primitives, "crossing");
    assert!(share < 0.97, "{share}");
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn threads_make_no_difference() {
    let mut rng = Rng::new(74);
    for generate in [mesh::soup, mesh::mixed_scales] {
        let mesh = generate(&mut rng, 40_000);
        let primitives = primitives(&mesh, 20, &mut rng);
        let built = [1, 2, 4].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().expect("threads");
            format!(
                "{:?}",
                pool.install(|| improved(&binned_sah::build(&primitives, &()), &()))
            )
        });
        assert!(
            built[0] == built[1] && built[1] == built[2],
            "{}",
            mesh.name
        );
    }
}

/// A small tree with inner nodes to spare.
fn small_tree(seed: u64) -> BinaryTree {
    let mut rng = Rng::new(seed);
    let mesh = mesh::soup(&mut rng, 150);
    binned_sah::build(&primitives(&mesh, 5, &mut rng), &())
}

#[test]
fn linking_changes_nothing() {
    for seed in 80..90 {
        let tree = small_tree(seed);
        let again = LinkedTree::new(&tree).unlinked(&tree.prims);
        assert_eq!(format!("{tree:?}"), format!("{again:?}"), "seed {seed}");
    }
}

/// A search finds the best of all moves that could be tried, and a move gains what it says.
#[test]
fn searches_find_the_best_place() {
    for seed in 90..94 {
        let tree = small_tree(seed);
        let linked = LinkedTree::new(&tree);
        let (before, height_before) = (sum_of_areas(&tree), height(&tree));
        let (mut found, mut refused) = (0, 0);
        for node in 1..=linked.len() as u32 {
            let mut most: f64 = 0.0;
            for to in 1..=linked.len() as u32 {
                let mut moved = linked.clone();
                let gain = moved.reinsert(node, to, MAX_DEPTH);
                let after = moved.unlinked(&tree.prims);
                height(&after);
                assert_eq!(leaves(&after), leaves(&tree));
                let difference = before - sum_of_areas(&after);
                assert!((gain - difference).abs() < 1e-9 * before, "seed {seed}");
                most = most.max(gain);

                let mut shallow = linked.clone();
                let same_depth = shallow.reinsert(node, to, height_before);
                refused += usize::from(same_depth < gain);
                assert!(height(&shallow.unlinked(&tree.prims)) <= height_before);
            }
            let mut open = Vec::new();
            let mut search = Search::new(&linked, node, &mut open);
            search.search();
            let gain = f64::from(search.best.gain);
            assert!(
                (gain - most).abs() < 1e-5 * before,
                "seed {seed}: {gain} {most}"
            );
            found += usize::from(gain > 1e-4 * before);
        }
        assert!(found > 0, "seed {seed}: no move to be found");
        assert!(refused > 0, "seed {seed}: no move too deep");
    }
}
