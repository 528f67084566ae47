//! Queries of single rays on a shared tree, normals of hits, closed intervals, and what a batch can be told.

use std::collections::HashSet;
use std::sync::{Arc, Mutex};
use std::thread::{self, ThreadId};

use antumbra::cutout::{Candidate, Opacity};
use antumbra::inputs::{Column, Distance};
use antumbra::recipe::{Engine, Order};
use antumbra::shapes::Sphere;
use antumbra::{
    Bvh, Error, Geometry, Hit, INVALID_ID, Instance, Primitives, Ray, RayColumns, RayOrder, Recipe,
    Width,
};
use antumbra_testkit::{Rng, mesh, rays};

use crate::support::{BY_RAY, bits, brute, cutouts, geometry, kernel_rays, square, upwards};
use crate::transforms::{Transform, product, rotation, scale, translation};

/// A tree over a bumpy grid, and rays of all kinds.
fn grid(width: Width, order: Order, count: usize) -> (Bvh, Vec<Ray>) {
    let mut rng = Rng::new(77);
    let mesh = mesh::bumpy_grid(&mut rng, 600);
    let mut rays = rays::bundles(&mut rng, &mesh, count / 2);
    rays.extend(rays::around(&mut rng, &mesh, count));
    rays.truncate(count);
    let recipe = Recipe::default().engine(Engine::best(width)).order(order);
    let bvh = Bvh::build(&[geometry(&mesh)], &recipe).expect("a mesh");
    (bvh, kernel_rays(&rays))
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn threads_share_a_tree() {
    for (width, order) in [
        (Width::W4, Order::Joint),
        (Width::W8, BY_RAY),
        (Width::W16, Order::Joint),
    ] {
        let (bvh, rays) = grid(width, order, 4000);
        let bvh = Arc::new(bvh);
        let mut occluded = vec![false; rays.len()];
        let mut hits = vec![None; rays.len()];
        bvh.batch(&rays).occluded_into(&mut occluded);
        bvh.batch(&rays).intersect_into(&mut hits);
        let (rays, answers) = (Arc::new(rays), Arc::new((occluded, hits)));
        let threads: Vec<_> = (0..4)
            .map(|_| {
                let (bvh, rays, answers) = (bvh.clone(), rays.clone(), answers.clone());
                thread::spawn(move || {
                    for (index, ray) in rays.iter().enumerate() {
                        assert_eq!(bvh.occluded(ray), answers.0[index], "{ray:?}");
                        assert_eq!(bits(bvh.intersect(ray)), bits(answers.1[index]), "{ray:?}");
                    }
                })
            })
            .collect();
        for thread in threads {
            thread.join().expect("equal answers");
        }
    }
}

/// A filter that asks the tree that it is in, while that is asked.
#[derive(Debug)]
struct Nested(Mutex<Option<Arc<Bvh>>>);

impl Opacity for Nested {
    fn opacity(&self, _: &Candidate) -> f32 {
        let inner = self.0.lock().expect("not poisoned").clone();
        match inner {
            Some(bvh) => {
                let ray = Ray::new([0.0, 0.1, -5.0], [0.0, 0.0, 1.0]);
                f32::from(u8::from(bvh.occluded(&ray)))
            }
            None => 0.5,
        }
    }
}

#[test]
fn a_filter_may_ask_another_tree() {
    let mesh = square(1.0);
    let inner = Bvh::build(&[geometry(&mesh)], &Recipe::default()).expect("a mesh");
    let filter = Arc::new(Nested(Mutex::new(None)));
    let outer = Bvh::build(&[cutouts(&mesh, filter.clone())], &Recipe::default()).expect("a mesh");
    *filter.0.lock().expect("not poisoned") = Some(Arc::new(inner));
    let ray = Ray::new([0.3, 0.2, 0.0], [0.0, 0.0, 1.0]);
    assert!(outer.occluded(&ray));
    assert_eq!(outer.intersect(&ray).map(|hit| hit.t), Some(1.0));
}

fn apply(transform: &Transform, point: [f32; 3]) -> [f64; 3] {
    transform.map(|[a, b, c, d]| {
        let [x, y, z] = point.map(f64::from);
        f64::from(a) * x + f64::from(b) * y + f64::from(c) * z + f64::from(d)
    })
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|axis| a[axis] - b[axis])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Of length 1, with how certain its direction is: its length before, relative to the lengths of the edges.
fn normal_of([a, b, c]: [[f64; 3]; 3]) -> ([f64; 3], f64) {
    let ([ux, uy, uz], [vx, vy, vz]) = (sub(b, a), sub(c, a));
    let normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    let length = dot(normal, normal).sqrt();
    let edges = [sub(b, a), sub(c, a)].map(|edge| dot(edge, edge).sqrt());
    (normal.map(|x| x / length), length / (edges[0] * edges[1]))
}

/// Triangles and spheres in the world and in turned, stretched and mirrored instances: normals are those of the corners
/// where they stand in the world.
#[test]
fn normals_are_those_of_the_corners() {
    let mut rng = Rng::new(4);
    let soup = mesh::soup(&mut rng, 300);
    let sphere = Sphere {
        center: [0.2, 0.1, -0.3],
        radius: 0.4,
    };
    let geometries = [geometry(&soup), Geometry::spheres(vec![sphere])];
    let transforms: Vec<Transform> = (0..6)
        .map(|index| {
            let mirror = if index % 2 == 0 { 1.0 } else { -1.0 };
            let stretch = scale([mirror * rng.range(0.5, 2.0), rng.range(0.5, 2.0), 1.0]);
            product(
                &translation(rng.point(3.0)),
                &product(&rotation(&mut rng), &stretch),
            )
        })
        .collect();
    let instances: Vec<_> = transforms
        .iter()
        .map(|&transform| Instance::new(0, transform))
        .collect();
    let primitives = Primitives::with_instances(&geometries, &[&geometries[..]], &instances)
        .expect("indices in range");
    let (mut triangles, mut spheres) = (0, 0);
    for width in Width::ALL {
        let bvh =
            Bvh::build(&primitives, &Recipe::fast().engine(Engine::best(width))).expect("a tree");
        for _ in 0..3000 {
            let ray = Ray::between(rng.point(4.0), rng.point(4.0));
            let Some(hit) = bvh.intersect(&ray) else {
                continue;
            };
            let world = product(&translation([0.0; 3]), &scale([1.0; 3]));
            let transform = match hit.inst_id {
                INVALID_ID => &world,
                instance => &transforms[instance as usize],
            };
            let found = bvh.normal(&ray, &hit).expect("a hit of this tree");
            let found = found.map(f64::from);
            assert!((dot(found, found) - 1.0).abs() < 1e-5);
            if hit.geom_id == 0 {
                let corners = soup.triangle(hit.prim_id as usize);
                let (expected, certainty) =
                    normal_of(corners.map(|corner| apply(transform, corner)));
                if certainty > 1e-3 {
                    assert!(
                        dot(found, expected) > 1.0 - 1e-6,
                        "{hit:?} {found:?} {expected:?}"
                    );
                    triangles += 1;
                }
            } else {
                // Orthogonal to the surface: the gradient of the distance to the centre, by differences.
                let point = ray.at(hit.t).map(f64::from);
                let center = apply(transform, sphere.center);
                assert!(dot(sub(point, center), found) > 0.0, "outwards: {hit:?}");
                if hit.inst_id == INVALID_ID {
                    let expected = sub(point, center).map(|x| x / 0.4);
                    assert!(dot(found, expected) > 1.0 - 1e-4, "{hit:?}");
                }
                spheres += 1;
            }
            for other in [
                Hit {
                    prim_id: hit.prim_id ^ 1 << 20,
                    ..hit
                },
                Hit { geom_id: 7, ..hit },
                Hit { inst_id: 99, ..hit },
            ] {
                assert_eq!(bvh.normal(&ray, &other), None);
            }
        }
    }
    assert!(triangles > 500 && spheres > 100, "{triangles} {spheres}");
}

#[test]
fn closed_intervals_hold_their_ends() {
    let (bvh, rays) = grid(Width::W8, Order::Joint, 6000);
    let mut hits = 0;
    for ray in &rays {
        let Some(hit) = bvh.intersect(ray) else {
            continue;
        };
        // Exactly at the far end, at the near end, and at both. Nothing else lies between here and there.
        let here = ray.tnear + 0.5 * (hit.t - ray.tnear);
        if !(ray.tnear.next_up() < here && here.next_up() < hit.t) {
            continue;
        }
        // The distance that decides is a few units in the last place from the one that is reported.
        let near =
            (-64..=64).map(|step: i32| f32::from_bits(hit.t.to_bits().wrapping_add_signed(step)));
        let lies_before = |tfar: f32| bvh.occluded(&Ray { tfar, ..*ray });
        let decides = |t: &f32| lies_before(t.next_up()) && !lies_before(*t);
        let Some(t) = near.into_iter().find(decides) else {
            continue;
        };
        for (tnear, tfar) in [(here, t), (t, ray.tfar), (t, t)] {
            let open = Ray {
                tnear,
                tfar,
                ..*ray
            };
            let closed = open.closed();
            let found = bvh.intersect(&closed).expect("at the end");
            assert_eq!((found.u, found.v), (hit.u, hit.v), "{open:?}");
            assert_eq!(found.prim_id, hit.prim_id, "{open:?}");
            assert!(closed.tnear < found.t && found.t < closed.tfar, "{open:?}");
            let is_it = |other: antumbra::Hit| other.prim_id == hit.prim_id;
            assert!(bvh.occluded(&closed) && !bvh.intersect(&open).is_some_and(is_it));
        }
        hits += 1;
    }
    assert!(hits > 1000);

    // On the surface itself, and a segment that ends there.
    let ground = Bvh::build(&[geometry(&square(0.0))], &Recipe::default()).expect("a mesh");
    for ray in upwards(&mut Rng::new(1), 100) {
        let down = Ray::between([ray.org[0], ray.org[1], 3.0], ray.org);
        for ray in [ray, down] {
            assert!(!ground.occluded(&ray));
            assert!(ground.occluded(&ray.closed()));
            let mut occluded = [false];
            ground.batch(&[ray]).closed().occluded_into(&mut occluded);
            assert_eq!(occluded, [true]);
        }
    }
}

#[test]
fn hits_next_to_zero_are_those_of_brute_force() {
    let mut rng = Rng::new(126);
    let tiny = [
        0.0,
        1e-45,
        1e-42,
        f32::MIN_POSITIVE,
        3.0 * f32::MIN_POSITIVE,
        1e-35,
        1e-31,
        1e-20,
    ];
    let (mut hits, mut ends) = (0, 0);
    for round in 0..3000 {
        let side = 10_f32.powi(rng.below(14) as i32 - 3);
        let mut signed =
            |list: &[f32]| list[rng.below(list.len())] * (rng.below(2) as f32 * 2.0 - 1.0);
        // Triangles that are nearly in the plane from which rays begin.
        let corners: Vec<[f32; 3]> = (0..12)
            .map(|corner| {
                let [x, y] = [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]][corner % 3];
                [x * side, y * side, signed(&tiny)]
            })
            .collect();
        let rays: Vec<Ray> = (0..16)
            .map(|_| {
                let org = [
                    0.1 * side * signed(&[0.0, 1.0]),
                    0.2 * side * signed(&[0.0, 1.0]),
                    signed(&tiny),
                ];
                let dir = [signed(&[0.0, 1e-3]), 0.0, signed(&[1.0, 1e-3, 1e3])];
                Ray {
                    tnear: signed(&tiny[..6]),
                    ..Ray::new(org, dir)
                }
            })
            .collect();
        let indices = vec![[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]];
        let primitives =
            Primitives::new(&[Geometry::triangles(&corners[..], indices)]).expect("a mesh");
        let (bvh, brute) = (
            Bvh::build(&primitives, &Recipe::default()).expect("a tree"),
            antumbra::Brute::new(&primitives),
        );
        let batch = bvh.batch(&rays).intersect();
        let occluded = bvh.batch(&rays).occluded();
        for (index, ray) in rays.iter().enumerate() {
            let wanted = brute.intersect(ray);
            assert_eq!(bits(bvh.intersect(ray)), bits(wanted), "{round} {ray:?}");
            assert_eq!(bits(batch[index]), bits(wanted), "{round} {ray:?}");
            assert_eq!(occluded[index], wanted.is_some(), "{round} {ray:?}");
            hits += usize::from(wanted.is_some());
            ends += usize::from(wanted.is_some_and(|hit| hit.t.abs() <= f32::MIN_POSITIVE));
        }
    }
    assert!(hits > 1000 && ends > 100, "{hits} {ends}");
}

