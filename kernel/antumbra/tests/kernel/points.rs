//! Queries about points: every tree against brute force, and brute force against what is known.

use crate::instances::Scene;
use crate::support::{TWICE, config, for_every_tree, geometry};
use crate::transforms::{Transform, rotation, transform};
use antumbra::recipe::Builder;
use antumbra::shapes::Sphere;
use antumbra::{
    Brute, Bvh, ClosestPoint, Geometry, INVALID_ID, Instance, Primitives, Recipe, World,
};
use antumbra_testkit::{Mesh, Rng, mesh};
use proptest::prelude::*;

/// Everything by its bits.
fn bits(near: &ClosestPoint) -> [u32; 9] {
    let [x, y, z] = near.position.map(f32::to_bits);
    let [distance, u, v] = [near.distance, near.u, near.v].map(f32::to_bits);
    [
        distance,
        x,
        y,
        z,
        u,
        v,
        near.inst_id,
        near.geom_id,
        near.prim_id,
    ]
}

/// Points near and far, some of them on primitives, some where or nearly where the one before is.
fn points(rng: &mut Rng, brute: &Brute, count: usize) -> Vec<[f32; 3]> {
    let mut last = [0.0; 3];
    (0..count)
        .map(|index| {
            let size = [0.5, 2.0, 5.0, 100.0][index % 4];
            let point = rng.point(size);
            let size = [0.0, 1e-6, 0.01][rng.below(3)];
            let step = rng.point(size);
            last = match brute.closest(point, f32::INFINITY) {
                Some(near) if index % 3 == 0 => near.position,
                _ if index % 3 == 1 => core::array::from_fn(|axis| last[axis] + step[axis]),
                _ => point,
            };
            last
        })
        .collect()
}

/// Asserts that a tree answers as brute force does, one by one and in batches.
fn check(bvh: &Bvh, brute: &Brute, points: &[[f32; 3]], rng: &mut Rng, place: &str) {
    // One for all, or one for each.
    let same = rng.below(3);
    let mut each = |list: [f32; 5]| -> Vec<f32> {
        let value = |_| match same {
            0 => list[0],
            _ => list[rng.below(5)],
        };
        points.iter().map(value).collect()
    };
    let limits = each([f32::INFINITY, 1.0, 0.05, 0.0, f32::NAN]);
    let radii = each([1.0, 0.1, 8.0, 0.0, -1.0]);
    let together = bvh.points(points);
    let (closest, within) = if same == 0 {
        (together.closest(), together.within(1.0).all())
    } else {
        let closest = together.within(&limits).closest();
        (closest, together.within(&radii).all())
    };
    // No limit counts for these.
    let inside = together.within(&radii).inside();
    let signed = together.within(&limits).signed_distances();
    for (index, &point) in points.iter().enumerate() {
        let (limit, radius) = (limits[index], radii[index]);
        let place = format!("{place}, {point:?}");
        let offsets = [bvh.origin_offset(point), brute.origin_offset(point)];
        assert_eq!(offsets[0].to_bits(), offsets[1].to_bits(), "{place}");
        let one = bvh.closest(point, limit);
        assert_eq!(one.as_ref().map(bits), closest[index].as_ref().map(bits));
        let distance = brute.signed_distance(point).to_bits();
        assert_eq!(signed[index].to_bits(), distance, "{place}");
        assert_eq!(bvh.signed_distance(point).to_bits(), distance, "{place}");
        let expected = brute.closest(point, limit);
        assert_eq!(
            closest[index].as_ref().map(bits),
            expected.as_ref().map(bits),
            "{place} up to {limit}"
        );
        let expected: Vec<_> = brute.within(point, radius).iter().map(bits).collect();
        let found: Vec<_> = within[index].iter().map(bits).collect();
        assert_eq!(found, expected, "{place} within {radius}");
        assert_eq!(
            bvh.winding_number(point),
            brute.winding_number(point),
            "{place}"
        );
        assert_eq!(inside[index], brute.contains(point), "{place}");
    }
}

proptest! {
    #![proptest_config(config(4))]

    /// Triangles and spheres in the world and in instances of any transform.
    #[test]
    fn every_tree_equals_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        let scene = Scene::new(&mut rng, 60, 12);
        let primitives = scene.primitives();
        let brute = Brute::new(&primitives);
        let points = points(&mut rng, &brute, 12);
        for_every_tree(&primitives, &[], |bvh, tree| {
            check(bvh, &brute, &points, &mut rng, &format!("seed {seed}, {tree}"));
        });
    }
}

proptest! {
    #![proptest_config(config(40))]

    /// Worlds are trees like others.
    #[test]
    fn worlds_equal_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        let scene = Scene::new(&mut rng, 100, 40);
        let recipe = Recipe::default();
        let build = |list: &[Geometry<'_>]| antumbra::Object::build(list, &recipe).expect("in range");
        let objects: Vec<_> = scene.object_lists().iter().map(|list| build(list)).collect();
        let world = World::on_ground(build(&scene.ground()), &objects, &scene.instances).expect("in range");
        let brute = Brute::new(&scene.primitives());
        let points = points(&mut rng, &brute, 40);
        check(&world, &brute, &points, &mut rng, &format!("seed {seed}"));
    }
}

