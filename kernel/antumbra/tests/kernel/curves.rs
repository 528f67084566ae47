//! Curves: every tree against brute force, and brute force against what is known on paper.

use antumbra::shapes::{CurveBasis, Curves, DropReason, Dropped, Sphere};
use antumbra::{
    Brute, Bvh, Error, Geometry, Instance, Object, PrimId, Primitives, Ray, Recipe, World,
};
use antumbra_testkit::{Rng, mesh, rays};
use proptest::prelude::*;

use crate::support::{
    bits, config, equals_brute, equals_brute_by_builders, for_every_tree, geometry, kernel_rays,
};
use crate::transforms::{transform, translation};

/// Chains of a few segments around the origin: thick and thin, with tips, points that coincide, and a few unsound ones.
fn curves(rng: &mut Rng, count: usize) -> Curves<'static> {
    let mut points: Vec<[f32; 4]> = Vec::new();
    let mut segments = Vec::new();
    while segments.len() < count {
        let mut at = rng.point(1.0);
        for step in 0..2 + rng.below(5) {
            if step > 0 {
                segments.push(points.len() as u32 - 1);
            }
            let [x, y, z] = at;
            let mut point = [x, y, z, 0.2 * rng.unit() * rng.unit()];
            match rng.below(16) {
                0 => point[3] = 0.0,
                1 => point[3] = 3.0,
                2 => point[3] = [-1.0, f32::NAN, f32::INFINITY, -0.0][rng.below(4)],
                3 => point[rng.below(3)] = f32::NAN,
                4 => point = points.last().copied().unwrap_or(point),
                _ => {}
            }
            points.push(point);
            let way = rng.direction();
            at = [0, 1, 2].map(|axis| at[axis] + 0.4 * rng.unit() * way[axis]);
        }
    }
    Curves::new(points, segments)
}

/// Rays around the curves, some of them through their points, along their segments and from their axes.
fn rays_around(rng: &mut Rng, curves: &Curves<'_>, count: usize) -> Vec<Ray> {
    let soup = mesh::soup(rng, 30);
    let mut rays = kernel_rays(&rays::around(rng, &soup, count));
    for &first in curves.segments.iter() {
        let [a, b] = [first, first + 1].map(|index| curves.points[index as usize]);
        if !a.iter().chain(&b).all(|x| x.is_finite()) {
            continue;
        }
        let share = rng.unit();
        let on_axis = [0, 1, 2].map(|axis| a[axis] + share * (b[axis] - a[axis]));
        let along = [0, 1, 2].map(|axis| b[axis] - a[axis]);
        let from = rng.point(2.0);
        rays.push(Ray::between(from, on_axis));
        rays.push(Ray::new(from, [0, 1, 2].map(|axis| b[axis] - from[axis])));
        rays.push(Ray::new(on_axis, rng.direction()));
        if along != [0.0; 3] {
            rays.push(Ray::new(on_axis, along));
            rays.push(Ray::new([0, 1, 2].map(|axis| a[axis] - along[axis]), along));
        }
    }
    rays
}

