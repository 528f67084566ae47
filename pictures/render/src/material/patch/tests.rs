//! Tangents against differences along the surface, steps against neighbouring rays.

use std::sync::Arc;

use antumbra_scene::{Film, Shape, Sphere};
use glam::{DMat4, DVec3, Mat4, Quat};

use super::*;
use crate::world::Camera;

fn shape(geometry: Geometry) -> Shapes {
    Shapes::of_world(&[Shape {
        geometry,
        material: 0,
        area_light: None,
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    }])
}

fn triangle(uvs: Vec<Vec2>, normals: Vec<Vec3>) -> TriangleMesh {
    TriangleMesh {
        positions: vec![[-3.0, -2.0, 5.0], [4.0, -1.0, 6.0], [0.0, 5.0, 4.0]],
        indices: vec![[0, 1, 2]],
        normals,
        uvs,
        colors: Vec::new(),
    }
}

/// Point where a ray intersects the plane of a triangle.
fn meet(mesh: &TriangleMesh, ray: &Ray) -> Hit {
    let [p0, p1, p2] = corners(mesh, 0);
    let (org, dir) = (Vec3::from(ray.org), Vec3::from(ray.dir));
    let normal = (p1 - p0).cross(p2 - p0);
    let t = (p0 - org).dot(normal) / dir.dot(normal);
    let weight =
        |a: Vec3, b: Vec3| (b - a).cross(org + dir * t - a).dot(normal) / normal.length_squared();
    Hit {
        t,
        u: weight(p2, p0),
        v: weight(p0, p1),
        prim_id: 0,
        geom_id: 0,
        inst_id: antumbra::INVALID_ID,
    }
}

fn at(shapes: &Shapes, ray: &Ray, hit: &Hit, neighbours: Option<&[Ray; 2]>) -> Patch {
    Patch::at(shapes, &Surface::found(shapes, ray, hit), hit, neighbours)
}

#[test]
fn steps_lead_to_where_the_neighbouring_rays_meet_the_surface() {
    let uvs = [[0.2, 0.1], [5.0, -1.0], [0.7, 3.0]].map(Vec2::from);
    let camera = antumbra_scene::Camera {
        world_from_camera: Mat4::from_quat(Quat::from_rotation_x(0.1)),
        lens_radius: 0.1,
        focal_distance: 3.0,
        ..Default::default()
    };
    let film = Film {
        resolution: [30, 20],
        ..Film::default()
    };
    let camera = Camera::new(&camera, &film).expect("a camera");
    for turned in [
        Quat::IDENTITY,
        Quat::from_rotation_y(1.2),
        Quat::from_rotation_x(-1.1),
    ] {
        let mut mesh = triangle(uvs.to_vec(), Vec::new());
        for p in &mut mesh.positions {
            let center = Vec3::Z * 5.0;
            *p = (turned * (Vec3::from(*p) - center) + center).to_array();
        }
        let shapes = shape(Geometry::Mesh(Arc::new(mesh.clone())));
        let ray = camera.ray([14.0, 9.0], [0.3, 0.6]);
        let neighbours = camera.neighbours(&ray, 0.25);
        let patch = at(&shapes, &ray, &meet(&mesh, &ray), Some(&neighbours));
        for axis in 0..2 {
            let there = at(
                &shapes,
                &neighbours[axis],
                &meet(&mesh, &neighbours[axis]),
                None,
            );
            let step = there.place.uv - patch.place.uv;
            let error = patch.place.uv_steps[axis] - step;
            assert!(
                error.length() < 1e-3 * step.length() + 1e-5,
                "{turned} {axis} {error}"
            );
            let step = there.place.point - patch.place.point;
            assert!((patch.place.point_steps[axis] - step).length() < 1e-4);
        }
        let alone = at(&shapes, &ray, &meet(&mesh, &ray), None);
        assert_eq!(alone.place.uv_steps, [Vec2::ZERO; 2]);
        assert_eq!(alone.place.uv, patch.place.uv);
        assert_eq!(alone.bump_tangents, alone.tangents);
    }
}

