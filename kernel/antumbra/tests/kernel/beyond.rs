//! Learning while running, and leaves of few primitives. Neither changes an answer.

use std::sync::Arc;

use antumbra::parts::{Cost, Steps};
use antumbra::recipe::{Collapse, Order};
use antumbra::{Bvh, Instance, Primitives, Ray, RayMemory, Recipe};
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
    bvh.batch(rays).occluded_into(&mut occluded);
    occluded
}

fn node_tests(bvh: &Bvh, rays: &[Ray]) -> u64 {
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut vec![false; rays.len()], &mut costs);
    costs.iter().map(|cost| u64::from(cost.node_tests)).sum()
}

/// Instances and cut-outs too, from a sample of the batches.
#[test]
fn a_tree_on_two_levels_learns_while_running() {
    let (primitives, rays) = world(95);
    let recipe = Recipe::default()
        .collapse(Collapse::Area)
        .order(Order::Simple);
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
