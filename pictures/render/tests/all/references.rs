//! Pictures of the shared scenes against references made with pbrt-v3.
//!
//! Few samples, so that the test is quick: the limits allow for chance at that number. The example
//! `reference` does the same with many.

use std::io::Write;
use std::path::Path;

use crate::support::*;
use antumbra_image::{Image, compare};
use antumbra_scene::Filter;

/// Means of the channels may differ by so much.
const MEAN_TOLERANCE: f64 = 0.01;

const SAMPLES: u32 = 32;

/// The picture's own standard error, or what the reference predicts for so few samples if that is larger. A
/// dark pixel that missed the rare bright paths does not know how uncertain it is; the reference, with its
/// thousands of samples, does.
fn expected_error(own: &Image, reference: &Image, reference_samples: u32) -> Image {
    let scale = (reference_samples as f32 / SAMPLES as f32).sqrt();
    Image::from_fn(own.width(), own.height(), own.window(), |x, y| {
        let at = |image: &Image| image.get(x, y).expect("pictures of one size");
        let (own, reference) = (at(own), at(reference));
        std::array::from_fn(|channel| own[channel].max(reference[channel] * scale))
    })
    .expect("a valid window")
}

/// Renders a scene whose reference has so many samples.
fn check(name: &str, reference_samples: u32) {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let path = shared
        .join("scenes")
        .join(name)
        .join(format!("{name}.pbrt"));
    let references = shared.join("references");
    if !path.exists() || !references.exists() {
        // Not `println!`, which a passing test keeps to itself.
        let _ = std::io::stderr().write_all(b"skipped: no shared scenes\n");
        return;
    }
    let mut scene = antumbra_pbrt::load(&path, &Default::default())
        .expect("the shared scenes are valid")
        .scene;
    let read = |file: String| Image::read(references.join(file)).expect("a readable picture");
    let reference = read(format!("{name}.exr"));
    let reference_error = read(format!("{name}.stderr.exr"));
    scene.film.resolution = [reference.width() as u32, reference.height() as u32];
    scene.film.filter = Filter::default();
    let rendering = picture(&scene, SAMPLES);
    let own = rendering.standard_error.as_ref().expect("asked for");
    let error = expected_error(own, &reference_error, reference_samples);
    let errors = compare::StandardErrors {
        image: Some(&error),
        reference: Some(&reference_error),
    };
    let options = compare::Options {
        rounding: 1e-5,
        ..Default::default()
    };
    let found = compare::compare(&rendering.image, &reference, errors, &options)
        .expect("pictures of one size");
    assert!(
        found.z.as_ref().is_some_and(|z| z.pass),
        "{name}: {found:#?}"
    );
    for difference in found.mean_difference {
        assert!(difference.abs() < MEAN_TOLERANCE, "{name}");
    }
    assert_eq!(rendering.stats.dropped_samples, 0);
}

#[test]
fn sponza() {
    check("sponza", 2048);
}

#[test]
fn sibenik() {
    check("sibenik", 2048);
}

#[test]
fn bathroom() {
    check("bathroom", 2048);
}

#[test]
fn microcity() {
    check("microcity", 4096);
}

#[test]
fn sanmiguel() {
    check("sanmiguel", 320);
}

#[test]
fn pavilion() {
    check("pavilion", 4096);
}

#[test]
fn ingolstadt() {
    check("ingolstadt", 4096);
}

#[test]
fn ecosys() {
    check("ecosys", 384);
}

#[test]
fn buddha_fractal() {
    check("buddha-fractal", 2048);
}

#[test]
fn scans() {
    check("scans", 2560);
}
