//! Transformations that differ between the start and the end of the exposure.

use antumbra_scene::Light;
use glam::{Mat4, Vec3};

use super::{load_text, world};

const TRIANGLE: &str =
    r#"Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0 1 0 0 0 1 0] "#;

#[test]
fn instances_move_from_the_start_to_the_end() {
    let scene = world(&format!(
        r#"ObjectBegin "a" {TRIANGLE} ObjectEnd
        Translate 1 0 0 ActiveTransform EndTime Translate 0 2 0 Rotate 90 0 0 1 ActiveTransform All Scale 2 2 2
        ObjectInstance "a""#
    ));
    let [instance] = scene.instances[..] else {
        panic!("one instance");
    };
    let end = instance.end.expect("it moves");
    assert!(scene.moves());
    let near = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-6, "{a} is not {b}");
    near(
        instance.world_from_object.transform_point3(Vec3::X),
        Vec3::new(3.0, 0.0, 0.0),
    );
    near(end.transform_point3(Vec3::X), Vec3::new(1.0, 4.0, 0.0));
}

/// A shape that moves becomes an object with an instance; others stay shapes.
#[test]
fn shapes_move_as_objects_of_their_own() {
    let scene = world(&format!(
        r#"{TRIANGLE} AttributeBegin AreaLightSource "diffuse" ActiveTransform EndTime Translate 0 0 3
        ActiveTransform All Translate 1 0 0 {TRIANGLE} AttributeEnd {TRIANGLE}"#
    ));
    assert_eq!(
        (
            scene.shapes.len(),
            scene.objects.len(),
            scene.instances.len()
        ),
        (2, 1, 1)
    );
    let instance = scene.instances[0];
    assert_eq!(instance.world_from_object.translation, Vec3::X);
    assert_eq!(
        instance.end.map(|end| end.translation),
        Some(Vec3::new(1.0, 0.0, 3.0))
    );
    assert!(scene.objects[0].shapes[0].area_light.is_none());
}

#[test]
fn cameras_move_and_the_shutter_counts_from_the_transform_times() {
    let loaded = load_text(
        r#"TransformTimes 1 3
        ActiveTransform EndTime Translate -1 0 0 ActiveTransform All
        Camera "perspective" "float shutteropen" 1.5 "float shutterclose" 2.5
        WorldBegin WorldEnd"#,
    )
    .unwrap();
    let camera = loaded.scene.camera;
    assert_eq!(camera.world_from_camera, Mat4::IDENTITY);
    assert_eq!(camera.end, Some(Mat4::from_translation(Vec3::X)));
    assert_eq!(camera.shutter, [0.25, 0.75]);
    let text = loaded
        .notes
        .iter()
        .map(ToString::to_string)
        .collect::<String>();
    assert!(text.contains("moves while the shutter is open"), "{text}");
}

#[test]
fn nothing_moves_where_both_transformations_are_equal() {
    let scene = world(&format!(
        r#"ActiveTransform StartTime Translate 1 0 0 ActiveTransform EndTime Translate 1 0 0
        ActiveTransform All {TRIANGLE}"#
    ));
    assert!(!scene.moves() && scene.instances.is_empty());
    assert_eq!(scene.shapes.len(), 1);
}

/// Shapes that are attached to a camera move with the camera, so they are not blurred in its picture.
#[test]
fn the_coordinate_system_of_a_camera_moves_with_the_camera() {
    let loaded = load_text(&format!(
        r#"ActiveTransform EndTime Translate -1 0 0 ActiveTransform All Camera "perspective"
        WorldBegin CoordSysTransform "camera" {TRIANGLE} WorldEnd"#
    ))
    .unwrap();
    let instance = loaded.scene.instances[0];
    assert_eq!(instance.world_from_object.translation, Vec3::ZERO);
    assert_eq!(instance.end.map(|end| end.translation), Some(Vec3::X));
}

#[test]
fn the_shutter_stays_finite_however_short_the_motion() {
    let text = r#"TransformTimes 0 1e-300 Camera "perspective" WorldBegin WorldEnd"#;
    let [open, close] = load_text(text).unwrap().scene.camera.shutter;
    assert_eq!(open, 0.0);
    assert!(close > 1.0 && (close - open).is_finite(), "{close}");
}

/// Media of a shape that moves are as media of other shapes: left out with a note where the integrator knows none.
#[test]
fn media_of_shapes_that_move_are_noted() {
    let loaded = load_text(&format!(
        r#"Integrator "path" WorldBegin MakeNamedMedium "m" "string type" "homogeneous" MediumInterface "m" ""
        ActiveTransform EndTime Translate 1 0 0 {TRIANGLE} WorldEnd"#
    ))
    .unwrap();
    let notes: Vec<String> = loaded.notes.iter().map(ToString::to_string).collect();
    assert!(notes.concat().contains("media are left out"), "{notes:?}");
}

/// Lights take the transformation at the start, as in pbrt-v3.
#[test]
fn lights_stay_at_the_start() {
    let loaded = load_text(
        r#"WorldBegin ActiveTransform StartTime Translate 1 2 3 ActiveTransform EndTime Translate 9 9 9
        LightSource "point" WorldEnd"#,
    )
    .unwrap();
    let [Light::Point { position, .. }] = loaded.scene.lights[..] else {
        panic!("one light");
    };
    assert_eq!(position, Vec3::new(1.0, 2.0, 3.0));
    assert!(!loaded.scene.moves());
    let notes: Vec<String> = loaded.notes.iter().map(ToString::to_string).collect();
    assert!(notes.concat().contains("lights do not move"), "{notes:?}");
}
