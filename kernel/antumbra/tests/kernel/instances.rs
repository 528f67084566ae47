//! Scenes on two levels: every tree, order and level against brute force, and against flattened geometry.

use crate::support::{
    BUILDERS, Odd, collapses, config, for_every_tree, geometry, kernel_rays, quads, ways,
};
use crate::transforms::{IDENTITY, Transform, product, rotation, scale, transform, translation};
use antumbra::parts::{BinaryTree, Learning, Steps, TreeLog, surface_rays};
use antumbra::recipe::{Builder, Collapse, Engine};
use antumbra::shapes::Sphere;
use antumbra::{
    Brute, Bvh, Error, Geometry, Hit, INVALID_ID, Instance, Primitives, Ray, Recipe, Width,
};
use antumbra_testkit::sample::{pairs, triples};
use antumbra_testkit::{Mesh, Rng, mesh, rays};
use proptest::prelude::*;

/// Meshes of the world, objects, and where these are.
pub struct Scene {
    pub world: Vec<Mesh>,
    pub spheres: Vec<Sphere>,
    pub odd: Odd,
    pub objects: Vec<Mesh>,
    pub instances: Vec<Instance>,
}

impl Scene {
    pub fn new(rng: &mut Rng, size: usize, count: usize) -> Self {
        let any_mesh = |rng: &mut Rng| {
            let size = 1 + rng.below(size);
            mesh::ALL[rng.below(mesh::ALL.len())](rng, size)
        };
        let world = (0..rng.below(3)).map(|_| any_mesh(rng)).collect();
        let objects: Vec<_> = (0..1 + rng.below(4)).map(|_| any_mesh(rng)).collect();
        let spheres = (0..rng.below(4))
            .map(|_| Sphere {
                center: rng.point(1.0),
                radius: 0.3 * rng.unit(),
            })
            .collect();
        let odd = match rng.below(3) {
            0 => 0,
            most => rng.below(8 * most),
        };
        let odd = Odd::new(rng, odd);
        let instances = (0..rng.below(count))
            .map(|_| Instance::new(rng.below(objects.len()) as u32, transform(rng)))
            .collect();
        Self {
            world,
            spheres,
            odd,
            objects,
            instances,
        }
    }

    /// What lies in the world itself.
    pub fn ground(&self) -> Vec<Geometry<'_>> {
        let mut world: Vec<_> = self.world.iter().map(geometry).collect();
        if !self.odd.boxes.is_empty() {
            world.extend(self.world.iter().map(quads));
        }
        world.push(Geometry::spheres(&self.spheres[..]));
        world.push(self.odd.geometry());
        world
    }

    /// Every object with a sphere, its mesh twice, user geometry and, if there is any, quads: objects are lists.
    pub fn object_lists(&self) -> Vec<Vec<Geometry<'_>>> {
        let spheres = &self.spheres[..self.spheres.len().min(1)];
        let list = |mesh| {
            let odd = self.odd.geometry();
            let mut list = vec![
                geometry(mesh),
                Geometry::spheres(spheres),
                geometry(mesh),
                odd,
            ];
            if !self.odd.boxes.is_empty() {
                list.push(quads(mesh));
            }
            list
        };
        self.objects.iter().map(list).collect()
    }

    pub fn primitives(&self) -> Primitives {
        let (world, objects) = (self.ground(), self.object_lists());
        Primitives::with_instances(&world, &objects, &self.instances).expect("indices in range")
    }

    /// All as one mesh in the world.
    fn flattened(&self) -> Mesh {
        let mut all = mesh::empty(&mut Rng::new(0), 0);
        let mut add = |mesh: &Mesh, transform: &Transform| {
            let first = all.positions.len() as u32;
            all.positions
                .extend(mesh.positions.iter().map(|p| apply(transform, *p)));
            let indices = mesh.indices.iter();
            all.indices
                .extend(indices.map(|triangle| triangle.map(|index| first + index)));
        };
        for mesh in &self.world {
            add(mesh, &IDENTITY);
        }
        for instance in &self.instances {
            add(&self.objects[instance.object as usize], &instance.transform);
        }
        all
    }

    pub fn rays(&self, rng: &mut Rng, count: usize) -> Vec<Ray> {
        kernel_rays(&rays::around(rng, &self.flattened(), count))
    }
}

