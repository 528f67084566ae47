//! Worlds: objects built once, whose instances and vertices move. Brute force over the same geometry is the oracle.

use std::sync::Arc;

use crate::instances::{Expected, Scene};
use crate::support::{Stripes, bits, config, cutouts, geometry, orders, square};
use crate::transforms::{IDENTITY, transform, translation};
use antumbra::parts::{Cost, Steps};
use antumbra::recipe::{Builder, Engine, Preset};
use antumbra::saved::{Functions, Saved};
use antumbra::shapes::UserGeometry;
use antumbra::{Bvh, Error, Geometry, Instance, Object, Primitives, Ray, Recipe, Width, World};
use antumbra_testkit::Rng;
use antumbra_testkit::mesh::{self, Mesh};
use proptest::prelude::*;

/// A recipe like any.
fn recipe(rng: &mut Rng) -> Recipe {
    let preset = Preset::ALL[rng.below(Preset::ALL.len())];
    let builder = Builder::ALL[rng.below(Builder::ALL.len())];
    let width = Width::ALL[rng.below(Width::ALL.len())];
    preset.recipe().builder(builder).engine(Engine::best(width))
}

fn build(geometries: &[Geometry<'_>], recipe: &Recipe) -> Object {
    Object::build(geometries, recipe).expect("indices in range")
}

/// Builds all objects of a scene.
fn build_objects(scene: &Scene, recipe: &Recipe) -> Vec<Arc<Object>> {
    let lists = scene.object_lists();
    let built = lists.iter().map(|list| Arc::new(build(list, recipe)));
    built.collect()
}

/// Asserts that a world answers as its scene does by brute force.
fn check(world: &World, scene: &Scene, rng: &mut Rng, place: &str) {
    let rays = scene.rays(rng, 100);
    let expected = Expected::new(&scene.primitives(), &rays, place);
    expected.check(world, &rays, place);
}

/// Reads a file of a scene, all shapes of which are the same.
fn functions_of<T: Saved>(scene: &Scene, file: &[u8]) -> T {
    let shapes = match Functions::new().from_bytes::<T>(file) {
        Ok(read) => return read,
        Err(Error::OtherFunctions { expected, .. }) => expected.len(),
        Err(error) => panic!("{error}"),
    };
    let shape: Arc<dyn UserGeometry> = Arc::new(scene.odd.clone());
    let functions = Functions::new().shapes(vec![shape; shapes]);
    functions.from_bytes(file).expect("a file of ours")
}

/// Moves, adds or removes some instances.
fn change(scene: &mut Scene, rng: &mut Rng) {
    let objects = scene.objects.len();
    match rng.below(4) {
        0 => {
            let left = rng.below(scene.instances.len() + 1);
            scene.instances.truncate(left);
        }
        1 => scene.instances.extend(
            (0..rng.below(60)).map(|_| Instance::new(rng.below(objects) as u32, transform(rng))),
        ),
        2 => scene.instances.reverse(),
        _ => {
            for instance in &mut scene.instances {
                if rng.below(3) == 0 {
                    instance.transform = transform(rng);
                }
            }
        }
    }
}

/// Moves the vertices of one object or of the ground a little or very far, all of them or some.
fn deform(scene: &mut Scene, rng: &mut Rng) -> u32 {
    let object = rng.below(scene.objects.len() + 1);
    let by = [0.01, 0.5, 20.0][rng.below(3)];
    let all = rng.below(2) == 0;
    // Spheres are the same in the ground and in objects.
    let meshes = match object < scene.objects.len() {
        true => &mut scene.objects[object..][..1],
        false => &mut scene.world[..],
    };
    for position in meshes.iter_mut().flat_map(|mesh| &mut mesh.positions) {
        if all || rng.below(4) == 0 {
            let moved = rng.point(by);
            *position = core::array::from_fn(|axis| position[axis] + moved[axis]);
        }
    }
    match object < scene.objects.len() {
        true => object as u32,
        false => World::GROUND,
    }
}

/// The geometries of an object, or of the ground.
fn geometries(scene: &Scene, object: u32) -> Vec<Geometry<'_>> {
    match object {
        World::GROUND => scene.ground(),
        _ => scene.object_lists().swap_remove(object as usize),
    }
}

