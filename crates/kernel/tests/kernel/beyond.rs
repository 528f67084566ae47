//! What goes beyond a static order: caches of occluders, copies by octant, ways of picking, learning while running.
//! None changes an answer.

use std::sync::Arc;

use antumbra::lab::{Cost, Laboratory, OccluderCache};
use antumbra::{
    Builder, Bvh, Collapse, CostModel, Error, Instance, Isa, Order, Primitives, Ray, RayMemory,
    Recipe, Width,
};
use antumbra_testkit::{Rng, mesh};

use crate::support::{Stripes, cutouts, geometry};

/// A world of triangles and cut-outs with many turned instances, and rays through it.
fn world(seed: u64) -> (Primitives, Vec<Ray>) {
    let mut rng = Rng::new(seed);
    let (ground, leaves) = (mesh::bumpy_grid(&mut rng, 400), mesh::soup(&mut rng, 120));
    let object = [cutouts(&leaves, Arc::new(Stripes { count: 5.0 }))];
    let instances: Vec<_> = (0..40)
        .map(|_| Instance {
            object: 0,
            transform: core::array::from_fn(|_| core::array::from_fn(|_| rng.range(-0.7, 0.7))),
        })
        .collect();
    let primitives = Primitives::with_instances(&[geometry(&ground)], &[&object], &instances);
    let rays = (0..3500)
        .map(|_| Ray::between(rng.point(1.0), [0.3, 1.4, 0.2]))
        .collect();
    (primitives.expect("indices in range"), rays)
}

fn answers(bvh: &Bvh, rays: &[Ray]) -> Vec<bool> {
    let mut occluded = vec![false; rays.len()];
    bvh.occluded_batch(rays, &mut occluded);
    occluded
}

fn node_tests(bvh: &Bvh, rays: &[Ray]) -> u64 {
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut vec![false; rays.len()], &mut costs);
    costs.iter().map(|cost| u64::from(cost.node_tests)).sum()
}

/// In batches and ray by ray, on every level, empty and full, with room for little and for all.
#[test]
fn a_cache_of_occluders_changes_no_answer() {
    let (primitives, rays) = world(91);
    for isa in Isa::available() {
        for width in Width::ALL {
            let bvh = Bvh::build_over(&primitives, &Recipe::default().isa(isa).width(width));
            let expected = answers(&bvh, &rays);
            for (size, cells, facets) in [(4, 8, 1), (14, 32, 3)] {
                let mut cache = OccluderCache::new(&rays, size, cells, facets);
                for round in 0..3 {
                    let mut occluded = vec![round == 1; rays.len()];
                    cache.occluded_batch(&bvh, &rays, &mut occluded);
                    assert_eq!(occluded, expected, "{} x{width}", isa.level());
                }
                let counts = cache.counts();
                assert_eq!(counts.rays, 3 * rays.len() as u64);
                assert!(counts.right <= counts.guesses && counts.guesses <= counts.rays);
                if size > 4 {
                    let occluded = expected.iter().filter(|one| **one).count() as u64;
                    assert!(5 * counts.right > 3 * occluded, "{counts:?}");
                }
                for (ray, expected) in rays.iter().zip(&expected).take(500) {
                    assert_eq!(cache.occluded(&bvh, ray), *expected);
                }
            }
        }
    }
}

/// Rays that cannot hit anything, and no rays at all.
#[test]
fn a_cache_takes_any_ray() {
    let (primitives, _) = world(92);
    let bvh = Bvh::build_over(&primitives, &Recipe::default());
    let odd = [
        Ray::new([f32::NAN; 3], [1.0, 0.0, 0.0]),
        Ray::new([0.0; 3], [0.0; 3]),
        Ray::new([f32::MAX; 3], [f32::MIN_POSITIVE, 0.0, -1.0]),
        Ray::new([0.0; 3], [f32::INFINITY, 1.0, 0.0]),
    ];
    for seen in [&odd[..], &[]] {
        let mut cache = OccluderCache::new(seen, 8, 32, 3);
        let mut occluded = [true; 4];
        cache.occluded_batch(&bvh, &odd, &mut occluded);
        assert_eq!(&occluded[..], answers(&bvh, &odd));
        cache.occluded_batch(&bvh, &[], &mut []);
    }
}

