//! Smooth shapes and their meshes.

use std::f64::consts::PI;

use antumbra_scene::{Geometry, Shape, TriangleMesh};
use glam::{DVec3, Vec3};

use super::{load_text, world};

/// Mesh of the only shape of a world block.
fn mesh(text: &str) -> TriangleMesh {
    let scene = world(text);
    let [shape] = &scene.shapes[..] else {
        panic!("one shape")
    };
    mesh_of(shape).clone()
}

fn mesh_of(shape: &Shape) -> &TriangleMesh {
    match &shape.geometry {
        Geometry::Mesh(mesh) => mesh,
        other => panic!("{other:?} is not a mesh"),
    }
}

fn point(mesh: &TriangleMesh, index: u32) -> DVec3 {
    DVec3::from(mesh.positions[index as usize].map(f64::from))
}

/// Area of a mesh. Checks that triangles face the direction of their normals.
fn area(mesh: &TriangleMesh) -> f64 {
    assert_eq!(mesh.normals.len(), mesh.positions.len());
    assert_eq!(mesh.uvs.len(), mesh.positions.len());
    let in_square = |uv: &glam::Vec2| (0.0..=1.0).contains(&uv.x) && (0.0..=1.0).contains(&uv.y);
    assert!(mesh.uvs.iter().all(in_square));
    let areas = mesh.indices.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|i| point(mesh, i));
        let product = (b - a).cross(c - a);
        assert!(product.length() > 0.0);
        for index in triangle {
            let normal = mesh.normals[*index as usize].as_dvec3();
            assert!((normal.length() - 1.0).abs() < 1e-6);
            assert!(
                normal.dot(product) > 0.0,
                "{triangle:?} faces the wrong way"
            );
        }
        0.5 * product.length()
    });
    areas.sum()
}

/// Checks the area, and that every vertex and centroid is near the surface. `distance` is the distance of a point.
fn assert_surface(text: &str, expected_area: f64, distance: impl Fn(DVec3) -> f64, bound: f64) {
    let mesh = mesh(text);
    let area = area(&mesh);
    assert!(
        (area / expected_area - 1.0).abs() < 1e-6,
        "{text}: area {area} is not {expected_area}"
    );
    for triangle in &mesh.indices {
        let [a, b, c] = triangle.map(|i| point(&mesh, i));
        for p in [
            a,
            b,
            c,
            (a + b) / 2.0,
            (b + c) / 2.0,
            (c + a) / 2.0,
            (a + b + c) / 3.0,
        ] {
            let found = distance(p).abs();
            assert!(found < bound, "{text}: {p} is {found} away");
        }
    }
}

