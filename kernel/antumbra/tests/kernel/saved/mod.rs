//! Trees, objects and worlds in files: the same answers at the same cost, and no harm from files that are damaged or forged.
//!
//! - [`damage`]: files that are damaged or forged

mod damage;

use std::io::{self, Read, Write};
use std::sync::Arc;

use antumbra::cutout::Opacity;
use antumbra::parts::{Cost, Steps};
use antumbra::recipe::{Builder, Engine, Order};
use antumbra::saved::{Functions, GeometryId, Saved};
use antumbra::shapes::{Curves, Sphere, UserGeometry, UserHit};
use antumbra::{
    Aabb, Brute, Bvh, Error, Geometry, Instance, Isa, Object, Primitives, Ray, Recipe, Width, World,
};
use antumbra_testkit::{Mesh, Rng, mesh, rays};

use crate::support::{Odd, Stripes, bits, cutouts, engines_for, geometry, kernel_rays, quads};
use crate::transforms::transform;
use damage::{FRAME, framed, opened};

/// Version of the format.
const VERSION: u32 = 4;

/// Primitives of every kind in the world and in objects, instances, and rays of all kinds.
struct Scene {
    soup: Mesh,
    ball: Mesh,
    spheres: Vec<Sphere>,
    hairs: Vec<[f32; 4]>,
    filters: [Arc<dyn Opacity>; 3],
    shapes: [Odd; 3],
    instances: Vec<Instance>,
    rays: Vec<Ray>,
}

impl Scene {
    fn new(seed: u64, size: usize) -> Self {
        let mut rng = Rng::new(seed);
        let soup = mesh::soup(&mut rng, size);
        let spheres = (0..size / 20).map(|_| Sphere {
            center: rng.point(1.0),
            radius: 0.1 * rng.unit(),
        });
        let spheres = spheres.collect();
        let hairs = (0..size / 20).map(|_| {
            let [x, y, z] = rng.point(1.0);
            [x, y, z, 0.1 * rng.unit()]
        });
        let hairs = hairs.collect();
        let instances =
            (0..size / 20).map(|index| Instance::new(index as u32 % 2, transform(&mut rng)));
        let instances = instances.collect();
        Self {
            ball: mesh::icosphere(1),
            spheres,
            hairs,
            filters: [3.0, 5.0, 8.0].map(|count| Arc::new(Stripes { count }) as Arc<dyn Opacity>),
            shapes: [size / 8, size / 10, size / 9].map(|count| Odd::new(&mut rng, count)),
            instances,
            rays: kernel_rays(&rays::around(&mut rng, &soup, 300)),
            soup,
        }
    }

    fn ground(&self) -> Vec<Geometry<'_>> {
        vec![
            geometry(&self.soup),
            Geometry::spheres(&self.spheres[..]),
            cutouts(&self.ball, self.filters[0].clone()),
            quads(&self.soup),
            self.shapes[0].geometry(),
            Geometry::curves(Curves::chain(&self.hairs[..])),
        ]
    }

    fn objects(&self) -> [Vec<Geometry<'_>>; 2] {
        [
            vec![
                self.shapes[1].geometry(),
                geometry(&self.ball),
                cutouts(&self.soup, self.filters[1].clone()),
                quads(&self.ball),
            ],
            vec![
                geometry(&self.soup),
                cutouts(&self.ball, self.filters[2].clone()),
                Geometry::spheres(&self.spheres[..]),
                self.shapes[2].geometry(),
                Geometry::curves(Curves::chain(&self.hairs[..])),
            ],
        ]
    }

    fn primitives(&self) -> Primitives {
        let (ground, objects) = (self.ground(), self.objects());
        Primitives::with_instances(&ground, &objects, &self.instances).expect("in range")
    }

    /// A world of trees by this recipe.
    fn world(&self, recipe: &Recipe) -> World {
        let build = |list: &[Geometry<'_>]| Object::build(list, recipe).expect("in range");
        let objects = self.objects().map(|list| build(&list));
        World::on_ground(build(&self.ground()), &objects, &self.instances).expect("in range")
    }

    /// Reads a file of the scene: it says which functions it wants.
    fn read<T: Saved>(&self, file: &[u8]) -> T {
        self.functions::<T>(file)
            .from_bytes(file)
            .expect("a file of ours")
    }

    fn functions<T: Saved>(&self, file: &[u8]) -> Functions {
        let id = |object, geom_id| GeometryId { object, geom_id };
        let filters = [id(None, 2), id(Some(0), 2), id(Some(1), 1)];
        let shapes = [id(None, 4), id(Some(0), 0), id(Some(1), 3)];
        let place = |all: &[GeometryId], one: &GeometryId| {
            all.iter()
                .position(|name| name == one)
                .expect("it has functions")
        };
        let mut functions = Functions::new();
        while let Err(error) = functions.from_bytes::<T>(file) {
            let Error::OtherFunctions {
                what,
                expected,
                found: 0,
            } = error
            else {
                panic!("{error}");
            };
            assert!(expected.is_sorted_by(|a, b| a < b));
            functions = match what {
                "filters" => {
                    let filter = |name: &GeometryId| self.filters[place(&filters, name)].clone();
                    functions.filters(expected.iter().map(filter).collect())
                }
                _ => {
                    let shape = |name: &GeometryId| {
                        let shape = self.shapes[place(&shapes, name)].clone();
                        Arc::new(Wary(shape)) as Arc<dyn UserGeometry>
                    };
                    functions.shapes(expected.iter().map(shape).collect())
                }
            };
        }
        functions
    }
}

