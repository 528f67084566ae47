use crate::trace::engine::Engine;
use alloc::format;
use alloc::vec;
use alloc::vec::Vec;

use crate::Bvh;
use crate::builder::Builder;
use crate::geometry::primitives::Primitives;
use crate::geometry::{Geometry, Instance};
use crate::learn::log::Log;
use crate::order::Order;
use crate::order::joint::groups::least_cost;
use crate::order::joint::learner::Learner;
use crate::order::joint::passage::Passage;
use crate::parts::Steps;
use crate::ray::Ray;
use crate::shape::Shape;
use crate::trace::observe::Cost;
use crate::tree::binary::BinaryTree;
use crate::tree::costs::CostModel;
use crate::tree::node::MAX_WIDTH;
use crate::tree::slot_order::SlotOrder;
use crate::tree::width::Width;
use antumbra_testkit::{Rng, mesh};

/// Sums of these are exact; entering an instance is not counted when costs are measured.
const MODEL: CostModel = CostModel {
    node: 1.0,
    prim: 0.25,
    entry: 0.0,
    cutout: 0.5,
};

fn rays(rng: &mut Rng, count: usize) -> Vec<Ray> {
    (0..count)
        .map(|_| Ray::between(rng.point(1.2), rng.point(1.2)))
        .collect()
}

fn soup(rng: &mut Rng, size: usize) -> Primitives {
    let mesh = mesh::soup(rng, size);
    let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    Primitives::new(&geometry).expect("indices in range")
}

fn with_instances(rng: &mut Rng) -> Primitives {
    let object = mesh::soup(rng, 150);
    let world = mesh::bumpy_grid(rng, 100);
    let [object, world] =
        [&object, &world].map(|mesh| [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])]);
    let instances: Vec<_> = (0..40)
        .map(|_| {
            Instance::new(
                0,
                core::array::from_fn(|_| core::array::from_fn(|_| rng.range(-0.8, 0.8))),
            )
        })
        .collect();
    Primitives::with_instances(&world, &[object], &instances).expect("indices in range")
}

fn log(bvh: &Bvh, rays: &[Ray]) -> Log {
    let mut log = bvh.new_log(Order::Joint.log_kind().expect("a learned order"), 1);
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_logged(rays, &mut vec![false; rays.len()], &mut costs, &mut log);
    log
}

/// Cost of rays in the tree as it is.
fn measured(bvh: &Bvh, rays: &[Ray]) -> f64 {
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut vec![false; rays.len()], &mut costs);
    costs
        .iter()
        .map(|cost| f64::from(cost.node_tests) + 0.25 * f64::from(cost.prim_tests))
        .sum()
}

/// Cost of the rays of a log by the learner's account once everything is sorted.
fn accounted(bvh: &Bvh, log: &Log) -> f64 {
    let rays = log.masks().expect("masks");
    let mut learner = Learner::new(&bvh.tree, rays, &MODEL);
    learner.learn(&());
    total(&learner)
}

/// Cost of all rays by the account.
fn total(learner: &Learner) -> f64 {
    let visits = learner.visits.iter().zip(&learner.costs);
    visits
        .filter(|(visit, _)| visit.node == 0)
        .map(|(_, cost)| cost)
        .sum()
}

/// A tree of every width over one level and over two, with some rays and their log.
fn trees(seed: u64, check: impl Fn(&str, &Bvh, &[Ray], &Log)) {
    let mut rng = Rng::new(seed);
    for (name, primitives) in [
        ("soup", soup(&mut rng, 1500)),
        ("instances", with_instances(&mut rng)),
    ] {
        let rays = rays(&mut rng, 1500);
        let tree = BinaryTree::build(&primitives, Builder::default());
        for width in Width::ALL {
            let bvh = Bvh::collapse(
                &primitives,
                &tree,
                crate::recipe::Collapse::Area,
                Engine::best(width),
            );
            let log = log(&bvh, &rays);
            check(&format!("seed {seed} {name} x{width}"), &bvh, &rays, &log);
        }
    }
}

/// The account is right: the rays of the log cost exactly that when they are traced in the tree so ordered, on one
/// level and on two.
#[test]
fn costs_are_those_that_are_measured() {
    trees(91, |place, built, rays, log| {
        let mut bvh = built.clone();
        let plan = bvh.plan(Order::Joint, Some(log), &MODEL);
        bvh.apply(&plan.expect("a log"));
        let cost = measured(&bvh, rays);
        assert_eq!(cost, accounted(built, log), "{place}");
        assert!(cost < measured(built, rays), "{place}");
    });
}

