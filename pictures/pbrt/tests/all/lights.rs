//! Lights with images.

use antumbra_scene::{Light, Pixels, Rgb};
use glam::{Mat3, Vec3};

use super::{complaints, load_files, world};

/// Grey PFM of 2 x 1 pixels.
const PFM: &[u8] = b"Pf 2 1 -1\n\0\0\0\0\0\0\x80\x3f";

/// Lights of a world block in the folder of `i.pfm`.
fn lights(text: &str) -> Vec<Light> {
    let text = format!("WorldBegin {text} WorldEnd");
    let (_folder, result) = load_files(&[("s.pbrt", text.as_bytes()), ("i.pfm", PFM)]);
    match result {
        Ok(loaded) => {
            assert_eq!(loaded.notes, []);
            loaded.scene.lights
        }
        Err(error) => panic!("{error}"),
    }
}

#[test]
fn skies_are_turned() {
    let lights = lights(
        r#"Translate 5 6 7 Scale -2 2 2 Rotate 90 0 0 1
        LightSource "infinite" "rgb L" [1 2 3] "rgb scale" [2 2 2] "string mapname" "i.pfm" "integer samples" 4
        LightSource "exinfinite" "string mapname" """#,
    );
    let [
        Light::Infinite {
            radiance,
            environment: Some(sky),
            samples: 4,
        },
        Light::Infinite {
            environment: None,
            samples: 1,
            ..
        },
    ] = &lights[..]
    else {
        panic!("{lights:?}")
    };
    assert_eq!(*radiance, Rgb::new(2.0, 4.0, 6.0));
    assert_eq!(sky.image.pixels, Pixels::Rgb32(vec![[0.0; 3], [1.0; 3]]));
    // Rotation first, then reflection, without scale or translation.
    let expected = Mat3::from_cols(Vec3::Y, Vec3::X, Vec3::Z);
    assert!(sky.world_from_light.abs_diff_eq(expected, 1e-6), "{sky:?}");
}

#[test]
fn goniometric_and_projection_lights() {
    let lights = lights(
        r#"Translate 1 2 3 Scale 1 2 1
        LightSource "goniometric" "rgb I" [1 2 3] "string mapname" "i.pfm"
        LightSource "projection" "rgb scale" [2 2 2] "float fov" 60 "string mapname" "i.pfm"
        LightSource "goniometric" LightSource "projection""#,
    );
    let [
        Light::Goniometric {
            world_from_light,
            intensity,
            image: Some(first),
        },
        Light::Projection {
            world_from_light: of_projection,
            intensity: scaled,
            fov,
            image: Some(second),
        },
        Light::Goniometric { image: None, .. },
        Light::Projection {
            image: None,
            fov: default_fov,
            ..
        },
    ] = &lights[..]
    else {
        panic!("{lights:?}")
    };
    assert_eq!(*intensity, Rgb::new(1.0, 2.0, 3.0));
    assert_eq!(*scaled, Rgb::splat(2.0));
    assert_eq!((*fov, *default_fov), (60.0, 45.0));
    let point = world_from_light.transform_point3(Vec3::ONE);
    assert_eq!(point, Vec3::new(2.0, 4.0, 4.0));
    assert_eq!(world_from_light, of_projection);
    assert!(std::sync::Arc::ptr_eq(first, second));
}

#[test]
fn a_sky_with_an_image_is_not_stretched() {
    let text =
        b"WorldBegin Scale 1 2 1\nLightSource \"infinite\" \"string mapname\" \"i.pfm\"\nWorldEnd";
    let (_folder, result) = load_files(&[("s.pbrt", text), ("i.pfm", PFM)]);
    let [only] = &complaints(result)[..] else {
        panic!()
    };
    assert_eq!((only.line, only.column), (2, 1));
    assert!(only.message.contains("scale that differs by axis"));
    // Without an image, the transformation does not matter.
    world("Scale 1 2 1 LightSource \"infinite\"");
}
