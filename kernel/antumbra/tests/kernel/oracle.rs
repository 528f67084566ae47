//! Every builder x width x order x level equals brute force, ray by ray, bit for bit, on geometry nice
//! and nasty.

use crate::support::{
    Odd, config, engines_for, equals_brute, for_every_tree, geometry, kernel_rays, quads,
};
use antumbra::recipe::Level;
use antumbra::shapes::Sphere;
use antumbra::{Brute, Bvh, Geometry, Isa, Primitives, Ray};
use antumbra_testkit::{Rng, mesh, rays};
use proptest::prelude::*;

/// Every tree equals brute force, of which both queries agree.
fn check(name: &str, geometries: &[Geometry<'_>], rays: &[Ray]) {
    let primitives = Primitives::new(geometries).expect("indices in range");
    let brute = Brute::new(&primitives);
    for ray in rays {
        assert_eq!(
            brute.occluded(ray),
            brute.intersect(ray).is_some(),
            "{name}: the two queries disagree on {ray:?}"
        );
    }
    equals_brute(name, &primitives, rays);
}

proptest! {
    #![proptest_config(config(4))]

    #[test]
    fn every_tree_equals_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        for generate in mesh::ALL {
            let size = 1 + rng.below(250);
            let mesh = generate(&mut rng, size);
            let rays = kernel_rays(&rays::around(&mut rng, &mesh, 120));
            check(mesh.name, &[geometry(&mesh)], &rays);
        }
    }

    /// Bundles of rays are answered in packets, some of which fall apart on the way.
    #[test]
    fn every_tree_equals_brute_force_on_bundles_of_rays(seed: u64) {
        let mut rng = Rng::new(seed);
        for generate in mesh::ALL {
            let size = 1 + rng.below(250);
            let mesh = generate(&mut rng, size);
            let rays = kernel_rays(&rays::bundles(&mut rng, &mesh, 160));
            check(mesh.name, &[geometry(&mesh)], &rays);
        }
    }

    #[test]
    fn every_kind_of_geometry(seed: u64) {
        let mut rng = Rng::new(seed);
        let soup = mesh::soup(&mut rng, 40);
        let grid = mesh::bumpy_grid(&mut rng, 60);
        let spheres: Vec<_> = (0..30)
            .map(|_| Sphere { center: rng.point(1.0), radius: rng.unit() * rng.unit() * 0.5 })
            .collect();
        let mut rays = rays::around(&mut rng, &soup, 300);
        rays.extend(rays::bundles(&mut rng, &soup, 300));
        let rays = kernel_rays(&rays);
        let geometries =
            [
                geometry(&soup),
                Geometry::spheres(&spheres[..]),
                geometry(&grid),
                Odd::new(&mut rng, 30).geometry(),
                quads(&grid),
                quads(&soup),
                geometry(&soup),
            ];
        check("mixture", &geometries, &rays);
    }
}

/// Seeds that generated tests have failed with.
#[test]
fn what_was_missed_once_is_found() {
    let mut rng = Rng::new(10092586769160489200);
    for generate in mesh::ALL {
        let size = 1 + rng.below(250);
        let mesh = generate(&mut rng, size);
        let rays = kernel_rays(&rays::around(&mut rng, &mesh, 120));
        if mesh.name == "tiny" {
            check(mesh.name, &[geometry(&mesh)], &rays);
        }
    }
}

/// Where an occlusion query may not skip the clamping of distances: intervals that end within a few steps of a
/// hit, on meshes with slivers, at scales from tiny to huge.
#[test]
fn intervals_that_end_at_a_hit_are_exact() {
    let seed = 1311;
    let mut rng = Rng::new(seed);
    for scale in [1e-18, 1e-6, 1.0, 1e9, 1e17] {
        for generate in mesh::ALL {
            let mut mesh = generate(&mut rng, 60);
            for x in mesh.positions.as_flattened_mut() {
                *x *= scale;
            }
            let primitives = Primitives::new(&[geometry(&mesh)]).expect("indices in range");
            let brute = Brute::new(&primitives);
            let mut rays = Vec::new();
            for mut ray in kernel_rays(&rays::around(&mut rng, &mesh, 60)) {
                let Some(hit) = brute.intersect(&ray) else {
                    continue;
                };
                let steps = [0, 1, 3, 40, 5000][rng.below(5)];
                let near =
                    |steps: i32| f32::from_bits(hit.t.to_bits().saturating_add_signed(steps));
                if rng.below(2) == 0 {
                    ray.tfar = near(steps * (1 - 2 * rng.below(2) as i32));
                } else {
                    ray.tnear = near(steps * (1 - 2 * rng.below(2) as i32));
                }
                rays.push(ray);
            }
            check(
                &format!("{} at scale {scale}", mesh.name),
                &[geometry(&mesh)],
                &rays,
            );
        }
    }
}

