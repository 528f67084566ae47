//! Meshes in separate files, which several threads read.

use std::sync::Arc;

use antumbra_scene::{Geometry, Scene, TriangleMesh};

use super::{complaints, load_files};

/// Mesh of many points on a line and one triangle.
fn ply(points: usize) -> Vec<u8> {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {points}\nproperty float x\nproperty float y\n\
         property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    );
    for i in 0..points {
        text += &format!("{i} 0 0\n");
    }
    text += "3 0 1 2\n";
    text.into_bytes()
}

fn mesh(scene: &Scene, shape: usize) -> &Arc<TriangleMesh> {
    match &scene.shapes[shape].geometry {
        Geometry::Mesh(mesh) => mesh,
        other => panic!("{other:?} is not a mesh"),
    }
}

#[test]
fn every_shape_gets_its_own_mesh() {
    let files: Vec<(String, Vec<u8>)> = (3..40).map(|n| (format!("{n}.ply"), ply(n))).collect();
    let mut text = String::from("WorldBegin ObjectBegin \"o\"\n");
    for n in 3..40 {
        text += &format!("Shape \"plymesh\" \"string filename\" \"{n}.ply\"\n");
    }
    text += "ObjectEnd ObjectInstance \"o\"\n";
    for n in (3..40).rev() {
        text += &format!("Translate 0 1 0 Shape \"plymesh\" \"string filename\" \"{n}.ply\"\n");
    }
    text += "WorldEnd\n";
    let mut all: Vec<(&str, &[u8])> = vec![("s.pbrt", text.as_bytes())];
    all.extend(files.iter().map(|(name, bytes)| (&name[..], &bytes[..])));
    let scene = load_files(&all).1.unwrap().scene;
    for (n, shape) in (3..40).zip(&scene.objects[0].shapes) {
        let Geometry::Mesh(mesh) = &shape.geometry else {
            panic!()
        };
        assert_eq!(mesh.positions.len(), n);
    }
    for (index, n) in (3..40).rev().enumerate() {
        let mesh = mesh(&scene, index);
        assert_eq!(mesh.positions.len(), n);
        assert_eq!(mesh.positions[2], [2.0, index as f32 + 1.0, 0.0]);
    }
}

#[test]
fn a_file_in_the_same_place_is_one_mesh() {
    let shape = r#"Shape "plymesh" "string filename" "m.ply" "#;
    let text = format!("WorldBegin {shape} {shape} Translate 1 0 0 {shape} WorldEnd");
    let (_folder, result) = load_files(&[("s.pbrt", text.as_bytes()), ("m.ply", &ply(3))]);
    let scene = result.unwrap().scene;
    let [first, again, moved] = [0, 1, 2].map(|shape| mesh(&scene, shape));
    assert!(Arc::ptr_eq(first, again) && !Arc::ptr_eq(first, moved));
}

#[test]
fn broken_meshes_are_reported_in_order_of_the_file() {
    let mut text = String::from("WorldBegin\n");
    for n in 0..30 {
        text += &format!("Shape \"plymesh\" \"string filename\" \"{}.ply\"\n", n % 10);
    }
    text += "Material \"mate\"\nWorldEnd";
    let (_folder, result) = load_files(&[("s.pbrt", text.as_bytes()), ("3.ply", &ply(3))]);
    let lines: Vec<u32> = complaints(result).iter().map(|d| d.line).collect();
    // All shapes except those of the valid mesh, and the material.
    let expected: Vec<u32> = (2..33)
        .filter(|line| (line - 2) % 10 != 3 || *line == 32)
        .collect();
    assert_eq!(lines, expected);
}

#[test]
fn meshes_that_nobody_sees_are_not_read() {
    let shape = r#"Shape "plymesh" "string filename" "no.ply""#;
    let text = format!("WorldBegin ObjectBegin \"o\" {shape} ObjectEnd WorldEnd");
    let (_folder, result) = load_files(&[("s.pbrt", text.as_bytes())]);
    assert!(result.unwrap().scene.objects[0].shapes.is_empty());
    let text =
        format!("WorldBegin ObjectBegin \"o\" {shape} ObjectEnd ObjectInstance \"o\" WorldEnd");
    let (_folder, result) = load_files(&[("s.pbrt", text.as_bytes())]);
    assert_eq!(complaints(result).len(), 1);
}
