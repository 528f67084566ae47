//! Smooth shapes, their meshes, and curves.

use std::f64::consts::PI;

use antumbra_scene::{CurveProfile, Curves, Geometry, Shape, TriangleMesh};
use glam::{DVec3, Vec2, Vec3};

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

/// Curves of the first shape of a world.
fn curves(text: &str) -> Curves {
    let scene = load_text(&format!("WorldBegin {text} WorldEnd"))
        .unwrap()
        .scene;
    match &scene.shapes[0].geometry {
        Geometry::Curves(curves) => Curves::clone(curves),
        geometry => panic!("no curves: {geometry:?}"),
    }
}

#[test]
fn radii_of_curves_are_half_their_widths() {
    let text = r#"Shape "curve" "string type" "cylinder" "point P" [0 0 0 0 0 1 0 0 2 0 0 3 0 0 4 0 0 5 0 0 6]
        "float width0" 2 "float width1" 8"#;
    let found = curves(text);
    assert_eq!(found.profile, CurveProfile::Round);
    assert_eq!(found.first, [0, 3]);
    let expected: Vec<_> = (0..7)
        .map(|i| [0.0, 0.0, i as f32, 1.0 + 0.5 * i as f32])
        .collect();
    assert_eq!(found.points, expected);
    let scaled = curves(&format!("Translate 1 0 0 Scale -3 3 3 {text}"));
    let last = scaled.points[6];
    assert_eq!(last, [1.0, 0.0, 18.0, 12.0]);
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
        let found = curves(&format!(r#"Shape "curve" {text}"#));
        assert_eq!(found.profile, CurveProfile::Flat);
        let mut ends = Vec::new();
        for curve in 0..found.first.len() as u32 {
            let [a, b, c, d] = found.control(curve).map(|[x, y, ..]| Vec2::new(x, y));
            for i in 0..=10 {
                let t = i as f32 / 10.0;
                let [ab, bc, cd] = [a.lerp(b, t), b.lerp(c, t), c.lerp(d, t)];
                let p = ab.lerp(bc, t).lerp(bc.lerp(cd, t), t);
                assert!((p.y - p.x * p.x).abs() < 1e-6, "{text}: {p}");
            }
            ends.extend([a.x, d.x]);
        }
        assert!(ends[0].abs() < 1e-6, "{text}");
        assert!((ends[ends.len() - 1] - 1.0).abs() < 1e-6, "{text}");
    }
}

/// Hairs of one kind are one shape, whatever their number.
#[test]
fn curves_that_are_alike_are_one_shape() {
    let hair = |x: u32| format!("Shape \"curve\" \"point P\" [{x} 0 0 {x} 0 1 {x} 0 2 {x} 0 3] ");
    let [a, b, c] = [0, 1, 2].map(hair);
    let text = format!(
        "Integrator \"volpath\" WorldBegin {a}{b} Material \"mirror\" {c} ReverseOrientation {a}{b}{c} \
         ObjectBegin \"o\" {a}{b} ObjectEnd {c} \
         MakeNamedMedium \"m\" \"string type\" \"homogeneous\" MediumInterface \"m\" \"\" {a} WorldEnd"
    );
    let scene = load_text(&text).unwrap().scene;
    let counts: Vec<_> = scene
        .shapes
        .iter()
        .map(|shape| match &shape.geometry {
            Geometry::Curves(curves) => curves.first.len(),
            _ => 0,
        })
        .collect();
    assert_eq!(counts, [2, 1, 4, 1]);
    let Geometry::Curves(last) = &scene.shapes[2].geometry else {
        panic!("curves")
    };
    let x: Vec<f32> = (0..4).map(|curve| last.control(curve)[0][0]).collect();
    assert_eq!(x, [0.0, 1.0, 2.0, 2.0]);
}

#[test]
fn moving_curves_are_objects_that_move() {
    let text = r#"WorldBegin ActiveTransform EndTime Translate 1 0 0 ActiveTransform All
        Shape "curve" "point P" [0 0 0 0 0 1 0 0 2 0 0 3] WorldEnd"#;
    let scene = load_text(text).unwrap().scene;
    assert!(scene.shapes.is_empty() && scene.moves());
    assert!(matches!(
        scene.objects[0].shapes[0].geometry,
        Geometry::Curves(_)
    ));
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

/// As in pbrt-v3, u goes from 0 to 1 on each segment.
#[test]
fn segments_of_ribbons_have_their_own_coordinates() {
    let ribbon = mesh(
        r#"Shape "curve" "string type" "ribbon" "integer degree" 2 "point P" [0 0 0 1 0 0 2 0 0 3 0 0 4 0 0]
        "normal N" [0 0 1 0 0 1 0 0 1]"#,
    );
    for (position, uv) in ribbon.positions.iter().zip(&ribbon.uvs) {
        let u = position[0] / 2.0;
        assert!(uv.x == u || uv.x == u - 1.0, "{position:?} {uv}");
    }
    assert!(ribbon.uvs.iter().filter(|uv| uv.x == 1.0).count() >= 4);
}

#[test]
fn what_curves_leave_out_is_noted() {
    let text = r#"WorldBegin Shape "curve" "point P" [0 0 0 1 0 0 2 0 0 3 0 0] "integer splitdepth" 3 WorldEnd"#;
    let loaded = load_text(text).unwrap();
    let notes: Vec<&str> = loaded.notes.iter().map(|n| n.message.as_str()).collect();
    let [split] = notes[..] else {
        panic!("{notes:?}")
    };
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