/// In double precision, rounded once.
fn apply(transform: &Transform, point: [f32; 3]) -> [f32; 3] {
    transform.map(|[a, b, c, d]| {
        let [x, y, z] = point.map(f64::from);
        (f64::from(a) * x + f64::from(b) * y + f64::from(c) * z + f64::from(d)) as f32
    })
}

/// Everything but NaN is compared by its bits.
fn bits(hit: Option<Hit>) -> Option<([u32; 3], [u32; 3])> {
    hit.map(|hit| {
        (
            [hit.t, hit.u, hit.v].map(f32::to_bits),
            [hit.inst_id, hit.geom_id, hit.prim_id],
        )
    })
}

/// What brute force answers.
pub struct Expected {
    occluded: Vec<bool>,
    hits: Vec<Option<Hit>>,
    all_hits: Vec<Vec<Hit>>,
}

impl Expected {
    pub fn new(primitives: &Primitives, rays: &[Ray], place: &str) -> Self {
        let brute = Brute::new(primitives);
        let expected = Self {
            occluded: rays.iter().map(|ray| brute.occluded(ray)).collect(),
            hits: rays.iter().map(|ray| brute.intersect(ray)).collect(),
            all_hits: rays.iter().map(|ray| brute.query(ray).all_hits()).collect(),
        };
        for (index, ray) in rays.iter().enumerate() {
            let hit = expected.hits[index];
            assert_eq!(expected.occluded[index], hit.is_some(), "{place}: {ray:?}");
            let first = expected.all_hits[index].first().copied();
            assert_eq!(bits(first), bits(hit), "{place}: {ray:?}");
            if let Some(hit) = hit {
                assert!(
                    ray.tnear < hit.t && hit.t < ray.tfar,
                    "{place}: {ray:?} {hit:?}"
                );
            }
        }
        expected
    }

    /// Batches and single queries of a tree.
    pub fn check(&self, bvh: &Bvh, rays: &[Ray], place: &str) {
        bvh.validate()
            .unwrap_or_else(|broken| panic!("{place}: {broken}"));
        let mut occluded = vec![false; rays.len()];
        let mut hits = vec![None; rays.len()];
        bvh.batch(rays).occluded_into(&mut occluded);
        bvh.batch(rays).intersect_into(&mut hits);
        for (index, ray) in rays.iter().enumerate() {
            let place = || format!("{place}, ray {index}: {ray:?}");
            let (expected_occluded, expected_hit) = (self.occluded[index], bits(self.hits[index]));
            assert_eq!(occluded[index], expected_occluded, "{}", place());
            assert_eq!(bits(hits[index]), expected_hit, "{}", place());
            // Slower than the others together.
            if index.is_multiple_of(4) {
                let all_hits = &self.all_hits[index];
                assert_eq!(
                    &bvh.query(ray).all_hits(),
                    all_hits,
                    "all hits: {}",
                    place()
                );
            }
            assert_eq!(bvh.occluded(ray), expected_occluded, "single: {}", place());
            assert_eq!(
                bits(bvh.intersect(ray)),
                expected_hit,
                "single: {}",
                place()
            );
        }
    }
}