/// One array for everything, with other numbers in between.
fn interleaved(rays: &[Ray], stride: usize, rng: &mut Rng) -> Vec<f32> {
    let mut numbers: Vec<f32> = (0..stride * rays.len()).map(|_| rng.unit()).collect();
    for (ray, numbers) in rays.iter().zip(numbers.chunks_mut(stride)) {
        numbers[..3].copy_from_slice(&ray.dir);
        numbers[3] = ray.tfar;
        numbers[4..7].copy_from_slice(&ray.org);
        numbers[7] = ray.tnear;
    }
    numbers
}

#[test]
fn columns_give_the_answers_of_lists() {
    let (bvh, rays) = grid(Width::W16, Order::Joint, 20_000);
    let mut rng = Rng::new(8);
    for len in [0, 1, 7, 100, 4097, 20_000] {
        let rays = &rays[..len];
        let origins: Vec<[f32; 3]> = rays.iter().map(|ray| ray.org).collect();
        let directions: Vec<[f32; 4]> = rays
            .iter()
            .map(|ray| [ray.dir[0], ray.dir[1], ray.dir[2], f32::NAN])
            .collect();
        let near: Vec<f32> = rays.iter().map(|ray| ray.tnear).collect();
        let far: Vec<f32> = rays.iter().map(|ray| ray.tfar).collect();
        let all = interleaved(rays, 11, &mut rng);
        let from = |first: usize| Column::new(all.get(first..).unwrap_or(&[]), 11);
        let up = [0.1, 0.2, 1.0];

        let separate = RayColumns::new(len, &origins, &directions[..])
            .and_then(|rays| rays.near(&near)?.far(&far[..]));
        let strided = RayColumns::new(len, from(4), from(0))
            .and_then(|rays| rays.near(from(7))?.far(from(3)));
        let same = RayColumns::new(len, &origins, &up).and_then(|rays| rays.near(-1.0)?.far(0.75));
        let plain = RayColumns::new(len, &origins, &up);
        let with = |change: &dyn Fn(&Ray) -> Ray| rays.iter().map(change).collect::<Vec<_>>();
        for (columns, list) in [
            (separate, rays.to_vec()),
            (strided, rays.to_vec()),
            (
                same,
                with(&|ray| Ray {
                    org: ray.org,
                    dir: up,
                    tnear: -1.0,
                    tfar: 0.75,
                }),
            ),
            (plain, with(&|ray| Ray::new(ray.org, up))),
        ] {
            let columns = columns.expect("long enough");
            let (mut occluded, mut found) = (vec![true; len], vec![false; len]);
            let (mut hits, mut found_hits) = (vec![None; len], vec![None; len]);
            let mut words = vec![u64::MAX; len.div_ceil(64)];
            bvh.batch(&list).occluded_into(&mut occluded);
            bvh.batch(&list).intersect_into(&mut hits);
            for order in [RayOrder::AsGiven, RayOrder::Sorted, RayOrder::ByRule] {
                bvh.batch(columns).order(order).occluded_into(&mut found);
                assert_eq!(found, occluded, "{len} {order:?}");
                bvh.batch(columns)
                    .order(order)
                    .intersect_into(&mut found_hits);
                assert_eq!(found_hits, hits, "{len} {order:?}");
                bvh.batch(columns)
                    .order(order)
                    .occluded_bits_into(&mut words);
                for (index, occluded) in occluded.iter().enumerate() {
                    assert_eq!(words[index / 64] >> (index % 64) & 1 == 1, *occluded);
                }
            }
            let closed: Vec<Ray> = list.iter().map(|ray| ray.closed()).collect();
            bvh.batch(&closed).intersect_into(&mut hits);
            for order in [RayOrder::AsGiven, RayOrder::Sorted] {
                bvh.batch(columns)
                    .closed()
                    .order(order)
                    .intersect_into(&mut found_hits);
                assert_eq!(found_hits, hits, "{len} {order:?}");
            }
        }
    }
}

