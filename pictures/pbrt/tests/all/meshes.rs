//! Meshes in separate files, which several threads read.

use std::sync::Arc;

use antumbra_pbrt::{Options, load};
use antumbra_scene::{Geometry, Scene, TriangleMesh};

use super::{OPTIONS, complaints, load_files};

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

/// A file in the format of gzip, by the decoder's own crate.
fn gzip(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn compressed_files_are_read_as_what_they_hold() {
    let text = b"WorldBegin Include \"part.pbrt.gz\" Shape \"plymesh\" \"string filename\" \"m.ply.gz\" WorldEnd";
    let part = gzip(b"Shape \"sphere\"");
    let mesh = gzip(&ply(9));
    let files: &[(&str, &[u8])] = &[
        ("s.pbrt", &gzip(text)),
        ("part.pbrt.gz", &part),
        ("m.ply.gz", &mesh),
    ];
    let scene = load_files(files).1.unwrap().scene;
    assert_eq!(scene.shapes.len(), 2);
    // One that ends too soon, and one of a gigabyte.
    let short = &mesh[..mesh.len() - 12];
    let mistakes = complaints(load_files(&[files[0], files[1], ("m.ply.gz", short)]).1);
    assert_eq!(mistakes.len(), 1, "{mistakes:?}");
    let bomb = gzip(&[&ply(9)[..], &vec![b' '; 1 << 26]].concat());
    let folder = tempfile::TempDir::new().unwrap();
    for (name, bytes) in [files[0], files[1], ("m.ply.gz", &bomb)] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let options = Options {
        max_memory: Some(1 << 20),
        ..OPTIONS
    };
    let mistakes = complaints(load(&folder.path().join("s.pbrt"), &options));
    assert!(mistakes[0].message.contains("limit"), "{}", mistakes[0]);
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
    // All shapes except the shapes of the valid mesh, and the material.
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