/// In an instance, everything is measured in the world.
#[test]
fn distances_are_those_of_the_world() {
    let mut rng = Rng::new(3001);
    let ball = mesh::icosphere(1);
    let place = |transform: &Transform, point: [f32; 3]| {
        let [x, y, z] = point.map(f64::from);
        transform.map(|[a, b, c, d]| {
            (f64::from(a) * x + f64::from(b) * y + f64::from(c) * z + f64::from(d)) as f32
        })
    };
    for _ in 0..50 {
        let transform = transform(&mut rng);
        let instance = Instance::new(0, transform);
        let list = [geometry(&ball)];
        let placed = Primitives::with_instances(&[], &[&list], &[instance]).expect("in range");
        if placed.instances() == 0 {
            continue;
        }
        let bvh = Bvh::build(&placed, &Recipe::default()).expect("a tree");
        let flat = ball.map("placed", |position| place(&transform, position));
        let flat = Bvh::build(&[geometry(&flat)], &Recipe::default()).expect("in range");
        let size = flat.bounds().reach();
        for _ in 0..20 {
            let point = rng.point(2.0 * size);
            let near = bvh.closest(point, f32::INFINITY).expect("something");
            let other = flat.closest(point, f32::INFINITY).expect("something");
            assert!(
                (near.distance - other.distance).abs() <= 1e-5 * size,
                "{near:?} {other:?}"
            );
            assert_eq!((near.inst_id, other.inst_id), (0, INVALID_ID));
        }
    }
}

/// A ball whose triangles are counterclockwise from outside.
fn ball() -> Mesh {
    let mut ball = mesh::icosphere(3);
    for index in 0..ball.indices.len() {
        let [a, b, c] = ball.triangle(index);
        let [[x, y, z], [u, v, w]] =
            [b, c].map(|to| core::array::from_fn(|axis| to[axis] - a[axis]));
        let normal = [y * w - z * v, z * u - x * w, x * v - y * u];
        if (0..3).map(|axis| normal[axis] * a[axis]).sum::<f32>() < 0.0 {
            ball.indices[index].reverse();
        }
    }
    ball
}

/// Closed meshes and spheres, one in another, along half-lines through all their corners.
#[test]
fn closed_bodies_contain_what_is_inside() {
    let mut rng = Rng::new(3002);
    let ball = ball();
    // Its triangles run one way or the other.
    let mixed = mesh::icosphere(3);
    let hollow = ball.map("hollow", |position| position.map(|x| 0.5 * x));
    let mut inside_out = hollow.clone();
    for triangle in &mut inside_out.indices {
        triangle.reverse();
    }
    let mut shell = ball.clone();
    let first = shell.positions.len() as u32;
    shell.positions.extend(&hollow.positions);
    let hollow_indices = hollow.indices.iter();
    shell
        .indices
        .extend(hollow_indices.map(|triangle| triangle.map(|corner| first + corner)));
    let core = Geometry::spheres(vec![Sphere {
        center: [0.0; 3],
        radius: 0.5,
    }]);
    let length = |[x, y, z]: [f32; 3]| (x * x + y * y + z * z).sqrt();
    let filled = [true, true, false];
    for (list, windings, inside) in [
        (vec![geometry(&ball)], Some([1, 1, 0]), filled),
        (vec![geometry(&mixed)], None, filled),
        (
            vec![geometry(&ball), geometry(&hollow)],
            Some([2, 1, 0]),
            filled,
        ),
        (
            vec![geometry(&ball), geometry(&inside_out)],
            Some([0, 1, 0]),
            filled,
        ),
        (
            vec![geometry(&shell)],
            Some([2, 1, 0]),
            [false, true, false],
        ),
        (vec![geometry(&ball), core], Some([2, 1, 0]), filled),
    ] {
        for builder in [Builder::Reinsertion, TWICE] {
            let recipe = Recipe::default().builder(builder);
            let bvh = Bvh::build(&list, &recipe).expect("in range");
            let corners = ball.positions.iter().map(|position| {
                let [x, y, z] = *position;
                [x - 0.7, y, z]
            });
            let others = (0..3000).map(|_| rng.point(1.3)).collect::<Vec<_>>();
            for point in corners.chain(others) {
                let shell = match length(point) {
                    ..0.48 => 0,
                    0.501..0.98 => 1,
                    1.001.. => 2,
                    _ => continue,
                };
                assert_eq!(bvh.contains(point), inside[shell], "{builder} {point:?}");
                let winding = bvh.winding_number(point);
                match windings {
                    Some(windings) => assert_eq!(winding, windings[shell], "{builder} {point:?}"),
                    None => assert_eq!(winding % 2 != 0, inside[shell], "{builder} {point:?}"),
                }
            }
        }
    }
    // A mirror turns a body inside out.
    let mut turned = rotation(&mut rng);
    turned[0] = turned[0].map(|x| -x);
    let list = [geometry(&ball)];
    let instance = Instance::new(0, turned);
    let placed = Primitives::with_instances(&[], &[&list], &[instance]).expect("in range");
    let bvh = Bvh::build(&placed, &Recipe::default()).expect("a tree");
    for _ in 0..500 {
        let point = rng.point(1.2);
        let length = length(point);
        if !(0.98..=1.001).contains(&length) {
            let expected = if length < 1.0 { -1 } else { 0 };
            assert_eq!(bvh.winding_number(point), expected, "{point:?}");
            assert_eq!(bvh.contains(point), expected != 0, "{point:?}");
        }
    }
}