#[test]
fn disks() {
    let off_plane = |p: DVec3| p.z - 3.0;
    assert_surface(
        r#"Shape "disk" "float height" 3 "float radius" 2"#,
        4.0 * PI,
        off_plane,
        1e-6,
    );
    assert_surface(
        r#"Shape "disk" "float height" 3 "float radius" 2 "float innerradius" 1 "float phimax" 90"#,
        0.75 * PI,
        off_plane,
        1e-6,
    );
    let disk = mesh(r#"Shape "disk" "float radius" 2"#);
    assert!(disk.normals.iter().all(|n| *n == Vec3::Z));
    let rim: Vec<f32> = disk.positions.iter().map(|p| p[0].hypot(p[1])).collect();
    for (radius, uv) in rim.iter().zip(&disk.uvs) {
        // v is 0 at the rim and 1 in the middle.
        assert!((radius - 2.0 * (1.0 - uv.y)).abs() < 3e-4, "{radius} {uv}");
    }
}

#[test]
fn cylinders() {
    let off_axis = |p: DVec3| p.truncate().length() - 0.5;
    assert_surface(
        r#"Shape "cylinder" "float radius" 0.5 "float zmin" 2 "float zmax" -1"#,
        3.0 * PI,
        off_axis,
        0.5 * 1e-4,
    );
    assert_surface(
        r#"Shape "cylinder" "float radius" 0.5 "float phimax" 36"#,
        0.2 * PI,
        off_axis,
        0.5 * 1e-4,
    );
    let cylinder = mesh(r#"Shape "cylinder" "float phimax" 90"#);
    // u goes around from x to y, v from zmin to zmax.
    for (i, uv) in cylinder.uvs.iter().enumerate() {
        let p = point(&cylinder, i as u32);
        assert!((p.z - (2.0 * f64::from(uv.y) - 1.0)).abs() < 1e-6);
        let angle = p.y.atan2(p.x);
        assert!((angle - 0.5 * PI * f64::from(uv.x)).abs() < 1e-6);
    }
}

#[test]
fn parts_of_spheres() {
    let off_sphere = |p: DVec3| p.length() - 2.0;
    for (text, share) in [
        ("\"float zmin\" 0", 0.5),
        ("\"float phimax\" 180", 0.5),
        (
            "\"float zmin\" 1 \"float zmax\" -1 \"float phimax\" 90",
            0.125,
        ),
        // The range of z is limited to the sphere.
        ("\"float zmin\" -9 \"float zmax\" 1", 0.75),
    ] {
        let text = format!("Shape \"sphere\" \"float radius\" 2 {text}");
        assert_surface(&text, share * 16.0 * PI, off_sphere, 2.0 * 1.6e-4);
    }
    let part = mesh(r#"Shape "sphere" "float zmin" -.5 "float zmax" 0.5"#);
    for (i, uv) in part.uvs.iter().enumerate() {
        let p = point(&part, i as u32);
        // The angle from the axis runs uniformly from zmin to zmax.
        let theta = p.normalize().z.acos();
        let expected = (2.0 * PI + (PI - 2.0 * PI) * f64::from(uv.y)) / 3.0;
        assert!((theta - expected).abs() < 1e-6);
        assert!(part.normals[i].dot(p.normalize().as_vec3()) > 0.999_999);
    }
    // Whole spheres stay spheres, even with explicit bounds.
    for text in ["\"float zmin\" -2 \"float zmax\" 5", "\"float phimax\" 400"] {
        let scene = world(&format!("Shape \"sphere\" {text}"));
        assert!(
            matches!(scene.shapes[0].geometry, Geometry::Sphere(_)),
            "{text}"
        );
    }
}

#[test]
fn ellipsoids_are_stretched_spheres() {
    let ellipsoid = mesh(r#"Translate 5 0 0 Scale 1 2 -3 Shape "sphere""#);
    for (i, normal) in ellipsoid.normals.iter().enumerate() {
        let p = point(&ellipsoid, i as u32) - DVec3::new(5.0, 0.0, 0.0);
        let on_sphere = p / DVec3::new(1.0, 2.0, 3.0);
        assert!((on_sphere.length() - 1.0).abs() < 2e-4, "{p}");
        // Normals point outwards, with and without a reflection.
        let gradient = on_sphere / DVec3::new(1.0, 2.0, 3.0);
        assert!(
            normal.as_dvec3().dot(gradient.normalize()) > 0.999_999,
            "{p}"
        );
    }
}

#[test]
fn emitters_are_divided_more_coarsely_and_emit_as_much() {
    let light = r#"AreaLightSource "diffuse""#;
    let [dark, bright] = ["", light].map(|light| mesh(&format!("{light} Shape \"disk\"")));
    assert_eq!((dark.indices.len(), bright.indices.len()), (256, 64));
    assert!((area(&bright) / PI - 1.0).abs() < 1e-6);
    let scene = world(&format!("{light} Shape \"disk\" \"float phimax\" 90"));
    assert!(scene.shapes[0].area_light.is_some());
    assert_eq!(mesh_of(&scene.shapes[0]).indices.len(), 16);
}

#[test]
fn tubes_have_the_width_of_their_curve() {
    // A straight line of changing width: a frustum of eight sides.
    let tube = mesh(
        r#"Shape "curve" "string type" "cylinder" "point P" [0 0 0 0 0 1 0 0 2 0 0 3]
        "float width0" 2 "float width1" 4"#,
    );
    assert_eq!(tube.indices.len(), 16);
    let scale = (PI / 8.0) / (PI / 8.0).sin();
    for i in 0..tube.positions.len() {
        let p = point(&tube, i as u32);
        let radius = scale * (1.0 + p.z / 3.0);
        assert!((p.truncate().length() - radius).abs() < 1e-6, "{p}");
    }
    area(&tube);
}

#[test]
fn curves_of_every_kind_lie_on_their_line() {
    // A parabola: y = x² for x in 0..=1, as every basis and degree writes it.
    let parabola = [
        r#""integer degree" 2 "point P" [0 0 0 .5 0 0 1 1 0]"#,
        r#""point P" [0 0 0 .33333333 0 0 .66666667 .33333333 0 1 1 0]"#,
        // Two segments.
        r#""integer degree" 2 "point P" [0 0 0 .25 0 0 .5 .25 0 .75 .5 0 1 1 0]"#,
        r#""integer degree" 2 "string basis" "bspline" "point P" [-.5 0 0 .5 0 0 1.5 2 0]"#,
        r#""string basis" "bspline" "point P" [-1 .66666667 0 0 -.33333333 0 1 .66666667 0 2 3.6666667 0]"#,
    ];
    for text in parabola {
        let width = 0.01;
        let text =
            format!(r#"Shape "curve" "string type" "cylinder" "float width" {width} {text}"#);
        let tube = mesh(&text);
        area(&tube);
        assert!(tube.positions.len() > 9 * 4, "{text}");
        let ends = [f64::INFINITY, f64::NEG_INFINITY];
        let [low, high] = (0..tube.positions.len() as u32).fold(ends, |[low, high], i| {
            let p = point(&tube, i);
            // The distance to the parabola, by its slope.
            let across = (p.y - p.x * p.x) / (1.0 + 4.0 * p.x * p.x).sqrt();
            let distance = across.hypot(p.z);
            assert!(distance < 0.56 * width, "{text}: {p} is {distance} away");
            [low.min(p.x), high.max(p.x)]
        });
        assert!(low.abs() < width && (high - 1.0).abs() < width, "{text}");
    }
}

#[test]
fn ribbons_face_their_normals() {
    let ribbon = mesh(
        r#"Shape "curve" "string type" "ribbon" "point P" [0 0 0 1 0 0 2 0 0 3 0 0]
        "normal N" [0 0 2 0 1 0] "float width" 2"#,
    );
    let [first, last] = [0, 1].map(|end| {
        let at_end = |i: &usize| ribbon.uvs[*i].x == end as f32;
        (0..ribbon.positions.len()).find(at_end).unwrap()
    });
    assert_eq!(ribbon.normals[first], Vec3::Z);
    assert!(ribbon.normals[last].distance(Vec3::Y) < 1e-6);
    for i in 0..ribbon.positions.len() {
        let p = point(&ribbon, i as u32);
        assert!((p.y.hypot(p.z) - 1.0).abs() < 1e-6);
        assert!(
            ribbon.normals[i]
                .as_dvec3()
                .dot(DVec3::new(0.0, p.y, p.z))
                .abs()
                < 1e-6
        );
    }
}

#[test]
fn what_curves_leave_out_is_noted() {
    let text = r#"WorldBegin Shape "curve" "point P" [0 0 0 1 0 0 2 0 0 3 0 0] "integer splitdepth" 3 WorldEnd"#;
    let loaded = load_text(text).unwrap();
    let notes: Vec<&str> = loaded.notes.iter().map(|n| n.message.as_str()).collect();
    let [flat, split] = notes[..] else {
        panic!("{notes:?}")
    };
    assert!(flat.contains("flat curves are taken as cylinders"));
    assert!(split.contains("\"splitdepth\" of shape \"curve\" is left out"));
}

#[test]
fn cones() {
    let text = r#"Shape "cone" "float radius" 3 "float height" 4"#;
    // The distance from the line through the apex: 3 z + 4 r = 12.
    let off = |p: DVec3| (3.0 * p.z + 4.0 * p.truncate().length() - 12.0) / 5.0;
    assert_surface(text, 15.0 * PI, off, 3e-4);
    let half = format!("{text} \"float phimax\" 180");
    assert_surface(&half, 7.5 * PI, off, 3e-4);
    let cone = mesh(text);
    for (i, uv) in cone.uvs.iter().enumerate() {
        let p = point(&cone, i as u32);
        assert!((p.z - 4.0 * f64::from(uv.y)).abs() < 1e-6);
        let normal = cone.normals[i];
        assert!((normal.z - 0.6).abs() < 1e-6, "{normal}");
        if uv.y == 0.0 {
            let out = Vec3::new(p.x as f32, p.y as f32, 0.0).normalize();
            assert!((normal.dot(out) - 0.8).abs() < 1e-6, "{normal}");
        }
    }
}

#[test]
fn paraboloids() {
    // Radius 2 at z = 4, so z = r². The area is π / 6 ((4 z + 1)^1.5) between the ends.
    let area = |low: f64, high: f64| {
        let to = |z: f64| (4.0 * z + 1.0).powf(1.5);
        PI / 6.0 * (to(high) - to(low))
    };
    let off = |p: DVec3| (p.truncate().length_squared() - p.z) / (1.0 + 4.0 * p.z.max(0.0)).sqrt();
    let text =
        |ends: &str| format!("Shape \"paraboloid\" \"float radius\" 2 \"float zmax\" 4 {ends}");
    assert_surface(&text(""), area(0.0, 4.0), off, 4e-4);
    assert_surface(&text("\"float zmin\" 1"), area(1.0, 4.0), off, 4e-4);
    // Below the vertex is nothing, but v counts from zmin.
    assert_surface(&text("\"float zmin\" -4"), area(0.0, 4.0), off, 4e-4);
    let bowl = mesh(&text("\"float zmin\" -4"));
    for (i, uv) in bowl.uvs.iter().enumerate() {
        let p = point(&bowl, i as u32);
        assert!(
            (p.z - (8.0 * f64::from(uv.y) - 4.0)).abs() < 1e-5,
            "{p} {uv}"
        );
        // The gradient of r² - z.
        let normal = DVec3::new(2.0 * p.x, 2.0 * p.y, -1.0).normalize();
        assert!(bowl.normals[i].as_dvec3().dot(normal) > 0.999_999);
    }
    // With both ends below 0 it opens downward: z = -r² here.
    let hanging = r#"Shape "paraboloid" "float radius" 1 "float zmin" -4 "float zmax" -1"#;
    let off = |p: DVec3| off(DVec3::new(p.x, p.y, -p.z));
    assert_surface(hanging, area(1.0, 4.0), off, 4e-4);
}

#[test]
fn hyperboloids() {
    // A line that is symmetric about z = 0: r² = 1 + z².
    let text = r#"Shape "hyperboloid" "point p1" [1 -1 -1] "point p2" [1 1 1]"#;
    let off = |p: DVec3| {
        let slope = 2.0 * p.length();
        (p.truncate().length_squared() - 1.0 - p.z * p.z) / slope
    };
    // 2 π ∫ sqrt(1 + 2 z²) dz from -1 to 1.
    let area = 2.0 * PI * (3.0_f64.sqrt() + 2.0_f64.sqrt().asinh() / 2.0_f64.sqrt());
    assert_surface(text, area, off, 2.0_f64.sqrt() * 3e-4);
    let whole = mesh(text);
    for (i, uv) in whole.uvs.iter().enumerate() {
        let p = point(&whole, i as u32);
        assert!((p.z - (2.0 * f64::from(uv.y) - 1.0)).abs() < 1e-6);
        let normal = DVec3::new(p.x, p.y, -p.z).normalize();
        assert!(whole.normals[i].as_dvec3().dot(normal) > 0.999_999);
    }
    // Other lines: the circles of the end and of twice as far are on the surface, as in pbrt-v3. Here r² of these is
    // 1.64 at 1.4 and 4.36 at 2.8.
    let growth = (4.36 - 1.64) / (2.8 * 2.8 - 1.4 * 1.4);
    let mesh = mesh(r#"Shape "hyperboloid" "point p1" [1 0 0] "point p2" [.8 1 1.4]"#);
    for i in 0..mesh.positions.len() {
        let p = point(&mesh, i as u32);
        let expected = 1.64 + growth * (p.z * p.z - 1.96);
        assert!((p.truncate().length_squared() - expected).abs() < 1e-3);
    }
    // The default is a cone. Its apex is at p1.
    let cone = |p: DVec3| (p.truncate().length() - 2.0_f64.sqrt() * p.z) / 3.0_f64.sqrt();
    assert_surface(r#"Shape "hyperboloid""#, 6.0_f64.sqrt() * PI, cone, 3e-4);
}

#[test]
fn surfaces_of_revolution_that_are_none() {
    for (text, expected) in [
        (r#""cone" "float height" 0"#, "\"height\" must be positive"),
        (r#""paraboloid" "float zmin" 1"#, "no surface"),
        (
            r#""paraboloid" "float zmin" -1 "float zmax" 0"#,
            "no surface",
        ),
        (
            r#""hyperboloid" "point p1" [1 0 0] "point p2" [2 0 0]"#,
            "no surface",
        ),
        (
            r#""hyperboloid" "point p1" [-1 0 -1] "point p2" [1 0 1]"#,
            "crosses the axis",
        ),
        (
            r#""hyperboloid" "point p1" [1 0 0.6] "point p2" [5 0 1]"#,
            "with gaps",
        ),
    ] {
        let error = load_text(&format!("WorldBegin Shape {text} WorldEnd")).err();
        let error = error.unwrap_or_else(|| panic!("{text}")).to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
}
