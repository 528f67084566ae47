//! Lifted occluders: triangles that occlude many rays are found, and lifting them changes no answer.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use antumbra::lab::{
    BinaryStage, Cost, DuplicatesBvh, FrequentOccluders, Laboratory, LiftedFirstBvh,
};
use antumbra::{
    Brute, Builder, Bvh, Collapse, CostModel, INVALID_ID, Instance, Isa, Order, PrimId, Primitives,
    Ray, Recipe, Width,
};
use antumbra_testkit::{Rng, mesh};

use crate::support::{Stripes, brute, cutouts, geometry, square, upwards};

/// A world of triangles and cut-outs with many turned instances of both, and rays through it.
fn world(seed: u64) -> (Primitives, Vec<Ray>) {
    let mut rng = Rng::new(seed);
    let (ground, leaves) = (mesh::bumpy_grid(&mut rng, 400), mesh::soup(&mut rng, 60));
    let world = [
        geometry(&ground),
        cutouts(&leaves, Arc::new(Stripes { count: 5.0 })),
    ];
    let object = [geometry(&leaves)];
    let instances: Vec<_> = (0..20)
        .map(|_| Instance {
            object: 0,
            transform: core::array::from_fn(|_| core::array::from_fn(|_| rng.range(-0.7, 0.7))),
        })
        .collect();
    let primitives = Primitives::with_instances(&world, &[&object], &instances);
    let rays = (0..1500)
        .map(|_| Ray::between(rng.point(1.0), rng.point(1.4)))
        .collect();
    (primitives.expect("indices in range"), rays)
}

fn batch(bvh: &Bvh, rays: &[Ray]) -> Vec<bool> {
    let mut occluded = vec![false; rays.len()];
    bvh.occluded_batch(rays, &mut occluded);
    occluded
}

/// Node tests and primitive tests of all rays, at what they cost.
fn cost(bvh: &Bvh, rays: &[Ray]) -> f64 {
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut vec![false; rays.len()], &mut costs);
    let model = CostModel::default();
    let cost = |cost: &Cost| {
        f64::from(model.node) * f64::from(cost.node_tests)
            + f64::from(model.prim) * f64::from(cost.prim_tests)
    };
    costs.iter().map(cost).sum()
}

/// Each triangle is the one that occludes most of the rays left, by brute force. Cut-outs and instances are left out.
#[test]
fn frequent_occluders_are_chosen_greedily() {
    let (primitives, rays) = world(301);
    let bvh = Bvh::build_over(&primitives, &Recipe::default());
    let found = FrequentOccluders::new(&bvh, &rays, 12);
    let brute = Brute::new(primitives);
    let mut met: BTreeMap<PrimId, BTreeSet<usize>> = BTreeMap::new();
    for (index, ray) in rays.iter().enumerate() {
        for hit in brute.all_hits(ray) {
            if hit.inst_id == INVALID_ID && hit.geom_id == 0 {
                met.entry(hit.into()).or_default().insert(index);
            }
        }
    }
    let mut expected = Vec::new();
    for _ in 0..12 {
        let most = met.values().map(BTreeSet::len).max().expect("triangles");
        let best = met.iter().find(|(_, rays)| rays.len() == most);
        let (id, rays) = best.map(|(id, rays)| (*id, rays.clone())).expect("one");
        expected.push(id);
        met.values_mut()
            .for_each(|left| left.retain(|ray| !rays.contains(ray)));
    }
    assert_eq!(found.ids().collect::<Vec<_>>(), expected);
    assert_eq!((found.len(), found.is_empty()), (12, false));
    let none = FrequentOccluders::new(&bvh, &[], 12);
    assert!(none.is_empty());
}

/// On every level and width, ray by ray and in batches, beside brute force: triangles before the root, leaves duplicated
/// above, and triangles at the top of the tree, where closest hits and all hits stay as well.
#[test]
fn lifted_occluders_change_no_answer() {
    let (primitives, rays) = world(302);
    let brute = Brute::new(primitives.clone());
    let expected: Vec<_> = rays.iter().map(|ray| brute.occluded(ray)).collect();
    let closest: Vec<_> = rays.iter().map(|ray| brute.intersect(ray)).collect();
    let lists: Vec<_> = rays.iter().map(|ray| brute.all_hits(ray)).collect();
    for (collapse, width) in [
        (Collapse::Learned, Width::W4),
        (Collapse::Area, Width::W8),
        (Collapse::Learned, Width::W8),
        (Collapse::Learned, Width::W16),
    ] {
        let recipe = Recipe::default().collapse(collapse).width(width);
        let stage = BinaryStage::new(&primitives, &rays, &recipe);
        for isa in Isa::available() {
            let recipe = recipe.isa(isa);
            let place = format!("{collapse} x{width} {}", isa.level());
            let bvh = stage.learn(&primitives, &rays, &recipe);
            for count in [1, 8, 20, 1000] {
                let occluders = FrequentOccluders::new(&bvh, &rays, count);
                let first = LiftedFirstBvh::new(&bvh, &occluders);
                let mut occluded = vec![false; rays.len()];
                first.occluded_batch(&rays, &mut occluded);
                assert_eq!(occluded, expected, "{place} {count}");
                first.occluded_at_once(&rays, &mut occluded);
                for ((ray, at_once), expected) in rays.iter().zip(occluded).zip(&expected) {
                    assert_eq!(first.occluded(ray), *expected, "{place} {count}");
                    assert!(*expected || !at_once, "{place} {count}");
                }
                for in_blocks in [false, true] {
                    let lifted = stage.with_lifted(&primitives, &occluders, in_blocks);
                    let bvh = lifted.learn(&primitives, &rays, &recipe);
                    bvh.validate().expect("sound");
                    assert_eq!(batch(&bvh, &rays), expected, "{place} {count}");
                    for (index, ray) in rays.iter().enumerate().step_by(5) {
                        assert_eq!(bvh.occluded(ray), expected[index], "{place} {count}");
                        assert_eq!(bvh.intersect(ray), closest[index], "{place} {count}");
                        assert_eq!(bvh.all_hits(ray), lists[index], "{place} {count}");
                    }
                }
            }
            let (moved, _) = bvh.with_leaves_moved_up(&rays, &recipe.costs);
            moved.validate().expect("sound");
            assert_eq!(batch(&moved, &rays), expected, "{place}");
            for (index, ray) in rays.iter().enumerate() {
                assert_eq!(moved.occluded(ray), expected[index], "{place}");
                assert_eq!(moved.intersect(ray), closest[index], "{place}");
                assert_eq!(moved.all_hits(ray), lists[index], "{place}");
            }
            let duplicates = DuplicatesBvh::new(&bvh, &rays, &recipe.costs);
            assert_eq!(batch(duplicates.bvh(), &rays), expected, "{place}");
            for (ray, expected) in rays.iter().zip(&expected) {
                assert_eq!(duplicates.bvh().occluded(ray), *expected, "{place}");
            }
        }
    }
}