/// Points and distances that are no numbers find nothing, and distances are closed.
#[test]
fn bad_points_find_nothing() {
    let sphere = [Geometry::spheres(vec![Sphere {
        center: [0.0; 3],
        radius: 1.0,
    }])];
    let bvh = Bvh::build(&sphere, &Recipe::default()).expect("in range");
    let at = [3.0, 0.0, 0.0];
    assert!(bvh.closest(at, 2.0).is_some());
    assert!(bvh.closest(at, 2f32.next_down()).is_none());
    assert_eq!(
        bvh.closest([0.0; 3], 9.0).map(|near| near.distance),
        Some(1.0)
    );
    for point in [[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0]] {
        assert!(bvh.closest(point, f32::INFINITY).is_none());
        assert!(bvh.within(point, f32::INFINITY).is_empty());
        assert!(!bvh.contains(point));
    }
    for distance in [f32::NAN, -1.0] {
        assert!(bvh.closest(at, distance).is_none());
        assert!(bvh.within(at, distance).is_empty());
    }
    let empty = Bvh::build(&[], &Recipe::default()).expect("nothing is fine");
    assert!(empty.closest(at, f32::INFINITY).is_none());
    assert!(!empty.contains(at));
}

/// Distances of closed bodies have the sign of the side, and their magnitude is the one of the surface.
#[test]
fn signed_distances_are_negative_inside() {
    let mut rng = Rng::new(3003);
    let ball = ball();
    let spheres = vec![Sphere {
        center: [3.0, 0.0, 0.0],
        radius: 0.5,
    }];
    let list = [geometry(&ball), Geometry::spheres(spheres)];
    let bvh = Bvh::build(&list, &Recipe::default()).expect("in range");
    let mut inside = 0;
    for _ in 0..2000 {
        let [x, y, z] = rng.point(1.0);
        let [x, y, z] = [1.5 + 3.0 * x, y, z];
        let length = |x: f32| (x * x + y * y + z * z).sqrt();
        // The ball of triangles is a little smaller than a sphere.
        let expected = (length(x) - 1.0).min(length(x - 3.0) - 0.5);
        let distance = bvh.signed_distance([x, y, z]);
        assert!((distance - expected).abs() < 0.02, "{distance} {expected}");
        inside += usize::from(distance < 0.0);
    }
    assert!(inside > 100, "{inside}");
    let on_surface = bvh.signed_distance(ball.positions[0]);
    assert_eq!(on_surface.to_bits(), 0);
    assert!(bvh.signed_distance([f32::NAN, 0.0, 0.0]).is_nan());
    assert!(bvh.signed_distance([0.0, f32::INFINITY, 0.0]).is_nan());
    let empty = Bvh::build(&[], &Recipe::default()).expect("nothing is fine");
    assert_eq!(empty.signed_distance([0.0; 3]), f32::INFINITY);
}

/// Scenes so small or large that squares of their distances are beyond `f32`, and slivers, of which single precision makes
/// nothing.
#[test]
fn no_size_and_no_shape_is_missed() {
    let mut rng = Rng::new(3004);
    let soup = mesh::soup(&mut rng, 200);
    let needles = mesh::soup(&mut rng, 200).map("needles", |[x, y, z]| [x, 1e-6 * y, 1e-9 * z]);
    for mesh in [soup, needles] {
        for size in [
            1e-42, 1e-30, 1e-20, 1e-18, 1e-10, 1.0, 1e10, 1e17, 3e18, 1e19, 1e30,
        ] {
            let mesh = mesh.map("sized", |position| position.map(|x| size * x));
            let list = [geometry(&mesh)];
            let primitives = Primitives::new(&list).expect("in range");
            let brute = Brute::new(&primitives);
            let points: Vec<_> = (0..18)
                .map(|index| {
                    let point = rng.point(1.5).map(|x| size * x);
                    let near = brute.closest(point, f32::INFINITY);
                    match near {
                        Some(near) if index % 3 == 0 => near.position,
                        _ => point,
                    }
                })
                .collect();
            for_every_tree(&primitives, &[], |bvh, tree| {
                check(
                    bvh,
                    &brute,
                    &points,
                    &mut rng,
                    &format!("{tree}, size {size}"),
                );
            });
        }
    }
}

/// A distance for each point needs as many.
#[test]
#[should_panic(expected = "one distance per point")]
fn too_few_distances_are_refused() {
    let bvh = Bvh::build(&[], &Recipe::default()).expect("nothing is fine");
    let _ = bvh.points(&[[0.0; 3]; 2]).within(&[1.0][..]).closest();
}