proptest! {
    #![proptest_config(config(8))]

    #[test]
    fn every_tree_equals_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        let scene = Scene::new(&mut rng, 80, 24);
        let primitives = scene.primitives();
        let rays = scene.rays(&mut rng, 150);
        let place = format!("seed {seed}");
        let expected = Expected::new(&primitives, &rays, &place);
        for_every_tree(&primitives, &rays, |bvh, tree| {
            expected.check(bvh, &rays, &format!("{place}, {tree}"));
        });
    }

    #[test]
    fn learned_trees_equal_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        let scene = Scene::new(&mut rng, 200, 40);
        let primitives = scene.primitives();
        let rays = scene.rays(&mut rng, 150);
        let expected = Expected::new(&primitives, &rays, &format!("seed {seed}"));
        let trees = triples(seed, &BUILDERS, &collapses(), &ways());
        for (builder, (collapse, sort), engine) in trees {
            let tree = BinaryTree::build(&primitives, builder);
            let mut log = TreeLog::new(&tree);
            log.add(&primitives, &tree, &rays[..75], 100.0);
            log.add(&primitives, &tree, &surface_rays(&primitives, 100, seed), 100.0);
            let learning = Learning { collapse, sort, ..Default::default() };
            let bvh = Bvh::collapse_logged(&primitives, &tree, &log, &learning, engine);
            let place = format!("seed {seed} {builder} {collapse} sorted {sort} {engine:?}");
            expected.check(&bvh, &rays, &place);
        }
    }
}

/// Objects large enough that threads share one, too.
#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn trees_of_objects_do_not_depend_on_the_number_of_threads() {
    let mut rng = Rng::new(412);
    let meshes = [16_000, 3000, 3000].map(|triangles| mesh::soup(&mut rng, triangles));
    let objects = [&meshes[1], &meshes[2], &meshes[0]].map(|mesh| [geometry(mesh)]);
    let instances: Vec<_> = (0..50)
        .map(|index| Instance::new(index % 3, transform(&mut rng)))
        .collect();
    for builder in BUILDERS {
        let options = Recipe::default().builder(builder).surface_rays(Some(5000));
        let built = [1, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().expect("threads").install(|| {
                let world = [geometry(&meshes[0])];
                let primitives = Primitives::with_instances(&world, &objects, &instances)
                    .expect("indices in range");
                let bvh = Bvh::build(&primitives, &options).expect("a tree");
                bvh.validate().expect("a valid tree");
                bvh.to_bytes()
            })
        });
        assert!(built[0] == built[1], "{builder}");
    }
}

/// Intervals that end within a few roundings of a hit.
#[test]
fn intervals_that_end_at_a_hit_are_exact() {
    let seed = 411;
    let mut rng = Rng::new(seed);
    for round in 0..20 {
        let scene = Scene::new(&mut rng, 60, 20);
        let primitives = scene.primitives();
        let brute = Brute::new(&primitives);
        let mut rays = Vec::new();
        for mut ray in scene.rays(&mut rng, 200) {
            let Some(hit) = brute.intersect(&ray) else {
                continue;
            };
            let steps = [0, 1, 3, 40, 5000][rng.below(5)] * (1 - 2 * rng.below(2) as i32);
            let near = f32::from_bits(hit.t.to_bits().saturating_add_signed(steps));
            if rng.below(2) == 0 {
                ray.tfar = near;
            } else {
                ray.tnear = near;
            }
            rays.push(ray);
        }
        let place = format!("seed {seed} round {round}");
        let expected = Expected::new(&primitives, &rays, &place);
        let tree = BinaryTree::build(&primitives, Builder::default());
        for engine in ways() {
            let bvh = Bvh::collapse(&primitives, &tree, Collapse::Area, engine);
            expected.check(&bvh, &rays, &format!("{place} {engine:?}"));
        }
    }
}

