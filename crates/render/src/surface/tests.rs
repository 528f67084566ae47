//! Rays begin inside the closed bodies that they were in, however close to an edge they have hit.

use std::sync::Arc;

use antumbra::{Hit, INVALID_ID, Ray};
use antumbra_scene::{Geometry, Shape, TriangleMesh};
use glam::{DVec3, Quat, Vec3};

use super::{Frame, Shapes, Surface};
use crate::sampler::warp::cosine_hemisphere;
use crate::sampler::{Method, Sampler, Stream};

/// A convex body around 0.
struct Body {
    corners: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// Prism of length 1 along x over a convex polygon.
fn prism(polygon: &[[f32; 2]]) -> Body {
    let ring = |x: f32| polygon.iter().map(move |&[y, z]| Vec3::new(x, y, z));
    let corners = ring(-0.5).chain(ring(0.5)).collect();
    let n = polygon.len() as u32;
    let mut triangles = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
    }
    for i in 1..n - 1 {
        triangles.extend([[0, i, i + 1], [n, n + i, n + i + 1]]);
    }
    Body { corners, triangles }
}

fn bar(width: f32, height: f32) -> Body {
    let [y, z] = [width / 2.0, height / 2.0];
    prism(&[[-y, -z], [y, -z], [y, z], [-y, z]])
}

/// Prism over an isosceles triangle of this height, whose top has this angle in degrees.
fn wedge(height: f32, angle: f32) -> Body {
    let half = height * (angle / 2.0).to_radians().tan();
    let third = height / 3.0;
    prism(&[[-third, -half], [-third, half], [2.0 * third, 0.0]])
}

/// A number from 0 to 1, most often very small.
fn tiny(u: f32) -> f32 {
    10f32.powf(-12.0 * u)
}

/// Barycentric weights close to an edge or a corner.
fn weights(stream: &Stream) -> [f32; 3] {
    let [a, b] = stream.pair(10).map(tiny);
    let u = a * (1.0 - b);
    let weights = [u, b, (1.0 - u - b).max(0.0)];
    let turn = (stream.uniform(11) * 3.0) as usize;
    std::array::from_fn(|i| weights[(i + turn) % 3])
}

/// Fails unless rays from all faces begin inside.
#[track_caller]
fn check(body: &Body, center: Vec3, what: &str) {
    let sampler = Sampler::new(Method::Independent, 7);
    let turn = {
        let stream = sampler.stream(1, 1, body.triangles.len() as u32);
        let axis = stream.pair(0);
        Quat::from_axis_angle(
            Vec3::new(axis[0] - 0.5, axis[1] - 0.5, 0.3).normalize(),
            1.0 + 6.0 * stream.uniform(2),
        )
    };
    let corners: Vec<Vec3> = body.corners.iter().map(|&c| center + turn * c).collect();
    let planes: Vec<(DVec3, DVec3)> = body
        .triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.map(|i| DVec3::from(corners[i as usize]));
            let normal = (b - a).cross(c - a).normalize();
            let inward = normal * (DVec3::from(center) - a).dot(normal).signum();
            (a, inward)
        })
        .collect();
    let extent = corners.iter().map(|c| c.abs().max_element());
    let mesh = TriangleMesh {
        positions: corners.iter().map(|c| c.to_array()).collect(),
        indices: body.triangles.clone(),
        ..TriangleMesh::default()
    };
    let mut shapes = Shapes::of_world(&[Shape {
        geometry: Geometry::Mesh(Arc::new(mesh)),
        material: 0,
        area_light: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    }]);
    shapes.origin_offset = 4e-6 * extent.fold(0.0, f32::max);
    for number in 0..4000 {
        let triangle = number as usize % body.triangles.len();
        let stream = sampler.stream(0, 0, number);
        let weights = weights(&stream);
        let found = corners_of(body, &corners, triangle);
        let point = found[0] * weights[0] + found[1] * weights[1] + found[2] * weights[2];
        // From inside: the middle, or a point beside the middle of the way there.
        let org = center + (point - center) * (0.9 * stream.uniform(12));
        let ray = Ray {
            org: org.to_array(),
            dir: (point - org).to_array(),
            tnear: 0.0,
            tfar: f32::INFINITY,
        };
        let hit = Hit {
            t: 1.0,
            u: weights[1],
            v: weights[2],
            prim_id: triangle as u32,
            geom_id: 0,
            inst_id: INVALID_ID,
        };
        let surface = Surface::found(&shapes, &ray, &hit);
        // The direction of the ray may be lost to rounding; that of the wall is not.
        let inward = planes[triangle].1.as_vec3();
        let local = cosine_hemisphere(stream.pair(13));
        let leaving = surface.ray_along(Frame::around(inward).to_world(local));
        let org = DVec3::from(Vec3::from(leaving.org));
        for (wall, (corner, inward)) in planes.iter().enumerate() {
            let room = (org - corner).dot(*inward);
            assert!(
                room > 0.0,
                "{what}: wall {wall} from {triangle}, {weights:?}: {room:e}"
            );
        }
    }
}

fn corners_of(body: &Body, corners: &[Vec3], triangle: usize) -> [Vec3; 3] {
    body.triangles[triangle].map(|i| corners[i as usize])
}

#[test]
fn rays_begin_inside_of_bars() {
    for width in [1.0, 1e-1, 1e-2, 1e-3, 1e-4] {
        check(&bar(width, width), Vec3::ZERO, &format!("bar of {width}"));
    }
    for width in [1.0, 1e-1, 1e-2, 1e-3] {
        let center = Vec3::new(7.0, -9.0, 5.0);
        check(&bar(width, width), center, &format!("far bar of {width}"));
    }
}

#[test]
fn rays_begin_inside_of_flat_boxes() {
    for height in [1e-2, 1e-3, 1e-4] {
        check(&bar(1.0, height), Vec3::ZERO, &format!("box of {height}"));
    }
}

#[test]
fn rays_begin_inside_of_wedges() {
    for angle in [90.0, 60.0, 45.0, 30.0] {
        for height in [1.0, 1e-1, 1e-2, 1e-3] {
            let what = format!("wedge of {angle} degrees and {height}");
            check(&wedge(height, angle), Vec3::ZERO, &what);
        }
    }
}
