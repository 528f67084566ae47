//! Scenes on two levels: what is counted, logged and learned, and surface rays.

use crate::support::{BUILDERS, geometry, kernel_rays};
use crate::transforms::{IDENTITY, product, rotation, scale, translation};
use antumbra::parts::{BinaryTree, Cost, Learning, Steps, TreeLog, surface_rays};
use antumbra::recipe::{Builder, Collapse, CostModel, Engine, Order};
use antumbra::{Bvh, Error, Geometry, Instance, Primitives, Ray, Recipe, Width};
use antumbra_testkit::{Rng, mesh, rays};

/// A ground with many trees of one kind, overlapping each other, and rays among them.
fn forest(rng: &mut Rng) -> (Primitives, Vec<Ray>) {
    let mut leaves = mesh::soup(rng, 400).map("tree", |p| p.map(|x| 0.4 * x));
    for corners in leaves.indices.clone() {
        // Small leaves at random places.
        let [a, b, c] = corners.map(|index| index as usize);
        let p = leaves.positions[a];
        for index in [b, c] {
            let offset = rng.point(0.05);
            leaves.positions[index] = core::array::from_fn(|axis| p[axis] + offset[axis]);
        }
    }
    let ground = vec![
        [-9.0, 0.0, -9.0],
        [9.0, 0.0, -9.0],
        [9.0, 0.0, 9.0],
        [-9.0, 0.0, 9.0],
    ];
    let ground = Geometry::triangles(ground, vec![[0, 1, 2], [0, 2, 3]]);
    let instances: Vec<_> = (0..300)
        .map(|_| {
            let [x, _, z] = rng.point(4.0);
            let turned = product(&translation([x, 0.4, z]), &rotation(rng));
            Instance::new(0, product(&turned, &scale([rng.range(0.5, 2.0); 3])))
        })
        .collect();
    let primitives = Primitives::with_instances(&[ground], &[[geometry(&leaves)]], &instances)
        .expect("indices in range");
    let rays = (0..6000)
        .map(|_| {
            let [x, y, z] = rng.point(4.0);
            let to = rng.point(4.0);
            Ray::between([x, 0.01 + 0.3 * y.abs(), z], [to[0], 1.5, to[2]])
        })
        .collect();
    (primitives, rays)
}

fn costs(bvh: &Bvh, rays: &[Ray]) -> Vec<Cost> {
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut vec![false; rays.len()], &mut costs);
    costs
}

fn node_tests(bvh: &Bvh, rays: &[Ray]) -> (u64, u64) {
    costs(bvh, rays).iter().fold((0, 0), |(all, top), cost| {
        assert!(cost.top_node_tests <= cost.node_tests);
        let (one, one_top) = (cost.node_tests, cost.top_node_tests);
        (all + u64::from(one), top + u64::from(one_top))
    })
}

/// What is learned from some rays makes others cheaper, on both levels: the learned order and the learned
/// tree.
#[test]
fn learning_lowers_costs_on_both_levels() {
    let mut rng = Rng::new(416);
    let (primitives, rays) = forest(&mut rng);
    let (training, test) = rays.split_at(2000);
    let tree = BinaryTree::build(&primitives, Builder::default());
    for width in Width::ALL {
        let built = Bvh::collapse(&primitives, &tree, Collapse::Area, Engine::best(width));
        let (simple, simple_top) = node_tests(&built, test);
        let kind = Order::SortPlus.log_kind().expect("a learned order");
        let mut log = built.new_log(kind, 3);
        let mut answers = vec![false; training.len()];
        let mut costs = vec![Cost::default(); training.len()];
        built.occluded_batch_logged(training, &mut answers, &mut costs, &mut log);
        let model = CostModel::default();
        let plan = built
            .plan(Order::SortPlus, Some(&log), &model)
            .expect("a log");
        let before = built
            .predicted_cost(&log, &model, None)
            .expect("its own log");
        let after = built
            .predicted_cost(&log, &model, Some(&plan))
            .expect("its own log");
        assert!(
            after < before,
            "x{width}: predicted {after}, not below {before}"
        );
        let mut bvh = built.clone();
        bvh.apply(&plan);
        let (sorted, sorted_top) = node_tests(&bvh, test);
        println!("x{width}: {simple} {simple_top}, sorted {sorted} {sorted_top}");
        assert!(sorted < simple, "x{width}: {sorted}, not below {simple}");
        assert!(sorted_top > 0 && sorted_top < sorted);

        let mut log = TreeLog::new(&tree);
        log.add(&primitives, &tree, training, 1000.0);
        let learning = Learning::default();
        let learned =
            Bvh::collapse_logged(&primitives, &tree, &log, &learning, Engine::best(width));
        let (learned, top) = node_tests(&learned, test);
        println!("learned {learned} {top}");
        assert!(learned < simple, "x{width}: {learned}, not below {simple}");
    }
}