/// Needles a few roundings wide: their distances are so uncertain that clamping moves them visibly, out of
/// intervals that end close by.
#[test]
fn needles_near_the_end_of_an_interval_are_exact() {
    let seed = 2013;
    let mut rng = Rng::new(seed);
    let power = |rng: &mut Rng, low: f32, high: f32| 10f32.powf(rng.range(low, high));
    let mut moved = 0;
    for _ in 0..300 {
        // Along an axis, so that the box is as thin as the needle.
        let (axis, start) = (rng.below(3), rng.point(1.0));
        let mut corners = [start; 3];
        corners[1][axis] += rng.range(0.2, 2.0);
        corners[2][(axis + 1) % 3] += power(&mut rng, -7.0, -4.0);
        let positions = corners.to_vec();
        let geometries = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
        let brute = Brute::new(&Primitives::new(&geometries).expect("one triangle"));
        let mut rays = Vec::new();
        for _ in 0..400 {
            let (u, v) = (rng.unit(), rng.unit());
            let along: [f32; 3] = core::array::from_fn(|a| {
                let [p, q, r] = [corners[0][a], corners[1][a], corners[2][a]];
                let (v, w) = (v * (1.0 - u), (1.0 - u) * (1.0 - v));
                u * q + v * r + w * p
            });
            let org = rng.point(3.0);
            let ray = Ray::new(org, core::array::from_fn(|a| along[a] - org[a]));
            let Some(hit) = brute.intersect(&ray) else {
                continue;
            };
            let near = hit.t * (1.0 + power(&mut rng, -7.5, -0.5) * (2.0 * rng.unit() - 1.0));
            rays.push(Ray { tnear: near, ..ray });
            rays.push(Ray { tfar: near, ..ray });
            // The distance before it was clamped may be beyond `near`, the clamped one before it.
            moved += usize::from(hit.t < near);
        }
        let wanted: Vec<_> = rays.iter().map(|ray| brute.occluded(ray)).collect();
        let mut bvh = Bvh::build(&geometries, &Default::default()).expect("one triangle");
        for engine in engines_for(bvh.width()) {
            engine.run(&mut bvh).expect("its width");
            let mut found = vec![false; rays.len()];
            bvh.batch(&rays).occluded_into(&mut found);
            for (index, ray) in rays.iter().enumerate() {
                assert_eq!(
                    found[index], wanted[index],
                    "seed {seed}, {engine:?}: {corners:?} {ray:?}"
                );
            }
        }
    }
    assert!(moved > 1000, "only {moved} rays were near an end");
}

#[test]
fn levels_are_named() {
    for level in Level::ALL {
        match Isa::new(level) {
            Ok(_) => println!("{level}: run"),
            Err(reason) => println!("{level}: not run ({reason})"),
        }
    }
}

#[test]
fn bad_primitives_are_dropped_and_counted_and_the_rest_is_found() {
    let seed = 11;
    let mut rng = Rng::new(seed);
    let (mesh, bad) = mesh::spoiled(&mut rng, 300);
    let primitives = Primitives::new(&[geometry(&mesh)]).expect("indices in range");
    assert_eq!(primitives.dropped(), bad, "seed {seed}");
    assert_eq!(primitives.len(), 300 - bad);
    let rays = kernel_rays(&rays::around(&mut rng, &mesh, 300));
    check("spoiled", &[geometry(&mesh)], &rays);

    let spheres = [
        Sphere {
            center: [0.0; 3],
            radius: 0.0,
        },
        Sphere {
            center: [0.0; 3],
            radius: -1.0,
        },
        Sphere {
            center: [0.0; 3],
            radius: f32::NAN,
        },
        Sphere {
            center: [f32::INFINITY, 0.0, 0.0],
            radius: 1.0,
        },
        Sphere {
            center: [0.0; 3],
            radius: 1.0,
        },
    ];
    let primitives = Primitives::new(&[Geometry::spheres(&spheres[..])]).expect("no indices");
    assert_eq!((primitives.len(), primitives.dropped()), (1, 4));
}

#[test]
fn an_index_out_of_range_is_an_error_that_names_it() {
    let positions = [[0.0; 3]; 3];
    let error = Primitives::new(&[
        Geometry::triangles(&positions[..], vec![[0, 1, 2]]),
        Geometry::triangles(&positions[..], vec![[0, 1, 2], [0, 3, 1]]),
    ])
    .expect_err("vertex 3 of 3");
    assert_eq!(
        error.to_string(),
        "triangle 1 of geometry 1 uses vertex 3, but there are 3 vertices"
    );
}