#[test]
fn tangents_of_triangles_solve_for_their_corners() {
    let uvs = [[0.2, 0.1], [5.0, -1.0], [0.7, 3.0]]
        .map(Vec2::from)
        .to_vec();
    let normals = [
        Vec3::new(0.1, 0.0, -1.0),
        Vec3::new(0.0, 0.3, -1.0),
        -Vec3::Z,
    ];
    let normals = normals.map(Vec3::normalize).to_vec();
    let mesh = triangle(uvs.clone(), normals.clone());
    let shapes = shape(Geometry::Mesh(Arc::new(mesh.clone())));
    let ray = Ray::new([0.1, 0.2, 0.0], [0.0, 0.0, 1.0]);
    let patch = at(&shapes, &ray, &meet(&mesh, &ray), None);
    let p = corners(&mesh, 0);
    for i in 0..2 {
        let change = |[u, v]: [Vec3; 2]| {
            let d = uvs[i + 1] - uvs[0];
            u * d.x + v * d.y
        };
        assert!((change(patch.tangents) - (p[i + 1] - p[0])).length() < 1e-4);
        let normal = normals[i + 1] - normals[0];
        assert!((change(patch.normal_changes) - normal).length() < 1e-5);
    }
    // Bumps of meshes with normals are built on unit vectors across the shading normal, pointing back.
    let shading = Surface::found(&shapes, &ray, &meet(&mesh, &ray)).shading_normal;
    let [u, v] = patch.bump_tangents;
    assert!((u.cross(v) - shading).length() < 1e-5);
    assert!(u.dot(patch.tangents[0]) < 0.0 && u.is_normalized());
    // Without usable coordinates any tangents will do.
    for uvs in [vec![Vec2::ONE; 3], vec![Vec2::NAN; 3]] {
        let mesh = triangle(uvs, Vec::new());
        let shapes = shape(Geometry::Mesh(Arc::new(mesh.clone())));
        let [u, v] = at(&shapes, &ray, &meet(&mesh, &ray), None).tangents;
        assert!((u.cross(v).length() - 1.0).abs() < 1e-5);
    }
}

#[test]
fn coordinates_of_spheres_are_longitude_and_latitude() {
    let (center, radius) = (Vec3::new(1.0, 2.0, 3.0), 2.0);
    let shapes = shape(Geometry::Sphere(Sphere::new(center, radius)));
    let look = |to: Vec3| {
        let org = center + to.normalize() * 10.0;
        let ray = Ray::new(org.to_array(), (-to.normalize()).to_array());
        let hit = Hit {
            t: 8.0,
            u: 0.0,
            v: 0.0,
            prim_id: 0,
            geom_id: 0,
            inst_id: antumbra::INVALID_ID,
        };
        at(&shapes, &ray, &hit, None)
    };
    for (to, u, v) in [
        (Vec3::X, 0.0, 0.5),
        (Vec3::Y, 0.25, 0.5),
        (-Vec3::Y, 0.75, 0.5),
        (Vec3::new(-1.0, 0.0, 1.0), 0.5, 0.75),
    ] {
        let uv = look(to).place.uv;
        assert!((uv - Vec2::new(u, v)).length() < 1e-5, "{to} {uv}");
    }
    let to = Vec3::new(0.5, 0.7, -0.4).normalize();
    let patch = look(to);
    for axis in [Vec3::new(-0.7, 0.5, 0.0), Vec3::new(0.2, 0.28, 0.74)] {
        let moved = look(to + axis * 0.01);
        let uv = moved.place.uv - patch.place.uv;
        let [u, v] = patch.tangents;
        let step = moved.place.point - patch.place.point;
        assert!((u * uv.x + v * uv.y - step).length() < 2e-3 * step.length() + 2e-4);
        let [u, v] = patch.normal_changes;
        assert!((u * uv.x + v * uv.y - step / radius).length() < 1e-3);
    }
    assert!(look(Vec3::Z).tangents.iter().all(|t| t.is_finite()));
}

/// A turned or mirrored sphere has the coordinates of the sphere before, and tangents along them.
#[test]
fn coordinates_of_spheres_turn_with_them() {
    let turned = DMat4::from_rotation_x(1.2) * DMat4::from_scale(DVec3::new(-2.0, 2.0, 2.0));
    let center = Vec3::new(0.0, 0.5, 0.0);
    let before = Sphere::new(center, 0.5);
    let after = before.transformed(&turned).expect("an even scale");
    let look = |sphere: Sphere, to: Vec3| {
        let org = sphere.center + to * 3.0 * sphere.radius;
        let hit = Hit {
            t: 2.0 * sphere.radius,
            u: 0.0,
            v: 0.0,
            prim_id: 0,
            geom_id: 0,
            inst_id: antumbra::INVALID_ID,
        };
        let ray = Ray::new(org.to_array(), (-to).to_array());
        at(&shape(Geometry::Sphere(sphere)), &ray, &hit, None)
    };
    let place = |matrix: &DMat4, v: Vec3| matrix.transform_vector3(v.as_dvec3()).as_vec3();
    for to in [
        Vec3::new(0.8, 0.1, 0.3),
        Vec3::new(0.5, 0.7, -0.4),
        Vec3::new(-0.2, 0.3, 0.9),
    ] {
        let to = to.normalize();
        let (old, new) = (look(before, to), look(after, place(&turned, to) / 2.0));
        assert!((old.place.uv - new.place.uv).length() < 1e-5, "{to}");
        for (old, new) in old.tangents.iter().zip(new.tangents) {
            assert!((place(&turned, *old) - new).length() < 1e-4, "{to}");
        }
        for (old, new) in old.normal_changes.iter().zip(new.normal_changes) {
            assert!((place(&turned, *old) / 2.0 - new).length() < 1e-4, "{to}");
        }
    }
}