/// Without instances all tests are in the one tree; orders of one tree do not fit another that has as many nodes
/// and leaves but places its objects differently.
#[test]
fn trees_are_told_apart() {
    let mut rng = Rng::new(417);
    let mesh = mesh::soup(&mut rng, 100);
    let place = |count: usize| {
        let instances = vec![Instance::new(0, IDENTITY); count];
        let primitives = Primitives::with_instances(&[], &[[geometry(&mesh)]], &instances)
            .expect("indices in range");
        Bvh::build(&primitives, &Recipe::default()).expect("a tree")
    };
    let (one, two) = (place(1), place(2));
    let plan = one
        .plan(Order::Sato, None, &CostModel::default())
        .expect("no log");
    let log = one.new_log(Order::Sort.log_kind().expect("a learned order"), 0);
    let model = CostModel::default();
    assert!(matches!(
        two.predicted_cost(&log, &model, Some(&plan)),
        Err(Error::OtherTree { .. })
    ));
    let plain = Bvh::build(&[geometry(&mesh)], &Recipe::default()).expect("in range");
    let rays = kernel_rays(&rays::around(&mut rng, &mesh, 100));
    let (all, top) = node_tests(&plain, &rays);
    assert!(all == top && all > 0);
}

/// The same tree, bit for bit, whatever the number of threads: the answers and every count.
#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn two_levels_do_not_depend_on_the_number_of_threads() {
    let mut rng = Rng::new(418);
    let (primitives, rays) = forest(&mut rng);
    for builder in BUILDERS {
        let options = Recipe::default().builder(builder);
        let built = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.expect("threads");
            let bvh = pool.install(|| Bvh::build(&primitives, &options).expect("a tree"));
            (bvh.report(), costs(&bvh, &rays))
        });
        assert!(
            built[1..].iter().all(|other| *other == built[0]),
            "{builder}"
        );
    }
}

/// Points on instances: as many as their surface in the world asks for, and on it.
#[test]
fn surface_rays_start_on_instances_too() {
    let quad = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];
    let quad = Geometry::triangles(quad, vec![[0, 1, 2], [0, 2, 3]]);
    // Nine times the area of the world's own quad, far away and mirrored.
    let transform = product(&translation([100.0, 0.0, 50.0]), &scale([-3.0, 3.0, 7.0]));
    let instance = Instance::new(0, transform);
    let primitives =
        Primitives::with_instances(std::slice::from_ref(&quad), &[[quad.clone()]], &[instance])
            .expect("indices in range");
    let rays = surface_rays(&primitives, 8000, 5);
    let placed = rays.iter().filter(|ray| ray.org[0] > 50.0);
    for ray in placed.clone() {
        assert!((ray.org[2] - 50.0).abs() < 0.01, "{ray:?}");
        assert!((97.0..=100.0).contains(&ray.org[0]) && (0.0..=3.0).contains(&ray.org[1]));
    }
    // Half by area, 9 of 10; half by its root, 3 of 4.
    let expected = 8000.0 * 0.5 * (0.9 + 0.75);
    let found = placed.count() as f64;
    assert!((found - expected).abs() < 20.0, "{found}, not {expected}");
}