#[test]
fn columns_that_are_too_short_are_errors() {
    let numbers = [0.0; 20];
    let column = |len, stride| Column::new(&numbers[..len], stride);
    assert!(RayColumns::new(3, column(9, 3), column(3, 0)).is_ok());
    assert!(RayColumns::new(4, column(15, 4), column(6, 1)).is_ok());
    assert!(RayColumns::new(0, column(0, 3), column(0, 0)).is_ok());
    for (len, origins, directions, what, needed, found) in [
        (3, column(8, 3), column(3, 0), "origins", 9, 8),
        (1, column(2, 0), column(3, 0), "origins", 3, 2),
        (4, column(15, 4), column(5, 1), "directions", 6, 5),
        (
            usize::MAX,
            column(20, 3),
            column(3, 0),
            "origins",
            usize::MAX,
            20,
        ),
    ] {
        let error = RayColumns::new(len, origins, directions).expect_err("too short");
        assert_eq!(
            error,
            Error::TooShort {
                what,
                needed,
                found
            }
        );
    }
    let rays = RayColumns::new(5, column(15, 3), column(3, 0)).expect("long enough");
    assert!(rays.near(Distance::Each(column(4, 1))).is_err());
    assert!(rays.far(&numbers[..4]).is_err());
    assert!(rays.far(column(9, 2)).is_ok());
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn sorted_batches_give_the_same_answers_in_the_same_places() {
    for order in [Order::Joint, BY_RAY] {
        let (bvh, rays) = grid(Width::W8, order, 40_000);
        for len in [1, 2, 9, 5000, 40_000] {
            let rays = &rays[..len];
            let (mut occluded, mut found) = (vec![false; len], vec![true; len]);
            let (mut hits, mut found_hits) = (vec![None; len], vec![None; len]);
            bvh.batch(rays).occluded_into(&mut occluded);
            bvh.batch(rays).intersect_into(&mut hits);
            for threads in [1, 3] {
                pool(threads).install(|| {
                    bvh.batch(rays)
                        .order(RayOrder::Sorted)
                        .occluded_into(&mut found);
                    bvh.batch(rays)
                        .order(RayOrder::Sorted)
                        .intersect_into(&mut found_hits);
                });
                assert_eq!(found, occluded);
                assert_eq!(found_hits, hits);
            }
        }
    }
    // Rays that share an origin, and a tree without extent.
    let flat = Bvh::build(&[geometry(&square(0.0))], &Recipe::default()).expect("a mesh");
    let rays = vec![Ray::new([0.0, 0.1, -1.0], [0.0, 0.0, 1.0]); 100];
    let mut found = vec![false; 100];
    flat.batch(&rays)
        .order(RayOrder::Sorted)
        .occluded_into(&mut found);
    assert_eq!(found, [true; 100]);
}

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|index| format!("foreign {index}"))
        .build()
        .expect("a pool")
}

