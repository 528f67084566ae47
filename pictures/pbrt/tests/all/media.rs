//! Participating media: what is read, and which shapes have them.

use crate::*;
use antumbra_scene::{Integrator, MediumInterface, Rgb};
use glam::{Mat4, Vec3};

#[test]
fn media_are_read_with_the_defaults_of_pbrt() {
    let (scene, notes) = load_text(
        r#"Integrator "volpath"
        MakeNamedMedium "milk" "string type" "homogeneous"
        WorldBegin
        Translate 1 2 3
        MakeNamedMedium "cola" "string type" "homogeneous" "string preset" "Coke" "float scale" 10
            "rgb sigma_s" [1 2 3] "float g" -0.5
        MakeNamedMedium "smoke" "string type" "heterogeneous" "integer nx" 1 "integer ny" 2 "integer nz" 1
            "float density" [0.5 2] "point p0" [-1 0 0] "point p1" [1 1 4]
        WorldEnd"#,
    )
    .map(|loaded| (loaded.scene, loaded.notes))
    .unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    assert!(matches!(
        scene.integrator,
        Integrator::VolumePath { max_depth: 5, .. }
    ));
    let [milk, cola, smoke] = &scene.media[..] else {
        panic!("{:?}", scene.media);
    };
    assert_eq!(milk.absorption, Rgb::new(0.0011, 0.0024, 0.014));
    assert_eq!(
        (milk.scattering, milk.asymmetry),
        (Rgb::new(2.55, 3.21, 3.77), 0.0)
    );
    assert_eq!(cola.absorption, Rgb::new(0.10014, 0.16503, 0.2468) * 10.0);
    assert_eq!(
        (cola.scattering, cola.asymmetry),
        (Rgb::new(10.0, 20.0, 30.0), -0.5)
    );
    let grid = smoke.density.as_ref().unwrap();
    assert_eq!((grid.size, &grid.values[..]), ([1, 2, 1], &[0.5, 2.0][..]));
    let box_of_grid = Mat4::from_translation(Vec3::new(0.0, 2.0, 3.0))
        * Mat4::from_scale(Vec3::new(2.0, 1.0, 4.0));
    assert_eq!(grid.world_from_grid, box_of_grid);
}

/// Only surfaces between two media change them. The camera has the medium outside when the world ends.
#[test]
fn interfaces_have_the_scope_of_attributes() {
    let scene = load_text(
        r#"MakeNamedMedium "a" "string type" "homogeneous"
        MakeNamedMedium "b" "string type" "homogeneous"
        Integrator "bdpt"
        MediumInterface "" "b"
        WorldBegin
        AttributeBegin MediumInterface "a" "b" Shape "sphere" AttributeEnd
        AttributeBegin MediumInterface "b" Shape "sphere" AttributeEnd
        Shape "sphere"
        WorldEnd"#,
    )
    .unwrap()
    .scene;
    let media: Vec<_> = scene.shapes.iter().map(|shape| shape.media).collect();
    let between = |inside, outside| Some(MediumInterface { inside, outside });
    assert_eq!(
        media,
        [between(Some(0), Some(1)), None, between(None, Some(1))]
    );
    assert_eq!(scene.camera.medium, Some(1));
}

#[test]
fn media_that_play_no_part_are_noted() {
    let text = r#"WorldBegin MakeNamedMedium "a" "string type" "homogeneous"
        MediumInterface "a" "" Shape "sphere" MediumInterface "x" "" Shape "sphere" WorldEnd"#;
    let (scene, notes) = tolerated(text);
    let notes: Vec<_> = notes.iter().map(|note| note.message.as_str()).collect();
    assert!(
        notes
            .iter()
            .any(|note| note.contains("no medium is named \"x\"")),
        "{notes:?}"
    );
    assert!(
        notes.iter().any(|note| note.contains("only volpath")),
        "{notes:?}"
    );
    assert_eq!(scene.shapes[1].media, None);
}

/// Fog around the camera, with a light at infinity: dark unless a shape ends the fog, or it is thin as on a grid.
#[test]
fn endless_media_are_noted_if_they_keep_light_out() {
    let lost = |medium: &str, shape: &str, lights: &str| {
        let text = format!(
            r#"Integrator "volpath" MakeNamedMedium "fog" {medium} MediumInterface "" "fog"
            Camera "perspective" WorldBegin {shape} {lights} WorldEnd"#
        );
        let (scene, notes) = tolerated(&text);
        assert_eq!(scene.camera.medium, Some(0), "{text}");
        let note = notes
            .iter()
            .find(|note| note.message.contains("has no end"));
        note.map(|note| note.message.clone())
    };
    let fog = r#""string type" "homogeneous""#;
    let wall = r#"AttributeBegin MediumInterface "" "" Shape "sphere" AttributeEnd"#;
    let sky = r#"LightSource "infinite" LightSource "point" LightSource "distant""#;
    let note = lost(fog, wall, sky).expect("a note");
    assert!(note.contains("2 of the lights"), "{note}");
    assert_eq!(lost(fog, wall, r#"LightSource "point""#), None);
    let end = r#"AttributeBegin MediumInterface "fog" "" Shape "sphere" AttributeEnd"#;
    assert_eq!(lost(fog, end, sky), None);
    let clear = r#""string type" "homogeneous" "rgb sigma_a" [0 0 0] "rgb sigma_s" [0 0 0]"#;
    assert_eq!(lost(clear, wall, sky), None);
    let grid = r#""string type" "heterogeneous" "float density" [1] "integer nx" 1 "integer ny" 1 "integer nz" 1"#;
    assert_eq!(lost(grid, wall, sky), None);
}
