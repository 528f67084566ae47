use std::sync::Arc;

use glam::{Affine3, DVec3, Mat3, Vec3};

use super::*;
use crate::{Film, Instance, Object, Sphere, TriangleMesh, transform};

fn scene(shapes: Vec<Shape>, objects: Vec<Vec<Shape>>, places: &[(usize, Affine3)]) -> Scene {
    Scene {
        name: "test".into(),
        shapes,
        objects: objects
            .into_iter()
            .map(|shapes| Object {
                name: "thing".into(),
                shapes,
            })
            .collect(),
        instances: places
            .iter()
            .map(|&(object, world_from_object)| Instance {
                object,
                world_from_object,
                end: None,
            })
            .collect(),
        materials: Vec::new(),
        media: Vec::new(),
        lights: Vec::new(),
        camera: Default::default(),
        film: Film::default(),
        sampler: Default::default(),
        integrator: Default::default(),
        accelerator: Default::default(),
        origin: Default::default(),
    }
}

fn shape(geometry: Geometry, material: usize) -> Shape {
    Shape {
        geometry,
        material,
        area_light: None,
        media: None,
        alpha: None,
        shadow_alpha: None,
        reverse_orientation: false,
        transform_swaps_handedness: false,
    }
}

fn mesh(triangles: usize, vertices: usize) -> Geometry {
    Geometry::Mesh(Arc::new(TriangleMesh {
        positions: vec![[1.0, 2.0, 4.0]; vertices],
        indices: vec![[0; 3]; triangles],
        ..TriangleMesh::default()
    }))
}

fn ball() -> Geometry {
    Geometry::Sphere(Sphere::new(Vec3::X, 1.5))
}

fn first_position(shape: &Shape) -> [f32; 3] {
    match &shape.geometry {
        Geometry::Mesh(mesh) => mesh.positions[0],
        Geometry::Sphere(sphere) => sphere.center.into(),
        Geometry::Curves(_) => panic!("no curves here"),
    }
}

#[test]
fn shapes_stand_first_and_then_those_of_each_instance() {
    let mirror = Affine3::from_scale(Vec3::new(1.0, -2.0, 1.0));
    let double = Affine3::from_scale_rotation_translation(
        Vec3::splat(2.0),
        glam::Quat::IDENTITY,
        Vec3::new(0.0, 8.0, 0.0),
    );
    let objects = vec![
        vec![shape(mesh(3, 4), 1)],
        vec![],
        vec![shape(ball(), 2), shape(mesh(5, 9), 3)],
        vec![shape(mesh(7, 7), 4)],
    ];
    let places = [
        (2, double),
        (0, mirror),
        (1, mirror),
        (0, Affine3::IDENTITY),
    ];
    let whole = scene(vec![shape(mesh(1, 3), 0)], objects, &places);
    let flat = whole.flattened().expect("small");
    assert!(flat.instances.is_empty() && flat.objects.is_empty());
    let found: Vec<_> = flat
        .shapes
        .iter()
        .map(|s| (s.material, first_position(s), s.transform_swaps_handedness))
        .collect();
    let expected = [
        (0, [1.0, 2.0, 4.0], false),
        (2, [2.0, 8.0, 0.0], false),
        (3, [2.0, 12.0, 8.0], false),
        (1, [1.0, -4.0, 4.0], true),
        (1, [1.0, 2.0, 4.0], false),
    ];
    assert_eq!(found, expected);
    let materials: Vec<_> = whole.standing_shapes().map(|s| s.material).collect();
    assert_eq!(materials, [0, 2, 3, 1, 1]);
    assert_eq!(
        (whole.triangle_count(), whole.stored_triangle_count()),
        (12, 16)
    );
    assert_eq!(flat.triangle_count(), 12);
    let Geometry::Sphere(sphere) = &flat.shapes[1].geometry else {
        panic!("a sphere stays one")
    };
    assert_eq!(sphere.radius, 3.0);
    let (Geometry::Mesh(kept), Geometry::Mesh(unmoved)) = (
        &whole.objects[0].shapes[0].geometry,
        &flat.shapes[4].geometry,
    ) else {
        panic!("meshes stay meshes")
    };
    assert!(Arc::ptr_eq(kept, unmoved), "what does not move is shared");
    let swaps: Vec<_> = whole
        .instances
        .iter()
        .map(Instance::swaps_handedness)
        .collect();
    assert_eq!(swaps, [false, true, true, false]);
    assert!(matches!(flat.flattened(), Ok(Cow::Borrowed(_))));
}

