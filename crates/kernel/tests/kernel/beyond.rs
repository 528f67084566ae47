//! What goes beyond a static order: ways of picking, learning while running.
//! None changes an answer.

use std::sync::Arc;

use antumbra::cutout::Opacity;
use antumbra::lab::{Cost, Laboratory};
use antumbra::recipe::{Builder, Collapse, CostModel, Order};
use antumbra::{Bvh, Functions, Instance, Primitives, Ray, RayMemory, Recipe, Width};
use antumbra_testkit::{Rng, mesh};

use crate::support::{Stripes, cutouts, geometry};

/// A world of triangles and cut-outs with many turned instances, and rays through it.
fn world(seed: u64) -> (Primitives, Vec<Ray>) {
    let mut rng = Rng::new(seed);
    let (ground, leaves) = (mesh::bumpy_grid(&mut rng, 400), mesh::soup(&mut rng, 120));
    let object = [cutouts(&leaves, Arc::new(Stripes { count: 5.0 }))];
    let instances: Vec<_> = (0..40)
        .map(|_| {
            Instance::new(
                0,
                core::array::from_fn(|_| core::array::from_fn(|_| rng.range(-0.7, 0.7))),
            )
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
        let bvh = Bvh::build(&primitives, &recipe).expect("a tree");
        let mut picking = bvh.clone();
        let ways = picking.learn_ways(training, &CostModel::default());
        assert!(ways[1] + ways[2] > 0, "{ways:?}");
        assert_eq!(answers(&picking, test), answers(&bvh, test));
        assert!(node_tests(&picking, training) < node_tests(&bvh, training));
        // Saved and read again it picks in the same ways.
        let stripes: Arc<dyn Opacity> = Arc::new(Stripes { count: 5.0 });
        let functions = Functions::new().filters(vec![stripes]);
        let read = functions.from_bytes(&picking.to_bytes());
        let read: Bvh = read.expect("a file of ours");
        assert_eq!(answers(&read, test), answers(&bvh, test));
        assert_eq!(node_tests(&read, training), node_tests(&picking, training));
    }
}

/// Instances and cut-outs too, from a sample of the batches.
#[test]
fn a_tree_on_two_levels_learns_while_running() {
    let (primitives, rays) = world(95);
    let recipe = Recipe::default().order(Order::Random);
    let mut bvh = Bvh::build(&primitives, &recipe).expect("a tree");
    let (expected, before) = (answers(&bvh, &rays), node_tests(&bvh, &rays));
    let mut memory = RayMemory::new(2000);
    for batch in rays.chunks(500) {
        memory.show(batch);
    }
    bvh.relearn(memory.rays(), &Recipe::default());
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
    let (large, small) = (build(Builder::BinnedSah), build(Builder::Pbrt));
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