/// Transforms so bad, and rays from so far, that rounding moves hits out of the box of their instance: what is
/// reported is clamped, many hits become equally near, and their ids decide.
#[test]
fn clamped_hits_are_ranked_alike_by_every_tree() {
    let seed = 419;
    let mut rng = Rng::new(seed);
    for round in 0..6 {
        let mesh = mesh::soup(&mut rng, 150);
        let instances: Vec<_> = (0..4)
            .map(|_| {
                let mut shear = IDENTITY;
                let row = rng.below(3);
                shear[row][(row + 1) % 3] = 10f32.powf(rng.range(2.0, 4.5));
                let transform = product(&rotation(&mut rng), &product(&shear, &rotation(&mut rng)));
                Instance::new(0, transform)
            })
            .collect();
        let primitives = Primitives::with_instances(&[], &[[geometry(&mesh)]], &instances)
            .expect("indices in range");
        let rays: Vec<_> = (0..1500)
            .map(|_| {
                let transform = &instances[rng.below(instances.len())].transform;
                let target = apply(transform, rng.point(1.0));
                let size = target.iter().fold(1.0f32, |size, x| size.max(x.abs()));
                let far = size * 10f32.powf(rng.range(0.0, 4.0));
                let org = rng.direction().map(|x| x * far);
                Ray::new(org, core::array::from_fn(|k| target[k] - org[k]))
            })
            .collect();
        let place = format!("seed {seed} round {round}");
        let expected = Expected::new(&primitives, &rays, &place);
        let hits = expected.hits.iter().flatten().count();
        assert!(hits > 50, "{place}: {hits} hits");
        for (builder, engine) in pairs(round, &BUILDERS, &ways()) {
            let tree = BinaryTree::build(&primitives, builder);
            let bvh = Bvh::collapse(&primitives, &tree, Collapse::Area, engine);
            expected.check(&bvh, &rays, &format!("{place} {builder} {engine:?}"));
        }
    }
}

/// Batches of any number of rays.
#[test]
fn batches_of_every_length() {
    let mut rng = Rng::new(412);
    let mut scene = Scene::new(&mut rng, 100, 1);
    scene.instances = (0..50)
        .map(|_| Instance::new(rng.below(scene.objects.len()) as u32, transform(&mut rng)))
        .collect();
    let primitives = scene.primitives();
    let rays = scene.rays(&mut rng, 40_000);
    let bvh = Bvh::build(&primitives, &Recipe::default()).expect("a tree");
    let brute = Brute::new(&primitives);
    for count in [0, 1, 7, 8, 9, 31, 33, 100] {
        let rays = &rays[..count];
        let mut answers = (vec![false; count], vec![None; count]);
        bvh.batch(rays).occluded_into(&mut answers.0);
        bvh.batch(rays).intersect_into(&mut answers.1);
        for (index, ray) in rays.iter().enumerate() {
            assert_eq!(answers.0[index], brute.occluded(ray), "{count}: {ray:?}");
            assert_eq!(
                bits(answers.1[index]),
                bits(brute.intersect(ray)),
                "{count}: {ray:?}"
            );
        }
    }
    let mut whole = vec![None; rays.len()];
    bvh.batch(&rays).intersect_into(&mut whole);
    for (ray, hit) in rays.iter().zip(&whole) {
        assert_eq!(bits(bvh.intersect(ray)), bits(*hit), "{ray:?}");
    }
}

/// An object left where it is gives the hits of the object itself, to the bit.
#[test]
fn the_identity_changes_nothing() {
    let seed = 413;
    let mut rng = Rng::new(seed);
    for generate in mesh::ALL {
        let mesh = generate(&mut rng, 300);
        let instance = Instance::new(0, IDENTITY);
        let placed = Primitives::with_instances(&[], &[[geometry(&mesh)]], &[instance])
            .expect("indices in range");
        let plain = Primitives::new(&[geometry(&mesh)]).expect("indices in range");
        let rays = kernel_rays(&rays::around(&mut rng, &mesh, 2000));
        let (placed, plain) = (Brute::new(&placed), Brute::new(&plain));
        for ray in rays {
            let expected = plain.intersect(&ray).map(|hit| Hit { inst_id: 0, ..hit });
            let place = format!("seed {seed} {}: {ray:?}", mesh.name);
            assert_eq!(bits(placed.intersect(&ray)), bits(expected), "{place}");
        }
    }
}

