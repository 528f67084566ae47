//! The oracle is a bound for every order.

use antumbra::parts::{Cost, Steps};
use antumbra::recipe::{Collapse, CostModel, Engine, Order};
use antumbra::{Bvh, Ray, Recipe, Width};
use antumbra_testkit::{Mesh, Rng, mesh};
use antumbra_trees::{ORDERS, Visits, oracle_visits, visits};

use crate::geometry;

/// A wall of small triangles before a few large ones: the kind of scene an order matters in.
fn scene(rng: &mut Rng) -> Mesh {
    let mut mesh = mesh::soup(rng, 4000);
    let grid = mesh::bumpy_grid(rng, 200);
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(
        grid.positions
            .iter()
            .map(|p| [p[0] * 2.0, p[1] * 2.0, p[2] + 1.2]),
    );
    mesh.indices
        .extend(grid.indices.iter().map(|t| t.map(|vertex| vertex + first)));
    mesh
}

fn build(mesh: &Mesh, width: Width) -> Bvh {
    let options = Recipe::default()
        .collapse(Collapse::Area)
        .engine(Engine::best(width))
        .order(Order::Simple);
    Bvh::build(&[geometry(mesh)], &options).expect("indices in range")
}

/// Of the oracle: one node test in a tree of one node; never more than any order takes, and the same for rays that
/// nothing occludes; in a small tree, what the best of many random orders takes for each ray.
#[test]
fn no_order_beats_the_oracle() {
    let seed = 16;
    let mut rng = Rng::new(seed);
    let mesh = scene(&mut rng);
    let [training, test] = [2000, 3000].map(|count| {
        (0..count)
            .map(|_| Ray::between(rng.point(1.5), rng.point(1.5)))
            .collect::<Vec<_>>()
    });
    for width in Width::ALL {
        let built = build(&mesh, width);
        let oracle = oracle_visits(&built, &test);
        assert!(
            oracle.occluded_rays > 300 && oracle.unoccluded_rays > 50,
            "seed {seed}: {oracle:?}"
        );
        let mut most = 0.0;
        for order in ORDERS {
            let mut bvh = built.clone();
            let log = order.log_kind().map(|kind| bvh.log_of(&training, kind, 3));
            let plan = bvh.plan(order, log.as_ref(), &CostModel::default());
            bvh.apply(&plan.expect("a log"));
            let visits = visits(&bvh, &test);
            let place = format!("seed {seed} x{width} {order}: {visits:?}, oracle {oracle:?}");
            assert_eq!(oracle_visits(&bvh, &test), oracle, "{place}");
            assert_eq!(visits.occluded_rays, oracle.occluded_rays, "{place}");
            assert_eq!(
                (visits.unoccluded_rays, visits.unoccluded_tests),
                (oracle.unoccluded_rays, oracle.unoccluded_tests),
                "{place}"
            );
            assert!(visits.occluded_tests >= oracle.occluded_tests, "{place}");
            most = f64::max(most, visits.occluded());
        }
        assert!(oracle.occluded() < 0.9 * most, "x{width}: {oracle:?}");
    }
    let nowhere = [Ray::new([f32::NAN; 3], [1.0; 3]); 3];
    let bvh = build(&mesh, Width::W4);
    let none = Visits {
        unoccluded_rays: 3,
        ..Visits::default()
    };
    assert_eq!(oracle_visits(&bvh, &nowhere), none);
    assert_eq!(visits(&bvh, &nowhere), none);
    assert_eq!(oracle_visits(&bvh, &[]), Visits::default());
    assert_eq!(none.occluded(), 0.0);
}

/// A tree of a few nodes: the shortest path of each ray is what it takes under the luckiest of all orders.
#[test]
fn the_oracle_is_the_best_of_all_orders() {
    let seed = 17;
    let mut rng = Rng::new(seed);
    let mesh = mesh::soup(&mut rng, 60);
    let rays: Vec<_> = (0..200)
        .map(|_| Ray::between(rng.point(1.2), rng.point(1.2)))
        .collect();
    let built = build(&mesh, Width::W4);
    assert!(built.report().depth > 1);
    let model = CostModel::default();
    let mut best = vec![u32::MAX; rays.len()];
    for ray in &rays {
        // Learned from one ray alone, an order takes that ray the shortest way.
        let mut bvh = built.clone();
        let kind = Order::Joint.log_kind().expect("a learned order");
        let log = bvh.log_of(std::slice::from_ref(ray), kind, 3);
        let nodes_only = model.prim(0.0).cutout(0.0);
        let plan = bvh.plan(Order::Joint, Some(&log), &nodes_only);
        bvh.apply(&plan.expect("a log"));
        let mut costs = vec![Cost::default(); rays.len()];
        bvh.occluded_batch_counted(&rays, &mut vec![false; rays.len()], &mut costs);
        for (best, cost) in best.iter_mut().zip(costs) {
            *best = cost.node_tests.min(*best);
        }
    }
    for (ray, best) in rays.iter().zip(best) {
        let oracle = oracle_visits(&built, std::slice::from_ref(ray));
        let tests = oracle.occluded_tests + oracle.unoccluded_tests;
        assert_eq!(tests, u64::from(best), "seed {seed}: {ray:?}");
    }
}