/// User geometry that knows every primitive a file may name.
#[derive(Debug)]
struct Wary(Odd);

impl Wary {
    fn known(&self, prim_id: u32) -> u32 {
        prim_id % self.0.boxes.len() as u32
    }
}

impl UserGeometry for Wary {
    fn bounds(&self, prim_id: u32) -> Aabb {
        self.0.bounds(self.known(prim_id))
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        self.0.intersect(self.known(prim_id), ray)
    }

    fn closest_point(
        &self,
        prim_id: u32,
        point: [f64; 3],
        world_from_object: &[[f64; 4]; 3],
    ) -> Option<[f64; 3]> {
        (self.0).closest_point(self.known(prim_id), point, world_from_object)
    }
}

/// Triangles, spheres, quads and instances; rays of all kinds. No functions.
fn scene(seed: u64, size: usize) -> (Primitives, Vec<Ray>) {
    let mut rng = Rng::new(seed);
    let soup = mesh::soup(&mut rng, size);
    let ball = mesh::icosphere(1);
    let spheres: Vec<_> = (0..size / 20)
        .map(|_| Sphere {
            center: rng.point(1.0),
            radius: 0.1 * rng.unit(),
        })
        .collect();
    let instances: Vec<_> = (0..size / 20)
        .map(|index| Instance::new(index as u32 % 2, transform(&mut rng)))
        .collect();
    let world = [
        geometry(&soup),
        Geometry::spheres(&spheres[..]),
        quads(&soup),
    ];
    let objects = [
        vec![geometry(&ball), quads(&ball)],
        vec![geometry(&soup), Geometry::spheres(&spheres[..])],
    ];
    let primitives = Primitives::with_instances(&world, &objects, &instances).expect("in range");
    let rays = kernel_rays(&rays::around(&mut rng, &soup, 300));
    (primitives, rays)
}

fn saved(bvh: &Bvh) -> Vec<u8> {
    let mut bytes = Vec::new();
    bvh.write(&mut bytes).expect("a vector takes anything");
    assert!(bvh.to_bytes() == bytes);
    bytes
}

fn counts(bvh: &Bvh, rays: &[Ray]) -> Vec<Cost> {
    let mut occluded = vec![false; rays.len()];
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut occluded, &mut costs);
    costs
}

/// Widths that trees keep when they are read here.
fn kept_widths() -> Vec<Width> {
    let best = Isa::best();
    let is_kept = |width: &Width| Engine::new(best, *width).is_ok();
    Width::ALL.into_iter().filter(is_kept).collect()
}

