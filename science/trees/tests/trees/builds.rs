//! Trees: the same for any number of threads, shallow, complete, and back from files.

use antumbra::parts::{Cost, Steps};
use antumbra::recipe::{Builder, Collapse, Engine, Order};
use antumbra::{Bvh, Geometry, Instance, Primitives, Ray, Recipe, Width};
use antumbra_testkit::{Rng, mesh};
use antumbra_trees::{BUILDERS, ORDERS, PBRT};

use crate::geometry;

/// Objects large enough that threads share one, too.
#[test]
fn trees_do_not_depend_on_the_number_of_threads() {
    let mut rng = Rng::new(21);
    let [world, object] = [12_000, 3000].map(|size| mesh::soup(&mut rng, size));
    let instances: Vec<_> = (0..20)
        .map(|_| {
            let transform = std::array::from_fn(|_| std::array::from_fn(|_| rng.range(-1.0, 1.0)));
            Instance::new(0, transform)
        })
        .collect();
    for (turn, builder) in BUILDERS.into_iter().enumerate() {
        let order = ORDERS[turn % ORDERS.len()];
        let recipe = Recipe::default()
            .builder(builder)
            .order(order)
            .surface_rays(Some(5000));
        let built = [1, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().expect("threads").install(|| {
                let objects = [[geometry(&object)]];
                let primitives =
                    Primitives::with_instances(&[geometry(&world)], &objects, &instances)
                        .expect("indices in range");
                let bvh = Bvh::build(&primitives, &recipe).expect("a tree");
                bvh.validate().expect("a valid tree");
                bvh.to_bytes()
            })
        });
        assert!(built[0] == built[1], "{builder} {order}");
    }
}

/// Exponentially spaced triangles: each SAH split would cut off a few, and the tree would be as deep as
/// the scene is long.
#[test]
fn trees_stay_shallow() {
    let positions: Vec<_> = (0..20_000u32)
        .flat_map(|i| {
            let x = 1.01f32.powi((i % 8000) as i32 - 4000);
            [[x, 0.0, 0.0], [x, x * 0.1, 0.0], [x, 0.0, x * 0.1]]
        })
        .collect();
    let indices: Vec<_> = (0..positions.len() as u32 / 3)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    let geometries = [Geometry::triangles(positions, indices)];
    for builder in BUILDERS {
        let recipe = Recipe::default()
            .builder(builder)
            .engine(Engine::best(Width::W4));
        let bvh = Bvh::build(&geometries, &recipe).expect("indices in range");
        bvh.validate().expect("a valid tree");
        assert!(bvh.report().depth <= 94, "{:?}", bvh.report());
    }
}

/// Nothing, one primitive and one leaf of them.
#[test]
fn little_to_build_is_no_trouble() {
    let mut rng = Rng::new(22);
    for generate in mesh::ALL {
        for size in [1, 7, 8, 9] {
            let mesh = generate(&mut rng, size);
            for builder in BUILDERS {
                let recipe = Recipe::default().builder(builder);
                let bvh = Bvh::build(&[geometry(&mesh)], &recipe).expect("indices in range");
                bvh.validate()
                    .unwrap_or_else(|broken| panic!("{} {size} {builder}: {broken}", mesh.name));
                let report = bvh.report();
                let all = report.primitives + report.dropped;
                assert_eq!(all, mesh.indices.len(), "{}", mesh.name);
            }
        }
    }
}

/// Also those that have parts of a primitive in several leaves.
#[test]
fn trees_come_back_from_files() {
    let mesh = mesh::soup(&mut Rng::new(25), 300);
    for (turn, builder) in BUILDERS.into_iter().enumerate() {
        let order = ORDERS[turn % ORDERS.len()];
        let recipe = Recipe::default()
            .builder(builder)
            .order(order)
            .surface_rays(Some(5000));
        let file = Bvh::build(&[geometry(&mesh)], &recipe)
            .expect("in range")
            .to_bytes();
        let read = Bvh::from_bytes(&file).expect("a file of ours");
        assert!(read.to_bytes() == file);
        assert_eq!(read.report().primitives, 300, "{builder}");
        read.validate().expect("a sound tree");
    }
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
    let answers = |bvh: &Bvh| {
        let mut occluded = vec![false; rays.len()];
        bvh.batch(&rays).occluded_into(&mut occluded);
        occluded
    };
    let (large, small) = (build(Builder::BinnedSah), build(PBRT));
    assert_eq!(answers(&large), answers(&small));
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