proptest! {
    #![proptest_config(config(60))]

    /// Instances that move, come and go, with and without a ground.
    #[test]
    fn moving_instances_equals_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        let mut scene = Scene::new(&mut rng, 60, 24);
        let recipe = recipe(&mut rng);
        let ground = build(&scene.ground(), &recipe);
        let objects = build_objects(&scene, &recipe);
        let mut world = World::on_ground(&ground, &objects, &scene.instances).expect("objects in range");
        for step in 0..5 {
            check(&world, &scene, &mut rng, &format!("seed {seed} step {step}"));
            change(&mut scene, &mut rng);
            world.set_instances(&scene.instances).expect("objects in range");
        }
        // Room for a larger top level is no obstacle to saving, and what is loaded moves on.
        let file = Bvh::to_bytes(&world);
        let read: Bvh = functions_of(&scene, &file);
        let file = world.to_bytes();
        let mut loaded: World = functions_of(&scene, &file);
        let is_as_saved = loaded.report().file_width.is_none();
        prop_assert_eq!(loaded.to_bytes() == file, is_as_saved, "seed {}", seed);
        let rays = scene.rays(&mut rng, 30);
        for ray in &rays {
            let all: [&Bvh; 3] = [&read, &loaded, &world];
            let hits = all.map(|bvh| bits(bvh.intersect(ray)));
            prop_assert!(hits[0] == hits[2] && hits[1] == hits[2]);
            let near = all.map(|bvh| bvh.closest(ray.org, f32::INFINITY));
            prop_assert!(near[0] == near[2] && near[1] == near[2]);
        }
        for step in 0..3 {
            change(&mut scene, &mut rng);
            let object = deform(&mut scene, &mut rng);
            let moved = geometries(&scene, object);
            let list = [(object, &moved[..])];
            let moved = world.refit(&list, &scene.instances);
            prop_assert_eq!(loaded.refit(&list, &scene.instances), moved.clone());
            match moved {
                Ok(()) => {}
                // Far from the origin, corners can coincide.
                Err(Error::OtherPrimitives { .. } | Error::PrimitiveIsGone { .. }) => return Ok(()),
                Err(error) => panic!("seed {seed}: {error}"),
            }
            check(&loaded, &scene, &mut rng, &format!("seed {seed} loaded, step {step}"));
            loaded.validate().expect("promises are kept");
            for object in 0..scene.objects.len() as u32 {
                let [loaded, world] = [&loaded, &world].map(|world| world.quality(object));
                // Other nodes grow by another factor.
                prop_assert!(!is_as_saved || loaded == world, "{} and {}", loaded, world);
            }
            prop_assert_eq!(loaded.bounds(), world.bounds());
        }
        // The same objects once more, in a world without a ground.
        scene.world.clear();
        scene.spheres.clear();
        scene.odd.boxes.clear();
        let objects = build_objects(&scene, &recipe);
        let world = World::new(&objects, &scene.instances).expect("objects in range");
        check(&world, &scene, &mut rng, &format!("seed {seed} without a ground"));
    }

    /// Vertices of objects that move together with instances, in an order that was learned.
    #[test]
    fn deforming_objects_equals_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        let mut scene = Scene::new(&mut rng, 60, 24);
        let recipe = recipe(&mut rng);
        let ground = build(&scene.ground(), &recipe);
        let objects = build_objects(&scene, &recipe);
        let mut world = World::on_ground(&ground, &objects, &scene.instances).expect("objects in range");
        let mut copy = world.clone();
        for step in 0..4 {
            if rng.below(2) == 0 {
                let rays = scene.rays(&mut rng, 50);
                let order = orders()[rng.below(orders().len())];
                match rng.below(2) {
                    0 => drop(world.relearn(&rays, &recipe.order(order))),
                    // The copy stands where the world stood before.
                    _ => world.adopt(&copy.relearn(&rays, &recipe.order(order))),
                }
                world.validate().expect("promises are kept");
                check(&world, &scene, &mut rng, &format!("seed {seed} step {step} learned"));
            }
            let object = deform(&mut scene, &mut rng);
            if rng.below(2) == 0 {
                change(&mut scene, &mut rng);
            }
            copy.set_instances(world.instances()).expect("objects in range");
            match world.refit(&[(object, &geometries(&scene, object))], &scene.instances) {
                Ok(()) => {}
                // Far from the origin, corners can coincide.
                Err(Error::OtherPrimitives { .. } | Error::PrimitiveIsGone { .. }) => return Ok(()),
                Err(error) => panic!("seed {seed}: {error}"),
            }
            prop_assert!(object == World::GROUND || world.quality(object) > 0.0);
            check(&world, &scene, &mut rng, &format!("seed {seed} step {step}"));
        }
    }
}