/// Trees of widths that are none of this CPU's come back in another, with the same answers in the same order of leaves.
#[test]
fn trees_of_other_widths_are_collapsed_again() {
    let same = |read: &Bvh, built: &Bvh, rays: &[Ray], place: &str| {
        read.validate().expect("a sound tree");
        let best = Engine::default();
        assert_eq!((read.width(), read.isa()), (best.width(), best.isa()));
        let [now, before] = [read, built].map(Bvh::report);
        assert_eq!(now.file_width, Some(built.width()));
        assert_eq!(
            (now.primitives, now.leaves, now.training_rays),
            (before.primitives, before.leaves, before.training_rays)
        );
        // The first occluder is the same.
        assert_eq!(
            read.batch(rays).occluders(),
            built.batch(rays).occluders(),
            "{place}"
        );
        for ray in rays {
            assert_eq!(
                bits(read.intersect(ray)),
                bits(built.intersect(ray)),
                "{place}"
            );
        }
    };
    for (width, (size, seed)) in (Width::ALL.into_iter())
        .filter(|width| !kept_widths().contains(width))
        .flat_map(|width| [(0, 1), (1, 2), (40, 3), (400, 4)].map(|scene| (width, scene)))
    {
        let scene = Scene::new(seed, size);
        let (rays, place) = (&scene.rays[..], format!("{size} x{width}"));
        let recipe = Recipe::default().engine(Engine::best(width));
        let built = Bvh::learn(&scene.primitives(), rays, &recipe).expect("a tree");
        let mut read: Bvh = scene.read(&saved(&built));
        same(&read, &built, rays, &place);
        let again: Bvh = scene.read(&saved(&read));
        assert_eq!(saved(&again), saved(&read));
        if size == 0 {
            continue;
        }
        let mesh = [geometry(&scene.soup)];
        read = Bvh::build(&mesh, &recipe).expect("in range");
        read.refit(&mesh).expect("as before");
        let refitted = Bvh::from_bytes(&saved(&read)).expect("a file of ours");
        assert!((refitted.report().quality / read.report().quality - 1.0).abs() < 1e-6);
        let lists = scene.objects();
        let mut world = scene.world(&recipe);
        let mut loaded: World = scene.read(&world.to_bytes());
        let check = |loaded: &World, instances: &[Instance]| {
            loaded.validate().expect("a sound tree");
            let all = Primitives::with_instances(&scene.ground(), &scene.objects(), instances);
            let brute = Brute::new(&all.expect("in range"));
            for ray in rays {
                let hit = loaded.intersect(ray);
                assert_eq!(bits(hit), bits(brute.intersect(ray)), "{place}");
                assert_eq!(loaded.occluded(ray), brute.occluded(ray), "{place}");
            }
        };
        check(&loaded, &scene.instances);
        let mut rng = Rng::new(19);
        let mut many = scene.instances.clone();
        many.extend((0..150).map(|index| Instance::new(index % 2, transform(&mut rng))));
        loaded.set_instances(&many).expect("objects are there");
        check(&loaded, &many);
        for world in [&mut loaded, &mut world] {
            let moved = world.refit(&[(World::GROUND, &scene.ground()), (1, &lists[1])], &many);
            moved.expect("as before");
        }
        check(&loaded, &many);
        assert!((loaded.quality(1) / world.quality(1) - 1.0).abs() < 1e-6);
        let again: World = scene.read(&loaded.to_bytes());
        assert_eq!(again.to_bytes(), loaded.to_bytes());
    }
}

#[test]
fn saved_trees_answer_as_built_ones_at_the_same_cost() {
    for (size, seed) in [(0, 1), (1, 2), (40, 3), (400, 4)] {
        let scene = Scene::new(seed, size);
        let (primitives, rays) = (scene.primitives(), &scene.rays[..]);
        let brute = Brute::new(&primitives);
        for width in kept_widths() {
            for order in [Order::Joint, Order::Simple] {
                let recipe = Recipe::default().engine(Engine::best(width)).order(order);
                let built = Bvh::learn(&primitives, rays, &recipe).expect("a tree");
                let bytes = saved(&built);
                let mut read: Bvh = scene.read(&bytes);
                read.validate().expect("a sound tree");
                assert_eq!(saved(&read), bytes, "{size} x{width} {order}");
                assert_eq!(counts(&read, rays), counts(&built, rays));
                let (mut report, expected) = (read.report(), built.report());
                report.times = expected.times;
                // No level is deeper than the tree says, but the tree may say more.
                assert!(report.depth <= expected.depth);
                report.depth = expected.depth;
                assert_eq!(report, expected);
                for engine in engines_for(read.width()) {
                    engine.run(&mut read).expect("its width");
                    let mut occluded = vec![false; rays.len()];
                    read.batch(rays).occluded_into(&mut occluded);
                    for (ray, occluded) in rays.iter().zip(occluded) {
                        assert_eq!(occluded, brute.occluded(ray));
                        assert_eq!(read.occluded(ray), occluded);
                        assert_eq!(bits(read.intersect(ray)), bits(brute.intersect(ray)));
                    }
                }
            }
        }
    }
}

