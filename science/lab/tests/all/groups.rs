//! Training rays and held-out rays, and trees of every combination.

use crate::support::*;
use antumbra::recipe::{Engine, Order};
use antumbra::{Ray, Recipe, Width};
use antumbra_lab::{Lot, RaysFrom, SampledRays, TrainedTree};
use antumbra_render::{Options, render};
use antumbra_testkit::sample::{pairs, triples};
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS};
use glam::Vec3;

const SPP: u32 = 3;

fn bits(rays: &[Ray]) -> Vec<[u32; 8]> {
    let bits = |ray: &Ray| {
        let ([ox, oy, oz], [dx, dy, dz]) = (ray.org, ray.dir);
        [ox, oy, oz, dx, dy, dz, ray.tnear, ray.tfar].map(f32::to_bits)
    };
    rays.iter().map(bits).collect()
}

fn sorted(rays: &[Ray]) -> Vec<[u32; 8]> {
    let mut bits = bits(rays);
    bits.sort_unstable();
    bits
}

/// All samples together have the rays of a rendering: equal numbers of rays and of occluded rays.
#[test]
fn all_lots_together_are_the_rays_of_the_rendering() {
    let scene = cube_over_floor();
    let (world, bvh) = world(&scene);
    let options = Options {
        spp: Some(SPP),
        seed: 7,
        recipe: Recipe::default().order(Order::Simple),
        ..Options::default()
    };
    let stats = render(&world, &options, &()).expect("a picture").stats;
    let mut samples = SampledRays::new(&world, &bvh, SPP, 7);
    assert_eq!(samples.total(), 50 * 34 * u64::from(SPP));
    let lots = [1000, usize::MAX, 10].map(|count| samples.take(count, 0));
    let taken: u64 = lots.iter().map(|lot| lot.samples).sum();
    assert_eq!(taken, samples.total());
    assert_eq!(lots[0].shadow.len(), 1000);
    assert_eq!(lots[2], Lot::default());
    let found: u64 = lots.iter().map(|lot| lot.shadow_rays).sum();
    assert_eq!(found, stats.shadow_rays);
    let occluded = |rays: &[Ray]| {
        let mut answers = vec![false; rays.len()];
        bvh.batch(rays).occluded_into(&mut answers);
        answers.iter().filter(|answer| **answer).count() as u64
    };
    let all = SampledRays::new(&world, &bvh, SPP, 7).take(usize::MAX, 0);
    assert_eq!(occluded(&all.shadow), stats.occluded_rays);
}

#[test]
fn lots_share_no_sample_and_do_not_depend_on_threads() {
    let scene = cube_over_floor();
    let (world, bvh) = world(&scene);
    let lots = || {
        let mut samples = SampledRays::new(&world, &bvh, SPP, 1);
        [(); 2].map(|()| samples.take(700, 500))
    };
    let reference = lots();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().expect("threads");
        assert_eq!(pool.install(lots), reference);
    }
    let [first, second] = &reference;
    assert_eq!((first.shadow.len(), first.ambient.len()), (700, 500));
    for (a, b) in [
        (&first.shadow, &second.shadow),
        (&first.ambient, &second.ambient),
    ] {
        let a = sorted(a);
        let shared = bits(b)
            .iter()
            .filter(|ray| a.binary_search(ray).is_ok())
            .count();
        assert_eq!(shared, 0);
    }
    // A smaller lot is the beginning of a larger one.
    let few = SampledRays::new(&world, &bvh, SPP, 1).take(90, 40);
    assert_eq!(few.shadow, first.shadow[..90]);
    assert_eq!(few.ambient, first.ambient[..40]);
    // In the order of the picture they are the same rays, with neighbours beside each other.
    let ordered = SampledRays::new(&world, &bvh, SPP, 1).take_in_picture_order(700, 500);
    assert_eq!(sorted(&ordered.shadow), sorted(&first.shadow));
    assert_eq!(sorted(&ordered.ambient), sorted(&first.ambient));
    let jumps = |rays: &[Ray]| -> f32 {
        let pairs = rays.windows(2);
        pairs
            .map(|pair| (Vec3::from(pair[0].org) - Vec3::from(pair[1].org)).length())
            .sum()
    };
    assert!(jumps(&ordered.ambient) < 0.7 * jumps(&first.ambient));
}

#[test]
fn another_camera_sees_other_points() {
    let scene = cube_over_floor();
    let (world, bvh) = world(&scene);
    let samples = || SampledRays::new(&world, &bvh, SPP, 1);
    let own = samples().take(300, 300);
    let same = samples().with_camera(&scene.camera).expect("a camera");
    assert_eq!({ same }.take(300, 300), own);
    let camera = look(Vec3::new(0.0, 0.0, 8.0), Vec3::ZERO, 60.0);
    let mut other = samples().with_camera(&camera).expect("a camera");
    let other = other.take(300, 300);
    assert_ne!(other.ambient, own.ambient);
    let broken = antumbra_scene::Camera {
        fov: 0.0,
        ..scene.camera.clone()
    };
    assert!(samples().with_camera(&broken).is_err());
}

#[test]
fn every_combination_answers_alike_and_predicts_a_cost() {
    let scene = cube_over_floor();
    let (world, bvh) = world(&scene);
    let mut samples = SampledRays::new(&world, &bvh, SPP, 1);
    let log = samples.take(500, 0);
    let test = samples.take(2000, 0).shadow;
    let mut expected = vec![false; test.len()];
    bvh.batch(&test).occluded_into(&mut expected);
    let recipe = Recipe::default().seed(5);
    let kinds = pairs(0, &BUILDERS, &RaysFrom::ALL);
    for ((builder, from), collapse, order) in triples(0, &kinds, &COLLAPSES, &ORDERS) {
        let trained = TrainedTree::new(&world, &recipe.builder(builder), &log.shadow, from);
        assert_eq!(trained.builder(), builder);
        let mut collapsed =
            trained.collapse(&recipe.collapse(collapse).engine(Engine::best(Width::W8)));
        assert!(collapsed.learned_from() > 0);
        let ordered = collapsed.order(order).expect("an order");
        ordered.bvh.validate().expect("a sound tree");
        let mut answers = vec![false; test.len()];
        ordered.bvh.batch(&test).occluded_into(&mut answers);
        assert!(answers == expected, "{builder} {collapse} {order}");
        if let Some([before, after]) = ordered.predicted {
            assert!(before >= 1.0 && after >= 1.0 && after.is_finite());
            // The paper's order is the best one for the log that predicts.
            assert!(order != Order::SortPlus || after <= before + 1e-9);
        }
    }
    // Without rays nothing is learned, and nothing fails.
    let trained = TrainedTree::new(&world, &recipe, &[], RaysFrom::Camera);
    let mut collapsed = trained.collapse(&recipe.engine(Engine::best(Width::W4)));
    for order in ORDERS {
        assert!(
            collapsed
                .order(order)
                .expect("an order")
                .predicted
                .is_none()
        );
    }
}
