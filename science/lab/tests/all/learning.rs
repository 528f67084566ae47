//! Effect of learning from one kind of rays on another kind: counted, not timed, on the rays of cameras.

use std::io::Write;
use std::path::Path;

use antumbra::parts::{Cost, Steps};
use antumbra::recipe::{Collapse, CostModel, Engine};
use antumbra::{Build, Bvh, Ray, Recipe, Width};
use antumbra_lab::collect_rays;
use antumbra_render::World;
use antumbra_scene::{Geometry, Scene, builtin};

/// Number of training rays of a kind, the fewest that a rendering takes, and of held-out rays. Half of them are too
/// few for sibenik, see docs/notes/renderer.md.
const RAYS: usize = 4096;
const SEED: u64 = 2016;
/// No kind of rays may become slower than this.
const LEAST_SPEED: f64 = 0.95;

fn kernel_geometry(geometry: &Geometry) -> antumbra::Geometry<'_> {
    match geometry {
        Geometry::Mesh(mesh) => {
            antumbra::Geometry::triangles(&mesh.positions[..], &mesh.indices[..])
        }
        Geometry::Sphere(sphere) => antumbra::Geometry::spheres(vec![antumbra::shapes::Sphere {
            center: sphere.center.to_array(),
            radius: sphere.radius,
        }]),
        Geometry::Curves(_) => panic!("no curves here"),
    }
}

/// Mean cost of occlusion queries, in nodes, which learning makes small. Leaf splitting trades primitives for nodes.
fn cost(bvh: &Bvh, rays: &[Ray]) -> f64 {
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut vec![false; rays.len()], &mut costs);
    let model = CostModel::default();
    let cost = |cost: &Cost| {
        f64::from(model.node) * f64::from(cost.node_tests)
            + f64::from(model.prim) * f64::from(cost.prim_tests)
    };
    costs.iter().map(cost).sum::<f64>() / rays.len() as f64
}

/// Learns nodes and child order from shadow rays, as the library does, and counts the tests of ambient occlusion rays.
/// Then the other way round. Training rays themselves may become slower, too, see docs/notes/renderer.md.
fn check(scene: &Scene) {
    let scene = scene.flattened().expect("few triangles");
    let world = World::new(&scene).expect("a valid scene");
    let geometries: Vec<_> = (scene.shapes.iter())
        .map(|shape| kernel_geometry(&shape.geometry))
        .collect();
    let recipe = Recipe::default();
    let stage = Build::new(&geometries).stage().expect("indices in range");
    let by_area = recipe.collapse(Collapse::Area);
    let unlearned = |width| {
        let bvh = stage.collapse(&[], &by_area.engine(Engine::best(width)), &());
        bvh.expect("nobody stops it")
    };
    let rays = collect_rays(&world, &unlearned(Width::W8), 2 * RAYS, SEED);
    for width in [Width::W8, Width::W16] {
        let unlearned = unlearned(width);
        for (learned_from, own, other) in [
            ("shadow rays", &rays.shadow, &rays.diffuse),
            ("ambient occlusion", &rays.diffuse, &rays.shadow),
        ] {
            let (training, own) = own.split_at(own.len() / 2);
            let learned = stage.learn(training, &recipe.engine(Engine::best(width)), &());
            let learned = learned.expect("nobody stops it");
            let place = format!("{} x{width}, learned from {learned_from}", scene.name);
            for (whose, rays) in [("its own", own), ("the other", &other[..])] {
                let [before, after] = [&unlearned, &learned].map(|bvh| cost(bvh, rays));
                assert!(
                    after <= before / LEAST_SPEED,
                    "{place}: rays of {whose} kind cost {before}, now {after}"
                );
            }
        }
    }
}

/// Checks a shared scene, if there is one, with the first few of its instances.
fn check_shared(name: &str, instances: usize) {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    let path = scenes.join(name).join(format!("{name}.pbrt"));
    if !path.exists() {
        // Not `println!`, which a passing test keeps to itself.
        let _ = std::io::stderr().write_all(b"skipped: no shared scenes\n");
        return;
    }
    let mut scene = antumbra_load::load(&path, &Default::default())
        .expect("the shared scenes are valid")
        .scene;
    scene.instances.truncate(instances);
    check(&scene);
}

#[test]
fn city() {
    check(&builtin::by_name("city:20000").expect("a built-in scene"));
}

#[test]
fn sponza() {
    check_shared("sponza", 0);
}

#[test]
fn sibenik() {
    check_shared("sibenik", 0);
}

#[test]
fn microcity() {
    check_shared("microcity", 0);
}

/// Scans in a room: small triangles in heaps, and large ones around them.
#[test]
fn scans() {
    check_shared("scans", 6);
}
