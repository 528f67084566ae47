//! Valid, complete, the same everywhere, and about as good as trees can be.

use alloc::format;
use alloc::vec;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::builder::binned_sah::items::Items;
use crate::builder::binned_sah::*;
use crate::builder::cost::ItemWeights;
use crate::geometry::test_primitives::primitives;
use antumbra_testkit::{Rng, mesh};

/// Checks the subtree at `index`, marks its primitives, and returns where it ends and how deep it is.
fn check(
    primitives: &Primitives,
    tree: &BinaryTree,
    index: usize,
    seen: &mut [u32],
) -> (usize, usize) {
    let node = &tree.nodes[index];
    match node.kind {
        BinaryKind::Leaf { first, count } => {
            let prims = &tree.prims[first as usize..][..count as usize];
            assert!((1..=BLOCK).contains(&prims.len()));
            let mut bounds = Aabb::EMPTY;
            for &prim in prims {
                seen[prim as usize] += 1;
                bounds = bounds.union(&primitives.bounds_of(prim as usize));
                assert_eq!(
                    primitives.kind(prim as usize),
                    primitives.kind(prims[0] as usize)
                );
            }
            assert_eq!(bounds, node.bounds);
            (index + 1, 1)
        }
        BinaryKind::Inner { right } => {
            let right = index + right as usize;
            let (left_end, left_depth) = check(primitives, tree, index + 1, seen);
            assert_eq!(left_end, right, "depth-first order");
            let (end, right_depth) = check(primitives, tree, right, seen);
            let both = [index + 1, right].map(|child| tree.nodes[child].bounds);
            assert_eq!(both[0].union(&both[1]), node.bounds);
            (end, 1 + left_depth.max(right_depth))
        }
    }
}

