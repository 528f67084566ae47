//! Height fields and rational B-spline surfaces.

use antumbra_scene::{Geometry, TriangleMesh};
use glam::{DVec3, Vec2, Vec3};

use super::{load_text, world};

fn mesh(text: &str) -> TriangleMesh {
    match &world(text).shapes[0].geometry {
        Geometry::Mesh(mesh) => (**mesh).clone(),
        other => panic!("{other:?}"),
    }
}

/// The message about a shape that is refused.
fn refused(text: &str) -> String {
    let error = load_text(&format!("WorldBegin Shape {text} WorldEnd")).err();
    error.unwrap_or_else(|| panic!("{text}")).to_string()
}

#[test]
fn height_fields() {
    let found = mesh(
        r#"Translate 0 0 10 Shape "heightfield" "integer nu" 3 "integer nv" 2 "float Pz" [0 1 2 3 4 5]"#,
    );
    let expected = [
        [0.0, 0.0, 10.0],
        [0.5, 0.0, 11.0],
        [1.0, 0.0, 12.0],
        [0.0, 1.0, 13.0],
        [0.5, 1.0, 14.0],
        [1.0, 1.0, 15.0],
    ];
    assert_eq!(found.positions, expected);
    assert!(found.normals.is_empty());
    let uvs = expected.map(|p| Vec2::new(p[0], p[1]));
    assert_eq!(found.uvs, uvs);
    assert_eq!(found.indices, [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]);
}

#[test]
fn broken_height_fields() {
    for (text, expected) in [
        (r#""heightfield""#, "needs a parameter \"nu\""),
        (
            r#""heightfield" "integer nu" 2 "integer nv" 2"#,
            "needs a parameter \"Pz\"",
        ),
        (
            r#""heightfield" "integer nu" 1 "integer nv" 2 "float Pz" [1 2]"#,
            "\"nu\" must be at least 2, found 1",
        ),
        (
            r#""heightfield" "integer nu" 2 "integer nv" 2 "float Pz" [1 2 3]"#,
            "\"Pz\" has 3 values, but nu x nv is 2 x 2 = 4",
        ),
    ] {
        let found = refused(text);
        assert!(found.contains(expected), "{text}: {found}");
    }
}

/// A quarter of a cylinder: a rational quadratic arc is an exact circle.
#[test]
fn rational_arcs_are_circles() {
    let root = 0.5_f64.sqrt();
    let points: String = [0.0, 3.0]
        .iter()
        .flat_map(|z| {
            [
                format!("1 0 {z} 1 "),
                format!("{root} {root} {} {root} ", z * root),
                format!("0 1 {z} 1 "),
            ]
        })
        .collect();
    let found = mesh(&format!(
        r#"Shape "nurbs" "integer nu" 3 "integer uorder" 3 "float uknots" [2 2 2 6 6 6]
        "integer nv" 2 "integer vorder" 2 "float vknots" [0 0 1 1] "float Pw" [{points}]"#
    ));
    assert_eq!(found.positions.len(), 900);
    assert_eq!(found.indices.len(), 2 * 29 * 29);
    for (i, position) in found.positions.iter().enumerate() {
        let p = DVec3::from(position.map(f64::from));
        assert!((p.truncate().length() - 1.0).abs() < 1e-6, "{p}");
        assert!((p.z - 3.0 * f64::from(found.uvs[i].y)).abs() < 1e-5, "{p}");
        let out = Vec3::new(position[0], position[1], 0.0);
        assert!((found.normals[i] - out).length() < 1e-5);
    }
    let [first, last] = [found.uvs[0], found.uvs[899]];
    assert_eq!((first, last), (Vec2::new(2.0, 0.0), Vec2::new(6.0, 1.0)));
}

/// Control points of a polynomial by its blossom give the polynomial back, over uneven and repeated knots.
#[test]
fn cubics_are_reproduced() {
    let knots = [0.0, 0.0, 0.0, 0.0, 1.0, 3.0, 3.0, 4.0, 4.0, 4.0, 4.0];
    let heights: Vec<f64> = (0..7)
        .map(|i| knots[i + 1] * knots[i + 2] * knots[i + 3])
        .collect();
    let across: Vec<f64> = (0..7)
        .map(|i| (knots[i + 1] + knots[i + 2] + knots[i + 3]) / 3.0)
        .collect();
    let points: String = [-1.0, 1.0]
        .iter()
        .flat_map(|y| (0..7).map(move |i| (i, y)))
        .map(|(i, y)| format!("{} {y} {} ", across[i], heights[i]))
        .collect();
    let text = format!(
        r#"Shape "nurbs" "integer nu" 7 "integer uorder" 4 "float uknots" {knots:?}
        "integer nv" 2 "integer vorder" 2 "float vknots" [0 0 1 1] "point P" [{points}] "float u0" 0.5 "float u1" 3.5"#
    );
    let found = mesh(&text.replace(',', ""));
    for (i, [x, y, z]) in found.positions.iter().enumerate() {
        let Vec2 { x: u, y: v } = found.uvs[i];
        assert!((0.5..=3.5).contains(&u));
        assert!((x - u).abs() < 1e-5 && (y - (2.0 * v - 1.0)).abs() < 1e-5);
        assert!((z - u * u * u).abs() < 1e-4, "{u}: {z}");
        let slope = Vec3::new(-3.0 * u * u, 0.0, 1.0).normalize();
        assert!((found.normals[i] - slope).length() < 1e-4, "{u}");
    }
}

#[test]
fn broken_nurbs() {
    let u = r#""nurbs" "integer nu" 2 "integer uorder" 2 "float uknots" [0 0 1 1]"#;
    let v = r#""integer nv" 2 "integer vorder" 2 "float vknots" [0 0 1 1]"#;
    for (text, expected) in [
        (r#""nurbs""#.to_owned(), "needs a parameter \"nu\""),
        (format!("{u} {v}"), "needs a parameter \"P\""),
        (
            format!("{u} {v} \"point P\" [0 0 0 1 1 1]"),
            "found 2 control points, but nu x nv is 4",
        ),
        (
            format!("{u} {v} \"float Pw\" [0 0 0 1 1 1]"),
            "6 values of \"Pw\" do not make points",
        ),
        (
            format!("{u} {v} \"float Pw\" [0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0]"),
            "add up to 0",
        ),
        (
            format!("{u} {}", v.replace("0 0 1 1", "0 0 1")),
            "\"vknots\" has 3 values, not \"nv\" + \"vorder\" = 2 + 2",
        ),
        (
            format!("{u} {}", v.replace("0 0 1 1", "0 1 0 1")),
            "\"vknots\" must not descend, found 0",
        ),
        (
            format!("{u} {} ", v.replace("vorder\" 2", "vorder\" 3")),
            "\"nv\" is 2, less than \"vorder\", 3",
        ),
        (
            format!("{u} {v} \"float u1\" 2"),
            "\"u1\" must be from 0 to 1, found 2",
        ),
        (
            format!("{u} {v} \"float u1\" 0"),
            "no surface: \"u0\" equals \"u1\"",
        ),
    ] {
        let found = refused(&text);
        assert!(found.contains(expected), "{text}: {found}");
    }
}