/// Instances of pbrt-v3: normals are found in the space of the object and transformed by the inverse transpose.
#[test]
fn normals_are_those_of_the_object_moved() {
    let mut state = 0x1234_5678_u64;
    println!("seed {state}");
    let mut number = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let mut vector = || Vec3::new(number(), number(), number());
    let normal_of = |shape: &Shape| {
        let Geometry::Mesh(mesh) = &shape.geometry else {
            unreachable!("a mesh")
        };
        let [a, b, c] = [0, 1, 2].map(|i| Vec3::from(mesh.positions[i]).as_dvec3());
        let normal = (b - a).cross(c - a).normalize();
        let flip = shape.reverse_orientation != shape.transform_swaps_handedness;
        (
            if flip { -normal } else { normal },
            mesh.normals[0].as_dvec3(),
        )
    };
    let (mut mirrored, mut tried) = (0, 0);
    for case in 0..500 {
        let linear = Mat3::from_cols(vector(), vector(), vector());
        let corners = [vector(), vector(), vector()];
        let vertex_normal = vector();
        let area = (corners[1] - corners[0])
            .cross(corners[2] - corners[0])
            .length();
        // Flat matrices and slivers are skipped: rounding decides there.
        if linear.determinant().abs() < 0.05 || area < 0.05 || vertex_normal.length() < 0.1 {
            continue;
        }
        let mut original = shape(
            Geometry::Mesh(Arc::new(TriangleMesh {
                positions: corners.map(|p| p.to_array()).to_vec(),
                indices: vec![[0, 1, 2]],
                normals: vec![vertex_normal.normalize(); 3],
                uvs: Vec::new(),
                colors: Vec::new(),
            })),
            0,
        );
        original.reverse_orientation = case % 2 == 0;
        original.transform_swaps_handedness = case % 3 == 0;
        let place = Affine3::from_mat3_translation(linear, vector());
        let whole = scene(Vec::new(), vec![vec![original.clone()]], &[(0, place)]);
        let flat = whole.flattened().expect("a mesh");
        let [plane, vertex] = [normal_of(&original).0, normal_of(&original).1]
            .map(|n| linear.as_dmat3().inverse().transpose() * n)
            .map(DVec3::normalize);
        let (found_plane, found_vertex) = normal_of(&flat.shapes[0]);
        assert!((found_plane - plane).length() < 1e-3, "case {case}");
        assert!((found_vertex - vertex).length() < 1e-5, "case {case}");
        tried += 1;
        mirrored += usize::from(whole.instances[0].swaps_handedness());
    }
    assert!(mirrored > 50 && tried - mirrored > 50);
}

#[test]
fn what_has_no_flat_form_is_refused() {
    let place = |object| (object, Affine3::IDENTITY);
    let missing = scene(
        Vec::new(),
        vec![vec![shape(ball(), 0)]],
        &[place(0), place(1)],
    );
    let expected = Error::Object {
        instance: 1,
        object: 1,
        objects: 1,
    };
    assert_eq!(missing.flattened().expect_err("refused"), expected);
    assert_eq!(missing.standing_shapes().count(), 1);

    let stretch = Affine3::from_scale(Vec3::new(1.0, 2.0, 1.0));
    let ellipsoid = scene(Vec::new(), vec![vec![shape(ball(), 0)]], &[(0, stretch)]);
    let error = ellipsoid.flattened().expect_err("refused");
    assert!(matches!(error, Error::Ellipsoid { instance: 0, .. }));
    assert!(ellipsoid.objects[0].has_spheres());
    assert!(error.to_string().contains("\"thing\""));

    // One triangle too many, for every kind of shape; nothing is allocated.
    for (triangles, vertices) in [(1 << 15, 3), (1, 3 << 15)] {
        let full = vec![place(0); 1 << 12];
        let object = vec![vec![shape(mesh(triangles, vertices), 0)]];
        let one = vec![shape(mesh(0, 0), 0)];
        let error = scene(one, object, &full).flattened().expect_err("refused");
        let expected = Error::TooLarge {
            triangles: MAX_FLAT_TRIANGLES + 1,
            instances: 1 << 12,
        };
        assert_eq!(error, expected);
    }
}

#[test]
fn a_flat_transformation_is_no_crash() {
    let flat_matrix = Affine3::from_scale(Vec3::new(1.0, 0.0, 1.0));
    let whole = scene(
        Vec::new(),
        vec![vec![shape(mesh(1, 3), 0)]],
        &[(0, flat_matrix)],
    );
    assert!(!transform::is_invertible(&whole.instances[0].matrix()));
    let flat = whole.flattened().expect("only degenerate");
    assert_eq!(first_position(&flat.shapes[0]), [1.0, 0.0, 4.0]);
}