/// A wall that occludes all rays, among many small triangles: its leaf is lifted to the root, and rays are spared the nodes
/// between.
#[test]
fn a_wall_is_lifted_to_the_root() {
    let mut rng = Rng::new(303);
    let (wall, clutter) = (square(0.5), mesh::soup(&mut rng, 4000));
    let primitives = Primitives::new(&[geometry(&wall), geometry(&clutter)]).expect("in range");
    let rays = upwards(&mut rng, 2000);
    for width in Width::ALL {
        // An order by chance, so that the wall may be anywhere.
        let recipe = Recipe::default()
            .builder(Builder::BinnedSah)
            .collapse(Collapse::Area)
            .order(Order::Random)
            .width(width);
        let mut bvh = Bvh::build_over(&primitives, &recipe);
        let walls = FrequentOccluders::new(&bvh, &rays, 100);
        assert_eq!(walls.ids().map(|id| id.geom_id).collect::<Vec<_>>(), [0, 0]);
        bvh.relearn(&rays, &recipe.costs);
        let duplicates = DuplicatesBvh::new(&bvh, &rays, &recipe.costs);
        let (before, after) = (cost(&bvh, &rays), cost(duplicates.bvh(), &rays));
        assert!(
            duplicates.count() > 0 && after < before,
            "x{width}: {before} {after}"
        );
        let (moved, count) = bvh.with_leaves_moved_up(&rays, &recipe.costs);
        let after = cost(&moved, &rays);
        assert!(count > 0 && after < before, "x{width}: {before} {after}");
        let stage = BinaryStage::new(&primitives, &rays, &recipe);
        let lifted = stage.with_lifted(&primitives, &walls, true);
        let mut lifted = lifted.collapse(&primitives, &rays, &recipe);
        lifted.relearn(&rays, &recipe.costs);
        assert!(cost(&lifted, &rays) < before, "x{width}");
        let mut at_once = vec![false; rays.len()];
        LiftedFirstBvh::new(&bvh, &walls).occluded_at_once(&rays, &mut at_once);
        assert!(at_once.iter().all(|occluded| *occluded));
    }
}

/// A tree of moved leaves is saved, read and refitted like any other, and may be lifted again. Without rays nothing moves.
#[test]
fn moved_leaves_are_saved_and_refitted() {
    let mut rng = Rng::new(304);
    let meshes = [square(0.3), mesh::soup(&mut rng, 900)];
    let mut later = meshes.clone();
    for mesh in &mut later {
        for position in &mut mesh.positions {
            position[0] += 0.25 * position[1];
        }
    }
    let geometries = meshes.each_ref().map(geometry);
    let rays: Vec<_> = (0..1200)
        .map(|_| Ray::between(rng.point(1.0), rng.point(1.0)))
        .collect();
    for width in Width::ALL {
        let recipe = Recipe::default().width(width);
        let bvh = Bvh::learn(&geometries, &rays, &recipe).expect("a tree");
        assert_eq!(bvh.with_leaves_moved_up(&[], &recipe.costs).1, 0);
        let (moved, count) = bvh.with_leaves_moved_up(&rays, &recipe.costs);
        assert!(count > 0, "x{width}");
        let bytes = moved.to_bytes().expect("triangles alone");
        let mut read = Bvh::from_bytes(&bytes).expect("just written");
        let again = moved.with_leaves_moved_up(&rays, &recipe.costs).0;
        let check = |bvh: &Bvh, oracle: &Brute| {
            bvh.validate().expect("sound");
            let expected: Vec<_> = rays.iter().map(|ray| oracle.occluded(ray)).collect();
            assert_eq!(batch(bvh, &rays), expected, "x{width}");
            for ray in rays.iter().step_by(7) {
                assert_eq!(bvh.intersect(ray), oracle.intersect(ray), "x{width}");
            }
        };
        let oracle = brute(&geometries);
        for bvh in [&moved, &read, &again] {
            check(bvh, &oracle);
        }
        let geometries = later.each_ref().map(geometry);
        read.refit(&geometries).expect("the same triangles");
        check(&read, &brute(&geometries));
    }
}
