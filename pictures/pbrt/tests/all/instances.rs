//! Objects and instances.

use antumbra_pbrt::Severity;
use antumbra_scene::{Geometry, Material, Scene};
use glam::Vec3;

use super::{complaints, load_text, world};

const TRIANGLE: &str =
    r#"Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0] "#;

/// Object with normals that stay equal when they are scaled to unit length again.
const SMOOTH: &str = r#"Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0.5 0 0.25 1 3 0 0 1 -7]
    "normal N" [0 0 1 1 0 0 0 -1 0] "#;

/// Checks that a flattened scene equals the scene that was written by hand without instances.
fn assert_same(instanced: &str, by_hand: &str) {
    let (instanced, by_hand) = (world(instanced), world(by_hand));
    assert!(!instanced.instances.is_empty() && by_hand.instances.is_empty());
    assert_eq!(*instanced.flattened().unwrap(), by_hand);
    assert_eq!(instanced.triangle_count(), by_hand.triangle_count());
}

/// Flattening with transformations that are exact in floating point.
#[test]
fn instances_are_the_shapes_written_out_by_hand() {
    let things = format!(
        r#"Material "mirror" Translate 2 0 0 {TRIANGLE}
        AttributeBegin ReverseOrientation Scale 1 1 -1 {SMOOTH} AttributeEnd
        Material "matte" Scale 2 2 2 Shape "sphere" "float radius" 0.5 "#
    );
    let places = [
        "Translate 8 0 -4",
        "Scale -1 1 1 Translate 1 2 4",
        "Scale -1 -1 1",
        "Scale 4 4 4 Translate 0 0 16",
    ];
    let instances: String = places
        .iter()
        .map(|place| format!("AttributeBegin {place} ObjectInstance \"a\" AttributeEnd\n"))
        .collect();
    let by_hand: String = places
        .iter()
        .map(|place| format!("AttributeBegin {place} {things} AttributeEnd\n"))
        .collect();
    assert_same(
        &format!(r#"ObjectBegin "a" {things} ObjectEnd {instances}"#),
        &by_hand,
    );
}

/// World transformation: instance times shape, including the transformation at ObjectBegin.
#[test]
fn the_transformation_at_the_definition_comes_first() {
    assert_same(
        &format!(
            r#"TransformBegin Translate 1 0 0 ObjectBegin "a" Scale 2 2 2 {TRIANGLE} ObjectEnd TransformEnd
            Scale 4 1 1 ObjectInstance "a""#
        ),
        &format!("Scale 4 1 1 Translate 1 0 0 Scale 2 2 2 {TRIANGLE}"),
    );
}

fn x_of(scene: &Scene, shape: usize) -> f32 {
    let flat = scene.flattened().unwrap();
    match &flat.shapes[shape].geometry {
        Geometry::Mesh(mesh) => mesh.positions[0][0],
        Geometry::Sphere(sphere) => sphere.center.x,
        Geometry::Curves(curves) => curves.points[0][0],
    }
}

#[test]
fn objects_keep_what_was_in_force_where_they_were_defined() {
    let scene = world(&format!(
        r#"Material "mirror"
        ObjectBegin "a" Translate 1 0 0 {TRIANGLE} Material "glass" {TRIANGLE} ObjectEnd
        ObjectBegin "empty" ObjectEnd
        ObjectBegin "unused" {TRIANGLE} ObjectEnd
        {TRIANGLE}
        Material "plastic" ReverseOrientation
        ObjectInstance "a" ObjectInstance "empty""#
    ));
    assert_eq!(scene.shapes.len(), 1);
    let names: Vec<_> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["a", "empty", "unused"]);
    let counts: Vec<_> = scene.objects.iter().map(|o| o.shapes.len()).collect();
    // Objects without instances lose their shapes.
    assert_eq!(counts, [2, 0, 0]);
    let objects: Vec<_> = scene.instances.iter().map(|i| i.object).collect();
    assert_eq!(objects, [0, 1]);
    let [first, second] = &scene.objects[0].shapes[..] else {
        panic!("two shapes")
    };
    let material = |index: usize| &scene.materials[index];
    assert!(matches!(material(first.material), Material::Mirror(_)));
    assert!(matches!(material(second.material), Material::Glass(_)));
    assert!(!first.reverse_orientation);
    // ObjectEnd restored the transformation and the material.
    assert_eq!(x_of(&scene, 0), 0.0);
    assert!(matches!(
        material(scene.shapes[0].material),
        Material::Mirror(_)
    ));
    assert_eq!(
        (scene.triangle_count(), scene.stored_triangle_count()),
        (3, 3)
    );
}

#[test]
fn a_name_means_the_object_that_had_it_last() {
    let scene = world(&format!(
        r#"ObjectBegin "a" Translate 1 0 0 {TRIANGLE} ObjectEnd ObjectInstance "a"
        ObjectBegin "a" Translate 2 0 0 {TRIANGLE} ObjectEnd ObjectInstance "a""#
    ));
    assert_eq!([x_of(&scene, 0), x_of(&scene, 1)], [1.0, 2.0]);
}

#[test]
fn instances_have_the_transformation_in_force() {
    let scene =
        world(r#"ObjectBegin "a" ObjectEnd Translate 1 2 3 Scale 1 1 -2 ObjectInstance "a""#);
    let [instance] = &scene.instances[..] else {
        panic!("one instance")
    };
    assert!(instance.swaps_handedness());
    let moved = instance.world_from_object.transform_point3(Vec3::ONE);
    assert_eq!(moved, Vec3::new(2.0, 3.0, 1.0));
}

#[test]
fn area_lights_of_objects_are_noted_and_left_out() {
    let text = format!(
        r#"WorldBegin ObjectBegin "a" AreaLightSource "diffuse" {TRIANGLE} {TRIANGLE} ObjectEnd
        ObjectInstance "a" {TRIANGLE} WorldEnd"#
    );
    let loaded = load_text(&text).unwrap();
    let [note] = &loaded.notes[..] else {
        panic!("one note: {:?}", loaded.notes)
    };
    assert_eq!((note.severity, note.line), (Severity::Note, 1));
    assert!(note.message.contains("area lights of objects"));
    let scene = loaded.scene;
    assert!(scene.standing_shapes().all(|s| s.area_light.is_none()));
}

#[test]
fn every_misplaced_object_is_reported() {
    let text = "WorldBegin\nObjectBegin \"tree\" ObjectEnd\nObjectBegin \"a\"\n ObjectInstance \"tree\"\n\
        ObjectEnd\nObjectInstance \"tre\"\nScale 1 0 1\nObjectInstance \"tree\"\nWorldEnd";
    let found = complaints(load_text(text));
    let places: Vec<_> = found.iter().map(|d| (d.line, d.column)).collect();
    assert_eq!(places, [(4, 2), (6, 16), (8, 1)]);
    assert!(found[0].message.contains("ObjectBegin of line 3"));
    assert_eq!(found[1].help.as_deref(), Some("did you mean \"tree\"?"));
}
