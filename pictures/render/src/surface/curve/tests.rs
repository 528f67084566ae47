//! Points of curves against the formulas of pbrt-v3, and rays that leave curves.

use std::sync::Arc;

use antumbra::{Bvh, Hit, INVALID_ID, Ray, Recipe};
use antumbra_scene::{CurveProfile, Curves, Geometry, Instance, Object, Scene, Shape};
use glam::{Affine3, DMat4, DVec2, DVec3, Quat, Vec2, Vec3};

use super::*;
use crate::material::Patch;
use crate::sampler::warp::uniform_sphere;
use crate::sampler::{Method, Sampler, Stream};
use crate::surface::Surface;
use crate::texture::Textures;
use crate::world::Lowered;

fn stream(number: u32) -> Stream {
    Sampler::new(Method::Independent, 5).stream(0, 0, number)
}

fn shape(curves: Curves, reverse: bool, swaps: bool) -> Shape {
    Shape {
        geometry: Geometry::Curves(Arc::new(curves)),
        material: 0,
        area_light: None,
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: reverse,
        transform_swaps_handedness: swaps,
    }
}

/// Shapes of a scene, and its tree.
fn traced(shapes: Vec<Shape>, objects: Vec<Object>, instances: Vec<Instance>) -> (Shapes, Bvh) {
    let scene = Scene {
        name: String::new(),
        shapes,
        objects,
        instances,
        materials: Vec::new(),
        media: Vec::new(),
        lights: Vec::new(),
        camera: Default::default(),
        film: Default::default(),
        sampler: Default::default(),
        integrator: Default::default(),
        accelerator: Default::default(),
        origin: Default::default(),
    };
    let (lowered, parts) = Lowered::with(&scene, &mut Textures::default());
    let primitives = Arc::new(lowered.primitives().expect("curves"));
    let build = antumbra::Build::new(&primitives)
        .recipe(&Recipe::default())
        .bvh();
    let bvh = build.expect("nobody stops it");
    let shapes = Shapes::new(&scene, &bvh.bounds(), parts);
    (shapes, bvh)
}

fn of_world(shape: Shape) -> (Shapes, Bvh) {
    traced(vec![shape], Vec::new(), Vec::new())
}

/// A bent curve of a changing radius.
fn bent(profile: CurveProfile) -> Curves {
    Curves {
        points: vec![
            [0.0, 0.0, 0.0, 0.05],
            [1.0, 0.2, 0.1, 0.04],
            [1.5, 1.0, 0.5, 0.03],
            [1.2, 2.0, 0.8, 0.02],
        ],
        first: vec![0],
        profile,
    }
}

/// A straight curve of a changing radius, which one segment replaces.
fn straight(profile: CurveProfile) -> Curves {
    let at = |share: f32, radius: f32| {
        let point = Vec3::new(-0.5, 0.3, 0.2).lerp(Vec3::new(1.0, 1.5, -0.6), share);
        point.extend(radius).to_array()
    };
    Curves {
        points: vec![
            at(0.0, 0.1),
            at(1.0 / 3.0, 0.09),
            at(2.0 / 3.0, 0.08),
            at(1.0, 0.07),
        ],
        first: vec![0],
        profile,
    }
}

/// A ray past a point of the curve, at most so many radii away from it.
fn ray_at(curves: &Curves, stream: &Stream, radii: f32) -> Ray {
    let axis = Axis::new(&curves.control(0), 0.02 + 0.96 * stream.uniform(1));
    let aside = uniform_sphere(stream.pair(2)) * (radii * axis.radius * stream.uniform(4));
    let dir = uniform_sphere(stream.pair(5));
    Ray::new(
        (axis.point + aside - dir * 3.0).to_array(),
        (dir * (0.5 + stream.uniform(7))).to_array(),
    )
}

/// What pbrt-v3 computes at the parameter `u` of a curve, in the frame of the ray: x, y, and z along the ray.
struct Reference {
    distance: f64,
    radius: f64,
    v: f64,
    point: DVec3,
    tangents: [DVec3; 2],
    normal: DVec3,
}