/// Remembers which threads ask.
#[derive(Debug, Default)]
struct Witness(Mutex<HashSet<(ThreadId, String)>>);

impl Opacity for Witness {
    fn opacity(&self, _: &Candidate) -> f32 {
        let thread = thread::current();
        let name = thread.name().unwrap_or("").to_owned();
        self.0
            .lock()
            .expect("not poisoned")
            .insert((thread.id(), name));
        1.0
    }
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn batches_stay_in_the_pool_of_their_caller() {
    let witness = Arc::new(Witness::default());
    let filter: Arc<dyn Opacity> = witness.clone();
    let bvh = Bvh::build(&[cutouts(&square(1.0), filter)], &Recipe::default()).expect("a mesh");
    let rays = upwards(&mut Rng::new(3), 200_000);
    let seen = || core::mem::take(&mut *witness.0.lock().expect("not poisoned"));
    let mut occluded = vec![false; rays.len()];
    let mut hits = vec![None; rays.len()];
    seen();
    for threads in [1, 3] {
        let pool = pool(threads);
        for order in [RayOrder::AsGiven, RayOrder::Sorted] {
            pool.install(|| {
                bvh.batch(&rays).order(order).occluded_into(&mut occluded);
                bvh.batch(&rays).order(order).intersect_into(&mut hits);
            });
            let found = seen();
            assert!((1..=threads).contains(&found.len()), "{found:?}");
            assert!(
                found.iter().all(|(_, name)| name.starts_with("foreign")),
                "{found:?}"
            );
            // Alone in the pool, and alone outside.
            let own = pool.install(|| {
                let batch = bvh.batch(&rays).order(order).on_this_thread();
                batch.occluded_into(&mut occluded);
                thread::current().id()
            });
            assert!(seen().iter().map(|(id, _)| *id).eq([own]));
        }
    }
    bvh.batch(&rays).on_this_thread().intersect_into(&mut hits);
    assert!(
        seen()
            .iter()
            .map(|(id, _)| *id)
            .eq([thread::current().id()])
    );
    // Few rays stay on the thread, whatever pool there is.
    bvh.batch(&rays[..16_384])
        .occluded_into(&mut occluded[..16_384]);
    assert!(
        seen()
            .iter()
            .map(|(id, _)| *id)
            .eq([thread::current().id()])
    );
}

#[test]
fn points_along_a_ray() {
    let ray = Ray::between([1.0, 2.0, 3.0], [2.0, 4.0, 7.0]);
    assert_eq!(ray.at(0.0), [1.0, 2.0, 3.0]);
    assert_eq!(ray.at(1.0), [2.0, 4.0, 7.0]);
    assert_eq!(ray.at(-0.5), [0.5, 1.0, 1.0]);
    let oracle = brute(&[geometry(&square(0.0))]);
    assert!(!oracle.occluded(&Ray::default()));
}