/// Cut-outs of several objects keep their own filters in one world.
#[test]
fn objects_keep_their_filters() {
    let recipe = Recipe::default();
    let mesh = square(1.0);
    let place = |object, x| Instance::new(object, translation([x, 0.0, 0.0]));
    let lists: Vec<_> = [2.0, 5.0, 9.0]
        .map(|count| vec![cutouts(&mesh, Arc::new(Stripes { count }))])
        .into();
    let objects: Vec<_> = lists.iter().map(|list| build(list, &recipe)).collect();
    let instances: Vec<_> = (0..12)
        .map(|index| place(index % 3, 2.5 * index as f32))
        .collect();
    let world = World::new(&objects, &instances).expect("objects in range");
    let primitives = Primitives::with_instances(&[], &lists, &instances).expect("indices in range");
    let mut rng = Rng::new(2020);
    let rays: Vec<_> = (0..4000)
        .map(|_| {
            let [x, y, _] = rng.point(1.0);
            Ray::new([15.0 * x + 14.0, y, 0.0], [0.0, 0.0, 1.0])
        })
        .collect();
    let expected = Expected::new(&primitives, &rays, "stripess");
    expected.check(&world, &rays, "stripess");
    let fixed = Bvh::learn(&primitives, &rays, &recipe).expect("in range");
    expected.check(&fixed, &rays, "fixed stripes");
    assert_eq!(world.report().cutouts, 6);
}

/// What cannot be done is an error, and the world stays as it was.
#[test]
fn errors_leave_the_world_alone() {
    let (mesh, other) = (square(1.0), square(2.0));
    let list = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    let moved = [Geometry::triangles(
        &other.positions[..],
        &other.indices[..1],
    )];
    let recipe = Recipe::default().engine(Engine::best(Width::W8));
    let object = build(&list, &recipe);
    let here = Instance::new(0, IDENTITY);
    let mut world =
        World::new(&[&object], core::slice::from_ref(&here)).expect("the object is there");
    let nowhere = Instance::new(1, here.transform);
    assert_eq!(
        world.set_instances(&[here.clone(), nowhere]),
        Err(Error::ObjectOutOfRange {
            inst_id: 1,
            object: 1,
            objects: 1
        })
    );
    let few = Error::OtherPrimitives {
        expected: 2,
        found: 1,
    };
    assert_eq!(world.refit(&[(0, &moved)], &[]), Err(few));
    let narrow = build(&list, &recipe.engine(Engine::best(Width::W4)));
    assert_eq!(
        world.add_object(&narrow),
        Err(Error::OtherWidth {
            expected: 8,
            found: 4
        })
    );
    assert_eq!(world.instances(), std::slice::from_ref(&here));
    let ray = Ray::new([0.1, 0.2, 0.0], [0.0, 0.0, 1.0]);
    let hit = world.intersect(&ray).expect("still there");
    assert_eq!((hit.t, hit.inst_id), (1.0, 0));
    // What has no inverse is dropped and counted.
    let flat = Instance::new(here.object, [[0.0; 4]; 3]);
    world.set_instances(&[flat, here]).expect("dropped");
    assert_eq!(world.report().dropped, 1);
    world.validate().expect("promises are kept");
    let hit = world.intersect(&ray).expect("still there");
    assert_eq!(hit.inst_id, 1);
    world.set_instances(&[]).expect("nothing is fine");
    assert!(!world.occluded(&ray));
    assert_eq!(
        world.refit(&[(World::GROUND, &list)], &[]),
        Err(Error::OtherPrimitives {
            expected: 0,
            found: 2
        }),
        "there is no ground"
    );
}