proptest! {
    #![proptest_config(config(4))]

    /// Among triangles and spheres, in the world and in instances of any transform, by every query.
    #[test]
    fn every_tree_equals_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        let size = 1 + rng.below(60);
        let thin = curves(&mut rng, size);
        let any = mesh::soup(&mut rng, 20);
        let spheres: Vec<_> = (0..5).map(|_| Sphere { center: rng.point(1.0), radius: 0.2 }).collect();
        let world = [Geometry::curves(thin.clone()), geometry(&any), Geometry::spheres(&spheres[..])];
        let object = [Geometry::spheres(&spheres[..]), Geometry::curves(thin.clone())];
        let instances: Vec<_> = (0..rng.below(4))
            .map(|_| Instance::new(0, transform(&mut rng)))
            .collect();
        let world = &world[..1 + rng.below(3)];
        let primitives = Primitives::with_instances(world, &[object], &instances).expect("in range");
        let rays = rays_around(&mut rng, &thin, 60);
        equals_brute(&format!("seed {seed}"), &primitives, &rays);
        let brute = Brute::new(&primitives);
        let points: Vec<_> = (0..4).map(|_| rng.point(1.5)).collect();
        for_every_tree(&primitives, &[], |bvh, tree| {
            let place = format!("seed {seed}, {tree}");
            for ray in rays.iter().step_by(7) {
                let Some(hit) = brute.intersect(ray) else { continue };
                let id = PrimId::from(hit);
                assert_eq!(bvh.query(ray).except(id).occluded(), brute.query(ray).except(id).occluded(), "{place}");
                let except = brute.query(ray).except(id).intersect();
                assert_eq!(bits(bvh.query(ray).except(id).intersect()), bits(except), "{place}");
                assert!(!bvh.query(ray).filter(&|_| false).occluded(), "{place}");
            }
            for &point in &points {
                let near = brute.closest(point, f32::INFINITY);
                assert_eq!(bvh.closest(point, f32::INFINITY), near, "{place}");
                assert_eq!(bvh.within(point, 0.5), brute.within(point, 0.5), "{place}");
                assert_eq!(bvh.winding_number(point), brute.winding_number(point), "{place}");
            }
        });
    }

    /// By every builder and collapse; in files; after a refit.
    #[test]
    fn builders_files_and_refits(seed: u64) {
        let mut rng = Rng::new(seed);
        let thin = curves(&mut rng, 40);
        let before = [Geometry::curves(thin.clone())];
        let primitives = Primitives::new(&before).expect("in range");
        let rays = rays_around(&mut rng, &thin, 60);
        equals_brute_by_builders(&format!("seed {seed}"), &primitives, &rays);

        let mut bvh = Bvh::build(&before, &Recipe::default()).expect("in range");
        let bytes = bvh.to_bytes();
        let read = Bvh::from_bytes(&bytes).expect("a file of ours");
        prop_assert_eq!(&read.to_bytes(), &bytes);

        let moved: Vec<_> = thin.points.iter().map(|[x, y, z, r]| [3.0 * x, 2.0 * y, *z, 0.5 * r]).collect();
        let after = [Geometry::curves(Curves::new(moved, &thin.segments[..]))];
        bvh.refit(&after).expect("as sound as before");
        bvh.validate().expect("a refit keeps all promises");
        let again = Brute::new(&Primitives::new(&after).expect("in range"));
        let first = Brute::new(&primitives);
        for ray in &rays {
            prop_assert_eq!(bits(read.intersect(ray)), bits(first.intersect(ray)));
            prop_assert_eq!(bits(bvh.intersect(ray)), bits(again.intersect(ray)));
        }
    }

    /// The rule as the documentation of [`Curves`] gives it, worked out in a frame around the ray.
    #[test]
    fn hits_follow_the_rule(seed: u64) {
        let mut rng = Rng::new(seed);
        for _ in 0..200 {
            let points: Vec<_> = (0..3).map(|_| {
                let [x, y, z] = rng.point(1.0);
                [x, y, z, 0.5 * rng.unit()]
            }).collect();
            let bvh = Bvh::build(&[Geometry::curves(Curves::chain(points.clone()))], &Recipe::default()).expect("a chain");
            let ray = Ray::new(rng.point(1.0), rng.direction());
            let hits: Vec<_> = bvh.query(&ray).all_hits();
            let [first, second] = frame(ray.dir);
            for segment in 0..2usize {
                let [a, b] = [segment, segment + 1].map(|end| {
                    let to: Vec<f64> = (0..3).map(|axis| f64::from(points[end][axis]) - f64::from(ray.org[axis])).collect();
                    let along = |axis: [f64; 3]| -> f64 { to.iter().zip(axis).map(|(x, y)| x * y).sum() };
                    [along(first), along(second), along(ray.dir.map(f64::from)), f64::from(points[end][3])]
                });
                // The nearest of many points.
                let at = |share: f64| [0, 1, 2, 3].map(|i| (1.0 - share) * a[i] + share * b[i]);
                let distance = |share: f64| { let [x, y, ..] = at(share); x.hypot(y) };
                let square = (b[0] - a[0]).powi(2) + (b[1] - a[1]).powi(2);
                let foot = -(a[0] * (b[0] - a[0]) + a[1] * (b[1] - a[1])) / square;
                let cut = (segment == 0 && foot < 0.0) || (segment == 1 && foot > 1.0);
                let share = foot.clamp(0.0, 1.0);
                for step in 0..=20 {
                    prop_assert!(distance(share) <= distance(f64::from(step) / 20.0) + 1e-9);
                }
                let [_, _, t, radius] = at(share);
                let slack = (distance(share) - radius).abs() < 1e-5 || foot.abs() < 1e-5 || (foot - 1.0).abs() < 1e-5 || t.abs() < 1e-5;
                if slack || square < 1e-6 {
                    continue;
                }
                let expected = !cut && distance(share) < radius && t > 0.0;
                let found = hits.iter().find(|hit| hit.prim_id == segment as u32);
                prop_assert_eq!(found.is_some(), expected, "{:?} {:?} {}", points, ray, segment);
                if let Some(hit) = found {
                    prop_assert!((f64::from(hit.t) - t).abs() < 1e-4, "{} {}", hit.t, t);
                    prop_assert!((f64::from(hit.u) - share).abs() < 1e-4);
                    // Across the axis, also at a joint.
                    let side = (f64::from(hit.v) - 0.5).abs();
                    prop_assert!((side - 0.5 * distance(foot) / radius).abs() < 1e-4);
                }
            }
        }
    }
}