/// Instances against the same triangles placed by hand: the same answers but for rays that graze, where
/// rounding decides.
#[test]
fn instances_equal_flattened_geometry() {
    let seed = 414;
    let mut rng = Rng::new(seed);
    let (mut traced, mut hits, mut different) = (0, 0, 0);
    for _ in 0..30 {
        let mut scene = Scene::new(&mut rng, 300, 1);
        scene.spheres.clear();
        scene.odd = Odd::default();
        scene.objects = vec![
            mesh::soup(&mut rng, 200),
            mesh::icosphere(2),
            mesh::bumpy_grid(&mut rng, 200),
        ];
        for _ in 0..12 {
            // Well-conditioned ones: rounding is not magnified.
            let turned = product(&translation(rng.point(1.5)), &rotation(&mut rng));
            let mirror = [1.0, -1.0][rng.below(2)];
            let by = [mirror, rng.range(0.5, 2.0), rng.range(0.5, 2.0)];
            scene.instances.push(Instance::new(
                rng.below(3) as u32,
                product(&turned, &scale(by)),
            ));
        }
        let flattened = scene.flattened();
        let plain = Primitives::new(&[geometry(&flattened)]).expect("indices in range");
        let (options, primitives) = (Recipe::default(), scene.primitives());
        let placed = Bvh::build(&primitives, &options).expect("a tree");
        let plain = Bvh::build(&plain, &options).expect("a tree");
        // The first triangle of each mesh of the world, then of each instance.
        let mut firsts = vec![0];
        let world = scene.world.iter();
        let instances = scene.instances.iter();
        for mesh in world.chain(instances.map(|one| &scene.objects[one.object as usize])) {
            firsts.push(firsts[firsts.len() - 1] + mesh.indices.len() as u32);
        }
        for _ in 0..3000 {
            let ray = Ray::new(rng.point(3.0), rng.direction());
            traced += 1;
            let (found, expected) = (placed.intersect(&ray), plain.intersect(&ray));
            assert_eq!(placed.occluded(&ray), found.is_some());
            let same = match (found, expected) {
                (None, None) => true,
                (Some(found), Some(expected)) => {
                    hits += 1;
                    // Objects hold their mesh twice, as geometries 0 and 2.
                    let part = match found.inst_id {
                        INVALID_ID => found.geom_id as usize,
                        instance => scene.world.len() + instance as usize,
                    };
                    let same_prim = firsts[part] + found.prim_id == expected.prim_id;
                    let distance = (found.t - expected.t).abs();
                    same_prim && distance <= 1e-5 * (1.0 + expected.t.abs())
                }
                _ => false,
            };
            different += usize::from(!same);
        }
    }
    println!("{different} of {traced} rays differ, {hits} hits");
    assert!(hits > traced / 4, "seed {seed}: {hits} hits");
    assert!(
        different * 2000 <= traced,
        "seed {seed}: {different} of {traced} rays differ"
    );
}

/// From inside a closed mesh, placed anywhere, no ray gets out.
#[test]
fn closed_objects_do_not_leak() {
    let seed = 415;
    let mut rng = Rng::new(seed);
    let mesh = mesh::icosphere(4);
    for _ in 0..40 {
        let placement = transform(&mut rng);
        let instance = [Instance::new(0, placement)];
        let primitives = Primitives::with_instances(&[], &[[geometry(&mesh)]], &instance)
            .expect("indices in range");
        if primitives.instances() == 0 {
            continue;
        }
        for width in Width::ALL {
            let options = Recipe::default().engine(Engine::best(width));
            let bvh = Bvh::build(&primitives, &options).expect("a tree");
            let rays: Vec<_> = (0..5000)
                .map(|_| {
                    let [a, b, _] = mesh.triangle(rng.below(mesh.indices.len()));
                    let share = [0.0, 0.5, rng.unit()][rng.below(3)];
                    let target = core::array::from_fn(|k| a[k] + (b[k] - a[k]) * share);
                    let org = apply(&placement, rng.point(0.3));
                    let target = apply(&placement, target);
                    Ray::new(org, core::array::from_fn(|k| target[k] - org[k]))
                })
                .collect();
            let mut occluded = vec![false; rays.len()];
            bvh.batch(&rays).occluded_into(&mut occluded);
            for (ray, occluded) in rays.iter().zip(occluded) {
                assert!(occluded, "seed {seed} x{width} {instance:?} {ray:?}");
            }
        }
    }
}