/// `Curve::recursiveIntersect`, computed independently and in double precision. `world` moves the curve of pbrt to the
/// world, where the ray is.
fn reference(curves: &Curves, world: &DMat4, ray: &Ray, u: f64, reverse: bool) -> Reference {
    let to_object = world.inverse();
    let org = to_object.transform_point3(Vec3::from(ray.org).as_dvec3());
    let dir = to_object.transform_vector3(Vec3::from(ray.dir).as_dvec3());
    let z = dir.normalize();
    let x = z.any_orthonormal_vector();
    let y = z.cross(x);
    let control = curves
        .control(0)
        .map(|p| DVec3::new(p[0].into(), p[1].into(), p[2].into()));
    let control = control.map(|p| to_object.transform_point3(p));
    let [a, b, c, d] = control;
    let bernstein = |t: f64| {
        let s = 1.0 - t;
        a * s * s * s + b * (3.0 * s * s * t) + c * (3.0 * s * t * t) + d * t * t * t
    };
    let derivative = {
        let s = 1.0 - u;
        ((b - a) * s * s + (c - b) * (2.0 * s * u) + (d - c) * u * u) * 3.0
    };
    let on_axis = bernstein(u);
    let flat = |v: DVec3| DVec2::new(v.dot(x), v.dot(y));
    let (pc, along) = (flat(on_axis - org), flat(derivative));
    let scale = world.transform_vector3(DVec3::X).length();
    let [first, last] = [0, 3].map(|i| f64::from(curves.points[i][3]) / scale);
    let width = 2.0 * (first + u * (last - first));
    let edge = along.x * -pc.y + pc.x * along.y;
    let side = pc.length() / width;
    let v = if edge > 0.0 { 0.5 + side } else { 0.5 - side };
    let across = DVec2::new(-along.y, along.x).normalize() * width;
    let mut dpdv = x * across.x + y * across.y;
    if curves.profile == CurveProfile::Round {
        let turn = -(v - 0.5) * std::f64::consts::PI;
        dpdv = glam::DQuat::from_axis_angle(derivative.normalize(), turn) * dpdv;
    }
    let swaps = world.determinant() < 0.0;
    let flip = if reverse != swaps { -1.0 } else { 1.0 };
    let normal = derivative.cross(dpdv) * flip;
    let point = org + z * (on_axis - org).dot(z);
    Reference {
        distance: pc.length() * scale,
        radius: 0.5 * width * scale,
        v,
        point: world.transform_point3(point),
        tangents: [derivative, dpdv].map(|v| world.transform_vector3(v)),
        normal: (world.inverse().transpose().transform_vector3(normal)).normalize(),
    }
}

/// Surface and patch at a hit.
fn at(shapes: &Shapes, ray: &Ray, hit: &Hit) -> (Surface, Patch) {
    let surface = Surface::found(shapes, ray, hit);
    let patch = Patch::at(shapes, &surface, hit, None);
    (surface, patch)
}

fn near(found: Vec3, expected: DVec3, tolerance: f64, what: &str) {
    let difference = (found.as_dvec3() - expected).length();
    let size = expected.length();
    assert!(difference <= tolerance * size, "{what}: {found} {expected}");
}

#[test]
fn points_have_the_formulas_of_pbrt() {
    let mirror = DMat4::from_scale(DVec3::new(-2.0, 2.0, 2.0));
    let turn = DMat4::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 1.3);
    let mut tried = 0;
    for profile in [CurveProfile::Flat, CurveProfile::Round] {
        for (curves, tolerance) in [(straight(profile), 2e-3), (bent(profile), 0.2)] {
            for (world, reverse) in [
                (DMat4::IDENTITY, false),
                (turn, true),
                (turn * mirror, false),
                (mirror, true),
            ] {
                let swaps = world.determinant() < 0.0;
                let (shapes, bvh) = of_world(shape(curves.clone(), reverse, swaps));
                for number in 0..2000 {
                    let ray = ray_at(&curves, &stream(number), 1.3);
                    let Some(hit) = bvh.intersect(&ray) else {
                        continue;
                    };
                    // Joints are round: v counts from the joint.
                    if hit.u == 0.0 || hit.u == 1.0 {
                        continue;
                    }
                    let (surface, patch) = at(&shapes, &ray, &hit);
                    let u = f64::from(patch.place.uv.x);
                    let expected = reference(&curves, &world, &ray, u, reverse);
                    let axis = Axis::new(&curves.control(0), u as f32);
                    // Along the curve, across is nowhere.
                    if axis.tangent.normalize().dot(surface.wo).abs() > 0.8 {
                        continue;
                    }
                    let what = format!("{profile:?} {number} {reverse} {swaps} {tolerance}");
                    let v = f64::from(patch.place.uv.y);
                    assert!(
                        (v - expected.v).abs() < tolerance,
                        "{what}: {v} {}",
                        expected.v
                    );
                    let off = (surface.point.as_dvec3() - expected.point).length();
                    // A curve is a tenth of its largest radius away from its segments, which are seen at a slant.
                    let bound = 4.0 * tolerance * f64::from(curves.points[0][3]);
                    assert!(off < bound, "{what}: {off}");
                    near(surface.normal, expected.normal, 4.0 * tolerance, &what);
                    near(patch.tangents[0], expected.tangents[0], 1e-4, &what);
                    near(
                        patch.tangents[1],
                        expected.tangents[1],
                        4.0 * tolerance,
                        &what,
                    );
                    near(surface.tangent(&shapes), expected.tangents[0], 0.1, &what);
                    assert_eq!(surface.shading_normal, surface.normal);
                    tried += 1;
                }
            }
        }
    }
    assert!(tried > 10_000, "{tried}");
}