/// Copies visit what the table of orders visits, and answer the same: rays in batches, rays alone, closest hits.
#[test]
fn copies_by_octant_are_the_orders_by_octant() {
    let (primitives, rays) = world(93);
    let (training, test) = (&rays[..2000], &rays[2000..3500]);
    for width in Width::ALL {
        let recipe = Recipe::default().width(width);
        for order in [Order::TwoWay, Order::Octants] {
            let bvh = Bvh::learn_over(&primitives, training, &recipe.order(order));
            let copies = bvh.with_octant_copies().expect("orders by direction");
            let expected = answers(&bvh, test);
            assert_eq!(answers(&copies, test), expected);
            for (ray, expected) in test.iter().zip(&expected).take(500) {
                assert_eq!(copies.occluded(ray), *expected);
                assert_eq!(copies.intersect(ray), bvh.intersect(ray));
            }
            assert_eq!(node_tests(&copies, test), node_tests(&bvh, test), "{order}");
            let mut copies = copies;
            assert_eq!(copies.to_bytes(), Err(Error::HasCopies));
            assert_eq!(copies.refit(&[]), Err(Error::HasCopies));
        }
        let joint = Bvh::learn_over(&primitives, training, &recipe);
        assert!(joint.with_octant_copies().is_none(), "one order for all");
    }
}

/// A way of picking for each node costs the training rays no more than the order of slots, and answers the same.
#[test]
fn nodes_pick_in_their_own_ways() {
    let (primitives, rays) = world(94);
    let (training, test) = rays.split_at(3000);
    for width in Width::ALL {
        let recipe = Recipe::default()
            .collapse(Collapse::Area)
            .order(Order::Simple)
            .width(width);
        let bvh = Bvh::build_over(&primitives, &recipe);
        let mut picking = bvh.clone();
        let ways = picking.learn_ways(training, &CostModel::default());
        assert!(ways[1] + ways[2] > 0, "{ways:?}");
        assert_eq!(answers(&picking, test), answers(&bvh, test));
        assert!(node_tests(&picking, training) < node_tests(&bvh, training));
        // Saved and read again it picks in the same ways.
        assert!(picking.to_bytes().is_err(), "filters are code");
    }
}

/// Instances and cut-outs too, from a sample of the batches.
#[test]
fn a_tree_on_two_levels_learns_while_running() {
    let (primitives, rays) = world(95);
    let recipe = Recipe::default().order(Order::Random);
    let mut bvh = Bvh::build_over(&primitives, &recipe);
    let (expected, before) = (answers(&bvh, &rays), node_tests(&bvh, &rays));
    let mut memory = RayMemory::new(2000);
    for batch in rays.chunks(500) {
        memory.show(batch);
    }
    bvh.relearn(memory.rays(), &recipe.costs);
    assert_eq!(answers(&bvh, &rays), expected);
    assert!(node_tests(&bvh, &rays) < before);
    bvh.validate().expect("sound");
}

/// Leaves of at most four primitives hold all primitives, and more nodes.
#[test]
fn small_leaves_hold_everything() {
    let mut rng = Rng::new(96);
    let mesh = mesh::soup(&mut rng, 3000);
    let rays: Vec<_> = (0..2000)
        .map(|_| Ray::between(rng.point(1.0), rng.point(1.0)))
        .collect();
    let build = |builder| {
        let recipe = Recipe::default()
            .builder(builder)
            .collapse(Collapse::Area)
            .order(Order::Simple);
        let bvh = Bvh::build(&[geometry(&mesh)], &recipe).expect("a tree");
        bvh.validate().expect("sound");
        bvh
    };
    let (large, small) = (build(Builder::BinnedSah), build(Builder::BinnedSah4));
    assert_eq!(answers(&large, &rays), answers(&small, &rays));
    let most = |bvh: &Bvh| {
        // A ray that meets one leaf tests at most as many primitives as leaves times their size.
        let mut costs = vec![Cost::default(); rays.len()];
        bvh.occluded_batch_counted(&rays, &mut vec![false; rays.len()], &mut costs);
        costs
            .iter()
            .map(|cost| u64::from(cost.prim_tests))
            .sum::<u64>()
    };
    assert!(most(&small) < most(&large));
}
