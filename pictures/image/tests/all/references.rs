//! Reference images of the shared scenes: 32-bit means and 16-bit standard errors of another renderer.

use std::io::Write;
use std::path::PathBuf;

use antumbra_image::Image;
use antumbra_image::compare::{Options, StandardErrors, compare};

/// Reference images and their standard errors, sorted by name; `None` if they are missing.
fn references() -> Option<Vec<(PathBuf, PathBuf)>> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/references");
    let Ok(entries) = std::fs::read_dir(folder) else {
        // Not `println!`, whose output is hidden when a test passes.
        let _ = std::io::stderr().write_all(b"skipped: no shared scenes\n");
        return None;
    };
    let mut pairs: Vec<_> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.to_string_lossy().ends_with(".stderr.exr"))
        .map(|errors| {
            let mean = errors.to_string_lossy().replace(".stderr.exr", ".exr");
            (PathBuf::from(mean), errors)
        })
        .collect();
    pairs.sort();
    assert!(!pairs.is_empty());
    Some(pairs)
}

#[test]
fn references_load_and_make_sense() {
    for (mean, errors) in references().into_iter().flatten() {
        let image = Image::read(&mean).unwrap();
        let error = Image::read(&errors).unwrap();
        println!("{}: mean {:?}", mean.display(), image.mean());
        assert_eq!(image.width(), 200);
        assert_eq!(image.window(), error.window());
        assert_eq!((image.non_finite(), error.non_finite()), (0, 0));
        assert!(error.pixels().as_flattened().iter().all(|&e| e >= 0.0));
        let zeros = error.pixels().iter().filter(|e| e.contains(&0.0)).count();
        println!("  pixels without error in some channel: {zeros}");
        // Half floats: rounding to 11 bits changes nothing.
        for &value in error.pixels().as_flattened() {
            let half = exr::prelude::f16::from_f32(value);
            assert_eq!(half.to_f32(), value);
        }
    }
}

/// Channel means printed in the README of the references, to the digits given there.
#[test]
fn means_are_those_documented() {
    let known = [
        ("sponza", [0.4730, 0.3707, 0.2615]),
        ("sibenik", [0.4128, 0.3532, 0.2869]),
        ("bathroom", [0.7770, 0.6791, 0.6209]),
        ("scans", [0.2380, 0.2189, 0.1868]),
    ];
    for (path, _) in references().into_iter().flatten() {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if let Some((_, expected)) = known.iter().find(|(known, _)| *known == name) {
            let mean = Image::read(&path).unwrap().mean();
            for (mean, expected) in mean.iter().zip(expected) {
                assert!((mean - expected).abs() < 1e-4, "{name}: {mean}");
            }
        }
    }
}

#[test]
fn a_reference_passes_against_itself_and_fails_when_brightened() {
    for (mean, errors) in references().into_iter().flatten() {
        let reference = Image::read(&mean).unwrap();
        let error = Image::read(&errors).unwrap();
        let errors = StandardErrors {
            image: Some(&error),
            reference: Some(&error),
        };
        let options = Options::default();
        let same = compare(&reference, &reference, errors, &options).unwrap();
        let test = same.z.unwrap();
        assert!(test.pass && test.beyond == 0 && test.worst.z == 0.0);

        let mut bright = reference.clone();
        for (pixel, error) in bright.pixels_mut().iter_mut().zip(error.pixels()) {
            for (value, error) in pixel.iter_mut().zip(error) {
                *value += 8.0 * error + 1e-3;
            }
        }
        let test = compare(&bright, &reference, errors, &options)
            .unwrap()
            .z
            .unwrap();
        assert!(!test.pass && test.worst.z > 0.0, "{}", mean.display());
    }
}