/// Two directions that are perpendicular to one of unit length, and to each other.
fn frame(dir: [f32; 3]) -> [[f64; 3]; 2] {
    let d = dir.map(f64::from);
    let other = if d[0].abs() < 0.5 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let first = cross(d, other);
    let length = first.iter().map(|x| x * x).sum::<f64>().sqrt();
    let first = first.map(|x| x / length);
    [first, cross(d, first)]
}

/// Numbers that can be worked out by hand.
#[test]
fn hits_are_where_they_are_on_paper() {
    // Along y, then along x; a tip at the end.
    let points = vec![
        [0.0, 0.0, 1.0, 0.25],
        [0.0, 1.0, 1.0, 0.25],
        [2.0, 1.0, 1.0, 0.0],
    ];
    let bvh = Bvh::build(
        &[Geometry::curves(Curves::chain(points))],
        &Recipe::default(),
    )
    .expect("two segments");
    let up = |x: f32, y: f32| Ray::new([x, y, 0.0], [0.0, 0.0, 1.0]);
    let hit = bvh.intersect(&up(0.125, 0.5)).expect("inside");
    assert_eq!((hit.t, hit.u, hit.prim_id, hit.geom_id), (1.0, 0.5, 0, 0));
    let right = bvh.intersect(&up(-0.125, 0.5)).expect("inside");
    assert_eq!(
        (hit.v, right.v),
        (0.75, 0.25),
        "up is +y, and who looks towards +z has +x on the left"
    );
    assert_eq!(
        bvh.intersect(&up(0.25, 0.5)).map(|hit| hit.v),
        Some(1.0),
        "the edge belongs to the curve"
    );
    assert!(!bvh.occluded(&up(0.25f32.next_up(), 0.5)));
    // The beginning is flat, the joint round.
    assert!(bvh.occluded(&up(0.2, 0.0)) && !bvh.occluded(&up(0.0, -0.01)));
    assert!(bvh.occluded(&up(-0.15, 1.15)) && !bvh.occluded(&up(-0.2, 1.2)));
    // Half of the radius half way, nothing at the tip.
    assert!(bvh.occluded(&up(1.0, 1.125)) && !bvh.occluded(&up(1.0, 1.126)));
    assert!(bvh.occluded(&up(1.99, 1.0)) && !bvh.occluded(&up(2.01, 1.0)));
    // Seen from its end, and from either side: curves face the ray.
    let along = Ray::new([0.1, -1.0, 1.1], [0.0, 1.0, 0.0]);
    assert_eq!(
        bvh.intersect(&along).map(|hit| (hit.t, hit.prim_id)),
        Some((1.0, 0))
    );
    let down = Ray::new([0.1, 0.5, 5.0], [0.0, 0.0, -2.0]);
    assert_eq!(bvh.intersect(&down).map(|hit| hit.t), Some(2.0));
    let normal = |ray: &Ray| bvh.normal(ray, &bvh.intersect(ray).expect("a hit"));
    assert_eq!(normal(&down), Some([0.0, 0.0, 1.0]));
    assert_eq!(normal(&up(0.1, 0.5)), Some([0.0, 0.0, -1.0]));
    assert_eq!(normal(&along), Some([0.0, -1.0, 0.0]));
    // The interval is open.
    let until = |tfar| Ray {
        tfar,
        ..up(0.0, 0.5)
    };
    assert!(!bvh.occluded(&until(1.0)) && bvh.occluded(&until(1.0f32.next_up())));
    // Nearest points are on the axis, which has no inside.
    let near = bvh.closest([0.0, 0.5, 3.0], 9.0).expect("near enough");
    assert_eq!((near.distance, near.position), (2.0, [0.0, 0.5, 1.0]));
    assert!(!bvh.contains([0.0, 0.5, 1.0]));
}