#[test]
fn the_interval_is_open_and_improper_rays_miss() {
    let positions = [[-1.0, -1.0, 1.0], [3.0, -1.0, 1.0], [-1.0, 3.0, 1.0]];
    let geometries = [
        Geometry::triangles(&positions[..], vec![[0, 1, 2]]),
        Geometry::spheres(vec![Sphere {
            center: [10.0, 0.0, 3.0],
            radius: 1.0,
        }]),
    ];
    let base = Ray {
        org: [0.0; 3],
        dir: [0.0, 0.0, 1.0],
        tnear: 0.0,
        tfar: f32::INFINITY,
    };
    let sphere = Ray {
        org: [10.0, 0.0, 0.0],
        ..base
    };
    let nan = f32::NAN;
    let inf = f32::INFINITY;
    let cases = [
        (base, Some(1.0)),
        (
            Ray {
                dir: [0.0, 0.0, 2.5e38],
                ..base
            },
            Some(1.0 / 2.5e38),
        ),
        (
            Ray {
                dir: [1.25e38, 1.25e38, 2.5e38],
                ..base
            },
            Some(1.0 / 2.5e38),
        ),
        (
            Ray {
                dir: [0.0, 0.0, 1e-30],
                ..base
            },
            Some(1.0 / 1e-30),
        ),
        (
            Ray {
                dir: [0.0, 0.0, 1e-39],
                ..base
            },
            None,
        ),
        (Ray { tfar: 1.0, ..base }, None),
        (
            Ray {
                tfar: 1.0f32.next_up(),
                ..base
            },
            Some(1.0),
        ),
        (Ray { tnear: 1.0, ..base }, None),
        (
            Ray {
                tnear: 1.0f32.next_down(),
                ..base
            },
            Some(1.0),
        ),
        (
            Ray {
                dir: [0.0, 0.0, -1.0],
                ..base
            },
            None,
        ),
        (
            Ray {
                dir: [0.0, 0.0, -1.0],
                tnear: -2.0,
                ..base
            },
            Some(-1.0),
        ),
        (
            Ray {
                dir: [0.0, 0.0, 0.5],
                ..base
            },
            Some(2.0),
        ),
        (
            Ray {
                dir: [0.0, -0.0, 0.0],
                ..base
            },
            None,
        ),
        (
            Ray {
                dir: [0.0, nan, 1.0],
                ..base
            },
            None,
        ),
        (
            Ray {
                dir: [0.0, 0.0, inf],
                ..base
            },
            None,
        ),
        (
            Ray {
                org: [nan, 0.0, 0.0],
                ..base
            },
            None,
        ),
        (
            Ray {
                org: [0.0, inf, 0.0],
                ..base
            },
            None,
        ),
        (Ray { tnear: nan, ..base }, None),
        (Ray { tfar: nan, ..base }, None),
        (
            Ray {
                tnear: 5.0,
                tfar: 4.0,
                ..base
            },
            None,
        ),
        (sphere, Some(2.0)),
        (
            Ray {
                tnear: 2.0,
                ..sphere
            },
            Some(4.0),
        ),
        (
            Ray {
                tnear: 2.0,
                tfar: 4.0,
                ..sphere
            },
            None,
        ),
    ];
    let rays: Vec<_> = cases.iter().map(|(ray, _)| *ray).collect();
    check("interval", &geometries, &rays);
    let brute = Brute::new(&Primitives::new(&geometries).expect("indices in range"));
    for (ray, t) in cases {
        assert_eq!(brute.intersect(&ray).map(|hit| hit.t), t, "{ray:?}");
    }
}

#[test]
fn ties_go_to_the_smallest_ids() {
    let positions = [[-1.0, -1.0, 1.0], [3.0, -1.0, 1.0], [-1.0, 3.0, 1.0]];
    let same = vec![[0u32, 1, 2]; 100];
    let geometries = [
        Geometry::triangles(&positions[..], &same[..]),
        Geometry::triangles(&positions[..], &same[..]),
    ];
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    let primitives = Primitives::new(&geometries).expect("indices in range");
    for_every_tree(&primitives, &[ray], |bvh, tree| {
        let hit = bvh.intersect(&ray).expect("in front");
        assert_eq!((hit.geom_id, hit.prim_id), (0, 0), "{tree}");
    });
}

#[test]
fn barycentrics_give_the_point_and_distances_agree_with_double_precision() {
    let seed = 5;
    let mut rng = Rng::new(seed);
    let mesh = mesh::soup(&mut rng, 200);
    let brute = Brute::new(&Primitives::new(&[geometry(&mesh)]).expect("indices in range"));
    let mut found = 0;
    for _ in 0..2000 {
        let ray = Ray::new(rng.point(2.0), rng.direction());
        let Some(hit) = brute.intersect(&ray) else {
            continue;
        };
        found += 1;
        let [a, b, c] = mesh.triangle(hit.prim_id as usize);
        for axis in 0..3 {
            let by_weights = f64::from(a[axis])
                + f64::from(hit.u) * (f64::from(b[axis]) - f64::from(a[axis]))
                + f64::from(hit.v) * (f64::from(c[axis]) - f64::from(a[axis]));
            let by_distance =
                f64::from(ray.org[axis]) + f64::from(hit.t) * f64::from(ray.dir[axis]);
            assert!(
                (by_weights - by_distance).abs() < 2e-4,
                "seed {seed} {ray:?} {hit:?}"
            );
        }
    }
    assert!(found > 200, "only {found} hits");
}