/// Sorting for the rays that arrive makes them cheaper than sorting for all that hit a box.
#[test]
fn a_second_round_pays() {
    trees(95, |place, bvh, _, log| {
        let mut learner = Learner::new(&bvh.tree, log.masks().expect("masks"), &MODEL);
        learner.sort_all();
        let once = total(&learner);
        let cost = accounted(bvh, log);
        assert!(cost < once, "{place}: {cost} after {once}");
    });
}

/// Calls `visit` with every permutation of the first `len` slots.
fn permutations(slots: &mut [u8; 8], from: usize, len: usize, visit: &mut impl FnMut(&[u8; 8])) {
    if from == len {
        visit(slots);
    }
    for other in from..len {
        slots.swap(from, other);
        permutations(slots, from + 1, len, visit);
        slots.swap(from, other);
    }
}

/// Trees of one node: all orders of its children are tried on the rays themselves.
#[test]
fn no_order_of_a_small_node_is_cheaper() {
    let seed = 92;
    let mut rng = Rng::new(seed);
    let mut tried = 0;
    while tried < 12 {
        let size = 12 + rng.below(20);
        let primitives = soup(&mut rng, size);
        let tree = BinaryTree::build(&primitives, Builder::default());
        let built = Bvh::collapse(
            &primitives,
            &tree,
            crate::recipe::Collapse::Area,
            Engine::best(Width::W8),
        );
        let nodes = &built.tree.nodes;
        let len = nodes.get(0).len();
        if nodes.len() > 1 || !(3..=5).contains(&len) {
            continue;
        }
        tried += 1;
        let rays = rays(&mut rng, 400);
        let log = log(&built, &rays);
        let cost_of = |plan: &SlotOrder| {
            let mut bvh = built.clone();
            bvh.apply(plan);
            measured(&bvh, &rays)
        };
        let joint = built.plan(Order::Joint, Some(&log), &MODEL);
        let joint = cost_of(&joint.expect("a log"));
        let mut best = f64::INFINITY;
        let shape: Shape = built.shape();
        permutations(&mut [0, 1, 2, 3, 4, 5, 6, 7], 0, len, &mut |slots| {
            best = best.min(cost_of(&SlotOrder {
                slots: slots.to_vec(),
                ..SlotOrder::as_built(shape)
            }));
        });
        assert_eq!(joint, best, "seed {seed}: {len} children");
    }
}

/// Where independence fails: two children occlude the same rays, a third one the others. By itself, each of the two
/// stops more rays than the third; once one of them has been visited, the other one stops none.
#[test]
fn what_is_stopped_already_is_not_counted_again() {
    let mut costs = [0.0; MAX_WIDTH];
    costs[..3].fill(1.0);
    let passage = |occluding: u16| Passage {
        visit: 0,
        hit: 0b111,
        occluding,
        weight: 1.0,
        costs,
    };
    let passages: Vec<_> = (0..10)
        .map(|ray| passage(if ray < 6 { 0b011 } else { 0b100 }))
        .collect();
    let order = least_cost(&passages, &[0, 1, 2, 3]);
    assert_eq!(order[..4], [0, 2, 1, 3]);
}

/// Who logged which rays, and in which sequence, changes nothing.
#[test]
fn orders_do_not_depend_on_the_division_of_rays() {
    let mut rng = Rng::new(93);
    let primitives = with_instances(&mut rng);
    let rays = rays(&mut rng, 1000);
    let tree = BinaryTree::build(&primitives, Builder::default());
    let bvh = Bvh::collapse(
        &primitives,
        &tree,
        crate::recipe::Collapse::Area,
        Engine::best(Width::W16),
    );
    let whole = log(&bvh, &rays);
    let mut parts = log(&bvh, &[]);
    for part in rays.chunks(97).rev() {
        parts.merge(&log(&bvh, part));
    }
    assert_eq!(parts, whole);
    // Costs that are no sums of powers of two.
    let plan = |log| bvh.plan(Order::Joint, Some(log), &CostModel::default());
    assert_eq!(plan(&parts), plan(&whole));
}