/// Whatever a ray passes within the radius of a joint occludes it, however the curve bends there.
#[test]
fn joints_have_no_gaps() {
    let mut rng = Rng::new(17);
    for _ in 0..2000 {
        let radius = 0.01 + 0.1 * rng.unit();
        let points: Vec<_> = (0..3)
            .map(|_| {
                let [x, y, z] = rng.point(1.0);
                [x, y, z, radius]
            })
            .collect();
        let bvh = Bvh::build(
            &[Geometry::curves(Curves::chain(points.clone()))],
            &Recipe::default(),
        )
        .expect("a chain");
        let [x, y, z, _] = points[1];
        let dir = rng.direction();
        let [first, second] = frame(dir);
        let (distance, angle) = (
            f64::from(0.999 * radius * rng.unit()),
            f64::from(7.0 * rng.unit()),
        );
        let (sin, cos) = angle.sin_cos();
        let org = [0, 1, 2].map(|axis| {
            let off = distance * (cos * first[axis] + sin * second[axis]);
            (f64::from([x, y, z][axis]) + off - 4.0 * f64::from(dir[axis])) as f32
        });
        assert!(bvh.occluded(&Ray::new(org, dir)), "{points:?}");
    }
}

/// Points of the cubic are no farther from its segments than promised, chains are joined, and the parameter is right.
#[test]
fn cubics_are_within_the_tolerance() {
    let mut rng = Rng::new(5);
    for basis in [
        CurveBasis::Bezier,
        CurveBasis::BSpline,
        CurveBasis::CatmullRom,
    ] {
        for tolerance in [0.5, 0.1, 0.02] {
            let control: Vec<_> = (0..7)
                .map(|_| {
                    let [x, y, z] = rng.point(1.0);
                    [x, y, z, 0.1 + 0.1 * rng.unit()]
                })
                .collect();
            let first = if basis == CurveBasis::Bezier {
                vec![0, 3]
            } else {
                vec![0, 1, 2, 3]
            };
            let cubic = Curves::cubic(&control, &first, basis, tolerance).expect("points");
            assert_eq!(cubic.parts.len(), cubic.curves.segments.len());
            let count = cubic.curves.segments.len() as u32;
            assert_eq!(
                *cubic.curves.segments,
                (0..count).collect::<Vec<_>>(),
                "one chain"
            );
            let bound = f64::from(tolerance) * 0.2;
            for (segment, &(curve, [from, to])) in cubic.parts.iter().enumerate() {
                let [a, b] =
                    [segment, segment + 1].map(|index| cubic.curves.points[index].map(f64::from));
                for step in 0..=8 {
                    let share = f64::from(step) / 8.0;
                    let u = f64::from(from) + share * f64::from(to - from);
                    let exact = on_cubic(basis, &control[first[curve as usize] as usize..], u);
                    let chord = [0, 1, 2, 3].map(|i| (1.0 - share) * a[i] + share * b[i]);
                    let off = (0..3)
                        .map(|i| (exact[i] - chord[i]).powi(2))
                        .sum::<f64>()
                        .sqrt();
                    assert!(
                        off <= bound + 1e-6 && (exact[3] - chord[3]).abs() <= bound + 1e-6,
                        "{basis:?} {off}"
                    );
                }
            }
        }
    }
    let nothing = Curves::cubic(&[[0.0; 4]; 3], &[0], CurveBasis::Bezier, 0.1);
    assert!(nothing.is_none() && Curves::cubic(&[], &[], CurveBasis::Bezier, 0.0).is_none());
    let nan =
        Curves::cubic(&[[f32::NAN; 4]; 4], &[0], CurveBasis::BSpline, 0.1).expect("four points");
    assert_eq!(nan.parts.len(), 1);
}