#[test]
fn trees_are_valid_and_complete() {
    let mut rng = Rng::new(31);
    for generate in mesh::ALL {
        for size in [1, 7, 8, 9, 15, 16, 17, 40, 256, 257, 3000] {
            for spheres in [0, 3, size] {
                let mesh = generate(&mut rng, size);
                let primitives = primitives(&mesh, spheres, &mut rng);
                let tree = build(&primitives, &());
                if primitives.is_empty() {
                    assert_eq!(tree.node_count(), 0);
                    continue;
                }
                let mut seen = vec![0; primitives.len()];
                let (end, depth) = check(&primitives, &tree, 0, &mut seen);
                assert_eq!(end, tree.node_count());
                assert!(depth <= 95, "{} {size}: {depth} levels", mesh.name);
                assert!(seen.iter().all(|&times| times == 1), "{} {size}", mesh.name);
            }
        }
    }
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn levels_and_threads_make_no_difference() {
    let mut rng = Rng::new(32);
    for (size, threads) in [(50, vec![1]), (2000, vec![1]), (60_000, vec![1, 2, 4])] {
        for generate in [mesh::soup, mesh::bumpy_grid, mesh::mixed_scales] {
            let mesh = generate(&mut rng, size);
            let primitives = primitives(&mesh, 20, &mut rng);
            let mut expected = None;
            for isa in Isa::available() {
                for &threads in &threads {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
                    let pool = pool.build().expect("threads");
                    let tree = pool.install(|| build_on(&primitives, isa, &()));
                    let mut seen = vec![0; primitives.len()];
                    check(&primitives, &tree, 0, &mut seen);
                    let found = format!("{tree:?}");
                    let expected = expected.get_or_insert_with(|| found.clone());
                    assert!(
                        *expected == found,
                        "{} {size}: {} with {threads} threads differs",
                        mesh.name,
                        isa.level()
                    );
                }
            }
        }
    }
}

/// The heuristic over every split there is: area of all nodes below and including one over
/// `prims`.
fn full_sweep(bounds: &[Aabb], prims: &mut [usize], cost: &Cost) -> f64 {
    let all = |prims: &[usize]| {
        prims
            .iter()
            .fold(Aabb::EMPTY, |all, &prim| all.union(&bounds[prim]))
    };
    let area = f64::from(all(prims).half_area());
    if prims.len() <= BLOCK {
        return area;
    }
    let estimate = |prims: &[usize]| cost.of_box(&all(prims), prims.len());
    let sort = |prims: &mut [usize], axis: usize| {
        let center = |prim: usize| bounds[prim].min[axis] + bounds[prim].max[axis];
        prims.sort_by(|&a, &b| center(a).total_cmp(&center(b)).then(a.cmp(&b)));
    };
    let mut best = (f32::INFINITY, 0, 1);
    for axis in 0..3 {
        sort(prims, axis);
        for middle in 1..prims.len() {
            let sum = estimate(&prims[..middle]) + estimate(&prims[middle..]);
            if sum < best.0 {
                best = (sum, axis, middle);
            }
        }
    }
    sort(prims, best.1);
    let (left, right) = prims.split_at_mut(best.2);
    area + full_sweep(bounds, left, cost) + full_sweep(bounds, right, cost)
}

#[test]
fn the_tree_is_about_as_good_as_with_all_splits() {
    let cost = Cost::default();
    let generators = [mesh::soup, mesh::bumpy_grid, mesh::axis_aligned];
    let (mut found, mut best) = (0.0, 0.0);
    for seed in 0..24u64 {
        let mut rng = Rng::new(seed);
        let size = 20 + 20 * seed as usize;
        let mesh = generators[seed as usize % 3](&mut rng, size);
        let primitives = primitives(&mesh, 0, &mut rng);
        let bounds: Vec<Aabb> = (0..primitives.len())
            .map(|prim| primitives.bounds_of(prim))
            .collect();
        let mut prims: Vec<usize> = (0..bounds.len()).collect();
        let tree = build(&primitives, &());
        let root = f64::from(tree.nodes[0].bounds.half_area());
        let areas = tree.nodes.iter().map(|node| node.bounds.half_area());
        let this = areas.map(f64::from).sum::<f64>() / root;
        let reference = full_sweep(&bounds, &mut prims, &cost) / root;
        assert!(
            this < 1.15 * reference,
            "seed {seed}: {this} against {reference}"
        );
        found += this;
        best += reference;
    }
    assert!(found < 1.03 * best, "{found} against {best}");
}

/// A few items are divided where the heuristic is least, with the weight that each of them has.
#[test]
fn items_count_by_their_weights() {
    let seed = 33;
    let mut rng = Rng::new(seed);
    for round in 0..300 {
        let count = 2 + rng.below(MAX_SWEEP - 1);
        let boxes: Vec<_> = (0..count)
            .map(|_| Aabb::around(&[rng.point(1.0), rng.point(1.0)]))
            .collect();
        let weight = |_| if rng.below(4) == 0 { 100.0 } else { 1.0 };
        let weights = ItemWeights((0..count).map(weight).collect());
        let cost = |side: &[usize]| {
            let all = (side.iter()).fold(Aabb::EMPTY, |all, &item| all.union(&boxes[item]));
            let sum = side.iter().map(|&item| weights.0[item]).sum();
            weights.of(&Planes::new(&all, 0), sum)
        };
        let mut least = f32::INFINITY;
        for axis in 0..3 {
            let mut order: Vec<usize> = (0..count).collect();
            let center = |item: usize| boxes[item].min[axis] + boxes[item].max[axis];
            order.sort_by(|&a, &b| center(a).total_cmp(&center(b)));
            for middle in 1..count {
                least = least.min(cost(&order[..middle]) + cost(&order[middle..]));
            }
        }
        let mut items = Items::new(boxes.iter().copied(), &weights);
        let all = items.all();
        let halves = items.halves(&all);
        let [left, right] = halves.map(|part| items.indices(&part).collect::<Vec<_>>());
        let found = cost(&left) + cost(&right);
        assert!(
            found <= 1.0001 * least,
            "seed {seed} round {round}: {found} against {least}"
        );
        let mut both = [left, right].concat();
        both.sort_unstable();
        assert!(both.into_iter().eq(0..count));
    }
}