fn triangle() -> Geometry<'static> {
    let positions = vec![[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0]];
    Geometry::triangles(positions, vec![[0, 1, 2]])
}

#[test]
fn useless_instances_are_dropped_and_counted() {
    let nan = f32::NAN;
    let empty: Vec<Geometry<'_>> = Vec::new();
    let bad = Geometry::spheres(vec![Sphere {
        center: [0.0; 3],
        radius: -1.0,
    }]);
    let objects = [vec![triangle()], empty, vec![bad.clone()], vec![bad]];
    let mut with_nan = IDENTITY;
    with_nan[1][2] = nan;
    let mut with_infinity = IDENTITY;
    with_infinity[0][3] = f32::INFINITY;
    let placed = [
        (0, translation([0.0, 0.0, 5.0])),
        (0, scale([1.0, 1.0, 0.0])),
        (0, scale([0.0; 3])),
        (0, with_nan),
        (0, with_infinity),
        (0, scale([3e38; 3])),
        (0, scale([1e-45; 3])),
        (1, IDENTITY),
        (2, IDENTITY),
        (2, IDENTITY),
        (0, translation([0.0, 0.0, 7.0])),
    ];
    let instances = placed.map(|(object, transform)| Instance::new(object, transform));
    let primitives =
        Primitives::with_instances(&[], &objects, &instances).expect("indices in range");
    // Nine instances and the sphere of object 2; nobody looks at object 3.
    assert_eq!(primitives.instances(), 2);
    assert_eq!(primitives.dropped(), 10);
    assert_eq!(
        (primitives.stored(), primitives.len(), primitives.objects()),
        (1, 0, 1)
    );
    let bvh = Bvh::build(&primitives, &Recipe::default()).expect("a tree");
    let report = bvh.report();
    assert_eq!((report.primitives, report.instances), (1, 2));
    assert_eq!((report.objects, report.dropped), (1, 10));
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    let hit = bvh.intersect(&ray).expect("in front");
    assert_eq!(
        (hit.t, hit.inst_id, hit.geom_id, hit.prim_id),
        (5.0, 0, 0, 0)
    );
    let behind = Ray { tnear: 5.5, ..ray };
    let hit = bvh.intersect(&behind).expect("in front");
    assert_eq!((hit.t, hit.inst_id), (7.0, 10));

    let nothing = Primitives::with_instances(&[], &objects, &instances[1..4]).expect("in range");
    assert!(nothing.is_empty());
    let bvh = Bvh::build(&nothing, &Recipe::default()).expect("a tree");
    bvh.validate().expect("a valid tree");
    assert_eq!(bvh.intersect(&ray), None);
}

#[test]
fn an_object_out_of_range_is_an_error_that_names_it() {
    let instances = [0, 2].map(|object| Instance::new(object, IDENTITY));
    let error = Primitives::with_instances(&[], &[[triangle()], [triangle()]], &instances)
        .expect_err("object 2 of 2");
    assert_eq!(
        error,
        Error::ObjectOutOfRange {
            inst_id: 1,
            object: 2,
            objects: 2
        }
    );
    assert_eq!(
        error.to_string(),
        "instance 1 places object 2, but there are 2 objects"
    );
}

#[test]
fn ties_go_to_the_smallest_ids_and_instances_precede_the_world() {
    let instances = [IDENTITY; 20].map(|transform| Instance::new(0, transform));
    let object = [triangle(), triangle()];
    let ray = Ray::new([0.0, 0.0, -2.0], [0.0, 0.0, 1.0]);
    let primitives = Primitives::with_instances(&[triangle()], &[&object[..]], &instances)
        .expect("indices in range");
    for_every_tree(&primitives, &[ray], |bvh, tree| {
        let hit = bvh.intersect(&ray).expect("in front");
        assert_eq!((hit.inst_id, hit.geom_id, hit.prim_id), (0, 0, 0), "{tree}");
    });
}
