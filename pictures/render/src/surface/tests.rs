//! Rays begin inside the closed bodies that they were in, however close to an edge they have hit. Blocks of surfaces
//! are the surfaces of single hits.

use std::sync::Arc;

use antumbra::{Aabb, Hit, INVALID_ID, Isa, Ray};
use antumbra_scene::{
    CurveProfile, Curves, Geometry, Instance, Object, Scene, Shape, Sphere, TriangleMesh,
};
use glam::{Affine3, DVec3, Quat, Vec3};

use super::{Frame, Shapes, Surface, SurfaceBlock};
use crate::columns::BLOCK;
use crate::sampler::warp::cosine_hemisphere;
use crate::sampler::{Method, Sampler, Stream};
use crate::texture::Textures;
use crate::world::Lowered;

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
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    }]);
    shapes.origin_offset = 4e-6 * extent.fold(0.0, f32::max);
    let (mut rays, mut hits) = (Vec::new(), Vec::new());
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
        rays.push(ray);
        hits.push(Some(hit));
        let surface = Surface::found(&shapes, &ray, &hit);
        // The direction of the ray may be lost to rounding; the direction of the wall is not.
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
    check_blocks(&shapes, &rays, &hits);
}

/// Fails unless the surfaces of blocks equal the surfaces of single hits, bit for bit, on every instruction set.
#[track_caller]
fn check_blocks(shapes: &Shapes, rays: &[Ray], hits: &[Option<Hit>]) {
    let mut block = SurfaceBlock::default();
    let places: Vec<u32> = (0..rays.len() as u32).collect();
    for isa in Isa::available() {
        for places in places.chunks(BLOCK) {
            block.compute(isa, shapes, rays, hits, places);
            for (lane, &place) in places.iter().enumerate() {
                let place = place as usize;
                let hit = hits[place].as_ref().expect("a hit");
                let expected = Surface::found(shapes, &rays[place], hit);
                let found = block.surface(lane);
                // Printed numbers differ if and only if their bits do.
                assert_eq!(format!("{found:?}"), format!("{expected:?}"), "{isa:?}");
                for dir in [found.wo, -found.wo, found.normal.cross(found.wo), Vec3::X] {
                    let columns = block.columns();
                    assert_eq!(
                        columns.leave(lane, dir).to_array(),
                        found.ray_along(dir).org
                    );
                    let same = columns.faces_same_side(lane, dir);
                    assert_eq!(same, found.faces_same_side(dir));
                }
            }
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

/// Spheres, curves and meshes, with and without normals, in the world and in stretched and mirrored instances.
#[test]
fn blocks_hold_the_surfaces_of_single_hits() {
    let sampler = Sampler::new(Method::Independent, 9);
    let number = |place: u32| sampler.stream(3, 4, place).uniform(0) * 2.0 - 1.0;
    let vector = |place: u32| Vec3::new(number(place), number(place + 1), number(place + 2));
    let mesh = |seed: u32, with_normals: bool| {
        let vectors = |first: u32| (0..30).map(move |i| vector(first + 3 * i));
        let normals = vectors(seed + 200);
        TriangleMesh {
            positions: vectors(seed).map(|p| (p * 5.0).to_array()).collect(),
            indices: (0..10).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            normals: if with_normals {
                // One triangle has none that count.
                normals
                    .enumerate()
                    .map(|(i, n)| if i < 3 { Vec3::ZERO } else { n })
                    .collect()
            } else {
                Vec::new()
            },
            ..TriangleMesh::default()
        }
    };
    let shape = |geometry: Geometry, sides: u32| Shape {
        geometry,
        material: 0,
        area_light: None,
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: sides & 1 != 0,
        transform_swaps_handedness: sides & 2 != 0,
    };
    let shapes = |seed: u32| -> Vec<Shape> {
        let meshes = (0..4).map(|i| {
            let mesh = mesh(seed + 1000 * i, i % 2 == 1);
            shape(Geometry::Mesh(Arc::new(mesh)), i)
        });
        let ball = Sphere::new(vector(seed + 7), 1.5);
        let curves = |profile: CurveProfile| {
            let points = (0..16).map(|i| vector(seed + 500 + 3 * i).extend(0.1).to_array());
            shape(
                Geometry::Curves(Arc::new(Curves {
                    points: points.collect(),
                    first: vec![0, 3, 6, 9, 12],
                    profile,
                })),
                seed & 3,
            )
        };
        meshes
            .chain([shape(Geometry::Sphere(ball), seed & 1)])
            .chain([CurveProfile::Flat, CurveProfile::Round].map(curves))
            .collect()
    };
    let instance = |scale: Vec3, turn: f32| Instance {
        object: 0,
        world_from_object: Affine3::from_scale_rotation_translation(
            scale,
            Quat::from_rotation_y(turn),
            Vec3::new(3.0, -8.0, turn),
        ),
        end: None,
    };
    let scene = Scene {
        name: String::new(),
        shapes: shapes(50_000),
        objects: vec![Object {
            name: String::new(),
            shapes: shapes(90_001),
        }],
        instances: vec![
            instance(Vec3::ONE, 0.3),
            instance(Vec3::new(2.0, 0.5, -1.0), 2.0),
        ],
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
    let bounds = Aabb {
        min: [-10.0; 3],
        max: [10.0; 3],
    };
    let parts = Lowered::with(&scene, &mut Textures::default()).1;
    let shapes = Shapes::new(&scene, &bounds, parts);
    let (mut rays, mut hits) = (Vec::new(), Vec::new());
    for place in 0..1000 {
        let stream = sampler.stream(5, 6, place);
        let [a, b] = stream.pair(1);
        let root = a.sqrt();
        let at = |dimension: u32, count: f32| (stream.uniform(dimension) * count) as u32;
        hits.push(Some(Hit {
            t: 0.1 + 4.0 * stream.uniform(2),
            u: 1.0 - root,
            v: b * root,
            prim_id: at(3, 10.0),
            geom_id: at(4, 7.0),
            inst_id: [INVALID_ID, 0, 1][at(5, 3.0) as usize],
        }));
        rays.push(Ray {
            org: vector(200_000 + 3 * place).to_array(),
            dir: vector(300_000 + 3 * place).to_array(),
            tnear: 0.0,
            tfar: f32::INFINITY,
        });
    }
    check_blocks(&shapes, &rays, &hits);
}