/// A point of a cubic by the weights of its basis.
fn on_cubic(basis: CurveBasis, control: &[[f32; 4]], u: f64) -> [f64; 4] {
    let v = 1.0 - u;
    let weights = match basis {
        CurveBasis::Bezier => [v * v * v, 3.0 * u * v * v, 3.0 * u * u * v, u * u * u],
        CurveBasis::BSpline => [
            v * v * v / 6.0,
            (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
            (-3.0 * u * u * u + 3.0 * u * u + 3.0 * u + 1.0) / 6.0,
            u * u * u / 6.0,
        ],
        CurveBasis::CatmullRom => [
            0.5 * (-u * u * u + 2.0 * u * u - u),
            0.5 * (3.0 * u * u * u - 5.0 * u * u + 2.0),
            0.5 * (-3.0 * u * u * u + 4.0 * u * u + u),
            0.5 * (u * u * u - u * u),
        ],
    };
    [0, 1, 2, 3].map(|i| (0..4).map(|k| weights[k] * f64::from(control[k][i])).sum())
}

#[test]
fn unsound_segments_are_dropped_and_named() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let good = [[0.0, 0.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.0]];
    let pairs = [
        good,
        [[nan, 0.0, 0.0, 0.1], good[1]],
        [[0.0, 0.0, 0.0, nan], good[1]],
        [[0.0, 0.0, 0.0, inf], good[1]],
        [[0.0, 0.0, 0.0, -0.1], good[1]],
        [good[1], [2.0, 0.0, 0.0, 0.0]],
        [good[0], good[0]],
        [[f32::MAX, 0.0, 0.0, f32::MAX], good[1]],
    ];
    let segments: Vec<u32> = (0..pairs.len() as u32).map(|pair| 2 * pair).collect();
    let curves = Curves::new(pairs.concat(), segments);
    let primitives = Primitives::new(&[Geometry::curves(curves)]).expect("in range");
    let reasons: Vec<_> = primitives
        .dropped_list()
        .iter()
        .map(|dropped| match dropped {
            Dropped::Primitive {
                prim_id, reason, ..
            } => (*prim_id, *reason),
            other => panic!("{other:?}"),
        })
        .collect();
    let expected = [
        (1, DropReason::NotFinite),
        (2, DropReason::NotFinite),
        (3, DropReason::NotFinite),
        (4, DropReason::NoRadius),
        (5, DropReason::NoRadius),
        (6, DropReason::CornersCoincide),
        (7, DropReason::NotFinite),
    ];
    assert_eq!(reasons, expected);
    // The second point counts as well.
    let short = Curves::new(good.to_vec(), vec![0, 1]);
    let error =
        Bvh::build(&[Geometry::curves(short)], &Recipe::default()).expect_err("one point too few");
    assert!(
        matches!(
            error,
            Error::IndexOutOfRange {
                geom_id: 0,
                prim_id: 1,
                index: 2,
                vertices: 2
            }
        ),
        "{error}"
    );
}

/// Objects of curves move in a world.
#[test]
fn worlds_hold_curves() {
    let chain = Curves::chain(vec![[0.0, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0, 0.1]]);
    let object = Object::build(&[Geometry::curves(chain)], &Recipe::default()).expect("an object");
    let place = |x| Instance::new(0, translation([x, 0.0, 0.0]));
    let world = World::new(&[object], &[place(0.0), place(5.0)]).expect("an object that is there");
    let ray = |x: f32| Ray::new([x, 0.5, 3.0], [0.0, 0.0, -1.0]);
    assert_eq!(world.intersect(&ray(5.05)).map(|hit| hit.inst_id), Some(1));
    assert!(!world.occluded(&ray(2.0)));
}