/// What a ray sees of a curve is the strip whose edges are a radius away, within a twentieth of the width.
#[test]
fn outlines_are_a_radius_away() {
    let curves = bent(CurveProfile::Flat);
    let (_, bvh) = of_world(shape(curves.clone(), false, false));
    let (mut inside, mut outside) = (0, 0);
    for number in 0..4000 {
        let ray = ray_at(&curves, &stream(number), 2.5);
        // Nearest point as the ray sees it, away from the ends.
        let nearest = (1..2000)
            .map(|i| {
                let u = f64::from(i) / 2000.0;
                let found = reference(&curves, &DMat4::IDENTITY, &ray, u, false);
                (found.distance / found.radius, u)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("many");
        if !(0.01..0.99).contains(&nearest.1) {
            continue;
        }
        let axis = Axis::new(&curves.control(0), nearest.1 as f32);
        let margin = 0.01 + 0.1 * f64::from(curves.points[0][3] / axis.radius);
        match nearest.0 {
            x if x < 1.0 - margin => {
                assert!(bvh.occluded(&ray), "{number}: {nearest:?}");
                inside += 1;
            }
            x if x > 1.0 + margin => {
                assert!(!bvh.occluded(&ray), "{number}: {nearest:?}");
                outside += 1;
            }
            _ => {}
        }
    }
    assert!(inside > 1000 && outside > 100, "{inside} {outside}");
}

/// Few rays that leave a curve hit it again: only where it bends towards them or becomes wider. They begin within three radii
/// of their point.
#[test]
fn rays_leave_curves() {
    for profile in [CurveProfile::Flat, CurveProfile::Round] {
        for curves in [straight(profile), bent(profile)] {
            let (shapes, bvh) = of_world(shape(curves.clone(), false, false));
            let (mut again, mut count) = (0, 0);
            for number in 0..30_000 {
                let stream = stream(number);
                let ray = ray_at(&curves, &stream, 1.3);
                let Some(hit) = bvh.intersect(&ray) else {
                    continue;
                };
                let surface = Surface::found(&shapes, &ray, &hit);
                let leaving = surface.ray_along(uniform_sphere(stream.pair(20)));
                let moved = Vec3::from(leaving.org) - surface.point;
                let radius = curves.points[0][3];
                assert!(moved.length() < 3.0 * radius, "{number}: {moved}");
                again += u32::from(bvh.occluded(&leaving));
                count += 1;
            }
            assert!(
                count > 10_000 && 100 * again <= count,
                "{profile:?}: {again} of {count}"
            );
        }
    }
}

/// An instance shows its curves as if they were transformed, also in a mirror.
#[test]
fn instances_show_curves_transformed() {
    for scale in [Vec3::splat(1.5), Vec3::new(-1.5, 1.5, 1.5)] {
        let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.8, 0.0), 0.9);
        let place = Affine3::from_scale_rotation_translation(scale, turn, Vec3::new(1.0, 2.0, 0.5));
        let curves = straight(CurveProfile::Round);
        let original = shape(curves, true, false);
        let object = Object {
            name: String::new(),
            shapes: vec![original.clone()],
        };
        let instance = Instance {
            object: 0,
            world_from_object: place,
            end: None,
        };
        let (shapes, bvh) = traced(Vec::new(), vec![object], vec![instance]);
        let moved = original.transformed(&instance.matrix()).expect("curves");
        let Geometry::Curves(of_moved) = moved.geometry.clone() else {
            panic!("curves stay curves")
        };
        let (flat, of_flat) = of_world(moved);
        let mut count = 0;
        for number in 0..2000 {
            let ray = ray_at(&of_moved, &stream(number), 1.3);
            let (Some(hit), Some(other)) = (bvh.intersect(&ray), of_flat.intersect(&ray)) else {
                continue;
            };
            assert_ne!(hit.inst_id, INVALID_ID);
            let (surface, patch) = at(&shapes, &ray, &hit);
            let (expected, of_expected) = at(&flat, &ray, &other);
            assert!((surface.point - expected.point).length() < 1e-4, "{number}");
            assert!(
                (surface.normal - expected.normal).length() < 2e-2,
                "{number}"
            );
            assert!(
                (surface.distance - expected.distance).abs() < 1e-3,
                "{number}"
            );
            let uv: Vec2 = patch.place.uv - of_expected.place.uv;
            assert!(uv.length() < 1e-2, "{number}");
            count += 1;
        }
        assert!(count > 500, "{count}");
    }
}