/// A large ground is refitted by several threads, in all of the subtrees that it was taken apart into.
#[test]
fn a_large_ground_moves() {
    let mut rng = Rng::new(32);
    let mut mesh = mesh::bumpy_grid(&mut rng, 20_000);
    let ground = |mesh: &Mesh| Geometry::triangles(mesh.positions.clone(), mesh.indices.clone());
    let recipe = Recipe::fast();
    let sheet = square(0.1);
    let object = build(&[geometry(&sheet)], &recipe);
    let instances = [Instance::new(0, IDENTITY)];
    let mut world = World::on_ground(build(&[ground(&mesh)], &recipe), &[&object], &instances)
        .expect("objects in range");
    for position in &mut mesh.positions {
        position[2] = 0.5 - 2.0 * position[2];
    }
    let moved = [ground(&mesh)];
    world
        .refit(&[(World::GROUND, &moved)], &instances)
        .expect("all are there");
    let objects = [[geometry(&sheet)]];
    let primitives = Primitives::with_instances(&moved, &objects, &instances).expect("in range");
    let rays: Vec<_> = (0..500)
        .map(|_| Ray::between(rng.point(2.0), rng.point(2.0)))
        .collect();
    world.validate().expect("promises are kept");
    Expected::new(&primitives, &rays, "ground").check(&world, &rays, "ground");
}

/// What was learned of the top level is kept when instances move, also by a copy that has not learned itself.
#[test]
fn worlds_keep_what_they_learned() {
    let mut rng = Rng::new(33);
    let recipe = Recipe::default().engine(Engine::best(Width::W8));
    let object = build(&[geometry(&mesh::soup(&mut rng, 200))], &recipe);
    // Many small ones, which nearly all rays miss, and large ones, which occlude them.
    let mut instances = Vec::new();
    for index in 0..400 {
        let size = if index % 8 == 0 { 0.8 } else { 0.05 };
        let mut place = translation(rng.point(6.0));
        (0..3).for_each(|axis| place[axis][axis] = size);
        instances.push(Instance::new(0, place));
    }
    let mut rays = |count: usize| -> Vec<Ray> {
        let ray = |_| Ray::between(rng.point(6.0), rng.point(6.0));
        (0..count).map(ray).collect()
    };
    let (sample, test) = (rays(4000), rays(4000));
    let mut plain = World::new(&[&object], &instances).expect("objects in range");
    let mut adopted = plain.clone();
    let mut learned = plain.clone();
    adopted.adopt(&learned.relearn(&sample, &recipe));
    for instance in &mut instances {
        for row in &mut instance.transform {
            row[3] += 0.05;
        }
    }
    let tests = [&mut plain, &mut learned, &mut adopted].map(|world| {
        world.set_instances(&instances).expect("objects in range");
        world.validate().expect("promises are kept");
        let mut occluded = vec![false; test.len()];
        let mut costs = vec![Cost::default(); test.len()];
        world.occluded_batch_counted(&test, &mut occluded, &mut costs);
        let nodes: u64 = costs.iter().map(|cost| u64::from(cost.node_tests)).sum();
        (nodes, occluded)
    });
    let nodes = [0, 1, 2].map(|world| tests[world].0 as f64);
    assert!(tests[0].1 == tests[1].1 && tests[0].1 == tests[2].1);
    assert!(nodes[1] < 0.97 * nodes[0], "{nodes:?}");
    assert!(nodes[2] < 0.97 * nodes[0], "{nodes:?}");
}