/// A loaded world answers as the original, and as brute force, and goes on doing so when it moves.
#[test]
fn loaded_worlds_move_like_the_original() {
    for (width, size) in kept_widths()
        .into_iter()
        .flat_map(|width| [(width, 20), (width, 400)])
    {
        let scene = Scene::new(18, size);
        let recipe = Recipe::default().engine(Engine::best(width));
        let mut world = scene.world(&recipe);
        world.relearn(&scene.rays, &recipe);
        let file = world.to_bytes();
        let mut written = Vec::new();
        world.write(&mut written).expect("a vector takes anything");
        assert!(written == file);
        let mut loaded: World = scene.read(&file);
        assert!(loaded.to_bytes() == file);
        assert_eq!(counts(&loaded, &scene.rays), counts(&world, &scene.rays));
        assert_eq!(loaded.instances(), world.instances());
        let check = |loaded: &World, world: &World, instances: &[Instance]| {
            loaded.validate().expect("a sound tree");
            let all = Primitives::with_instances(&scene.ground(), &scene.objects(), instances);
            let brute = Brute::new(&all.expect("in range"));
            let mut hits = vec![None; scene.rays.len()];
            loaded.batch(&scene.rays).intersect_into(&mut hits);
            for (ray, hit) in scene.rays.iter().zip(hits) {
                assert_eq!(bits(hit), bits(brute.intersect(ray)), "x{width}");
                assert_eq!(bits(hit), bits(world.intersect(ray)), "x{width}");
                assert_eq!(loaded.occluded(ray), brute.occluded(ray), "x{width}");
            }
            let [a, b] = [loaded, world].map(|world| world.report());
            assert_eq!(
                (a.primitives, a.cutouts, a.dropped),
                (b.primitives, b.cutouts, b.dropped)
            );
        };
        check(&loaded, &world, &scene.instances);
        let mut rng = Rng::new(19);
        // Many more, so that the top level needs more room, and some that cannot be placed.
        let mut instances = scene.instances.clone();
        instances.extend((0..150).map(|index| Instance::new(index % 2, transform(&mut rng))));
        instances.push(Instance::new(0, [[0.0; 4]; 3]));
        for instances in [
            &instances[..],
            &instances[..3.min(instances.len())],
            &scene.instances,
        ] {
            for world in [&mut loaded, &mut world] {
                world.set_instances(instances).expect("objects are there");
            }
            check(&loaded, &world, instances);
            // In any state.
            let again: World = scene.read(&loaded.to_bytes());
            check(&again, &world, instances);
        }
        let lists = scene.objects();
        for world in [&mut loaded, &mut world] {
            world
                .refit(&[(1, &lists[1])], &scene.instances)
                .expect("as before");
        }
        check(&loaded, &world, &scene.instances);
        assert_eq!(loaded.quality(1), world.quality(1));
        let object = Object::build(&lists[0], &recipe).expect("in range");
        assert_eq!(loaded.add_object(&object), Ok(2));
    }
}

/// A loaded object is placed as the original, bit for bit, and moves.
#[test]
fn loaded_objects_are_placed_as_the_original() {
    let scene = Scene::new(20, 300);
    let [_, list] = scene.objects();
    let functions = Functions::new()
        .filters(vec![scene.filters[2].clone()])
        .shapes(vec![Arc::new(scene.shapes[2].clone())]);
    for width in kept_widths() {
        let recipe = Recipe::default().engine(Engine::best(width));
        let mut built = Object::build(&list, &recipe).expect("in range");
        let mut file = Vec::new();
        built.write(&mut file).expect("a vector takes anything");
        let mut loaded: Object = functions.read(&file[..]).expect("a file of ours");
        assert!(loaded.to_bytes() == file);
        let instances: Vec<_> = (scene.instances.iter())
            .map(|instance| Instance::new(0, instance.transform))
            .collect();
        let place = |object: &Object| World::new(&[object], &instances).expect("in range");
        let same = |a: &World, b: &World| {
            assert!(a.to_bytes() == b.to_bytes());
            for ray in &scene.rays {
                assert_eq!(bits(a.intersect(ray)), bits(b.intersect(ray)));
            }
        };
        same(&place(&loaded), &place(&built));
        for object in [&mut loaded, &mut built] {
            object.refit(&list).expect("as before");
        }
        same(&place(&loaded), &place(&built));
        assert_eq!(loaded.report().quality, built.report().quality);
    }
}

/// Trees of every builder come back.
#[test]
fn trees_of_every_builder_come_back() {
    let mesh = mesh::soup(&mut Rng::new(25), 300);
    for builder in Builder::ALL {
        let recipe = Recipe::default().builder(builder);
        let built = Bvh::build(&[geometry(&mesh)], &recipe).expect("in range");
        let file = saved(&built);
        let read = Bvh::from_bytes(&file).expect("a file of ours");
        assert!(saved(&read) == file);
        assert_eq!(read.report().primitives, 300, "{builder}");
        read.validate().expect("a sound tree");
    }
}

/// Functions that are missing or too many are named.
#[test]
fn other_functions_are_named() {
    let scene = Scene::new(21, 60);
    let file = scene.world(&Recipe::fast()).to_bytes();
    let text = |functions: &Functions| {
        let error = functions.from_bytes::<World>(&file).expect_err("not these");
        error.to_string()
    };
    let [a, b, c] = scene.filters.clone();
    assert_eq!(
        text(&Functions::new().filters(vec![a.clone(), b.clone()])),
        "the file needs 3 filters, and 2 were given: for geometry 2, geometry 2 of object 0, geometry 1 of object 1"
    );
    let functions = Functions::new().filters(vec![a.clone(), b, c]);
    let shapes = scene
        .shapes
        .clone()
        .map(|shape| Arc::new(shape) as Arc<dyn UserGeometry>);
    let many = [&shapes[..], &shapes[..1]].concat();
    assert_eq!(
        text(&functions.shapes(many)),
        "the file needs 3 shapes of user geometry, and 4 were given: \
         for geometry 4, geometry 0 of object 0, geometry 3 of object 1"
    );
    let plain = Bvh::build(&[geometry(&scene.soup)], &Recipe::fast()).expect("in range");
    let error = Functions::new()
        .filters(vec![a])
        .from_bytes::<Bvh>(&plain.to_bytes());
    let text = error.expect_err("a surplus filter").to_string();
    assert_eq!(text, "the file needs 0 filters, and 1 were given");
}

/// Files of many frames, which hold nothing together, from readers that give a few bytes at a time.
#[test]
fn long_files_come_in_pieces() {
    struct Few<'a>(&'a [u8], Rng);
    impl Read for Few<'_> {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            let few = bytes.len().min(1 + self.1.below(5000));
            self.0.read(&mut bytes[..few])
        }
    }
    let (primitives, _) = scene(22, 20_000);
    for width in kept_widths() {
        let recipe = Recipe::fast()
            .surface_rays(Some(0))
            .engine(Engine::best(width));
        let bvh = Bvh::build(&primitives, &recipe).expect("a tree");
        let file = saved(&bvh);
        assert!(file.len() > 20 * 4 * FRAME, "{}", file.len());
        let read = Bvh::read(Few(&file, Rng::new(23))).expect("a file of ours");
        assert!(saved(&read) == file);
        read.validate().expect("a sound tree");
        // Frames may end anywhere.
        let (magic, contents) = opened(&file);
        let frames: Vec<_> = contents.chunks(4 * 1009).collect();
        let other = Bvh::from_bytes(&framed(&magic, &frames, VERSION)).expect("the same");
        assert!(saved(&other) == file);
        for end in (0..file.len()).step_by(9973) {
            assert!(Bvh::read(Few(&file[..end], Rng::new(24))).is_err());
        }
    }
}

#[test]
fn files_can_follow_each_other() {
    let (primitives, _) = scene(9, 30);
    let first = saved(
        &Bvh::build(
            &primitives,
            &Recipe::default().engine(Engine::best(Width::W4)),
        )
        .expect("a tree"),
    );
    let second = saved(
        &Bvh::build(
            &primitives,
            &Recipe::default().engine(Engine::best(Width::W8)),
        )
        .expect("a tree"),
    );
    let both = [&first[..], &second, b"more"].concat();
    let mut input = &both[..];
    for width in [Width::W4, Width::W8] {
        let report = Bvh::read(&mut input).expect("a tree").report();
        let is_kept = kept_widths().contains(&width);
        assert_eq!(report.file_width, (!is_kept).then_some(width));
    }
    assert_eq!(input, b"more");
}

/// Takes so many bytes and no more.
struct Full(usize);

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = bytes.len().min(self.0);
        self.0 -= taken;
        if taken == 0 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_an_error() {
    let (primitives, _) = scene(10, 400);
    let bvh = Bvh::build(&primitives, &Recipe::fast()).expect("a tree");
    let len = saved(&bvh).len();
    assert!(bvh.write(Full(len)).is_ok());
    for room in [0, 10, len / 2, len - 1] {
        let error = bvh.write(Full(room)).expect_err("no room");
        let Error::Io { kind, .. } = error else {
            panic!("{error}");
        };
        assert_eq!(kind, io::ErrorKind::StorageFull);
    }
}
