//! A .pbrt text all the way to a picture of a few pixels.
#![no_main]

use std::path::Path;

use antumbra_pbrt::parse;
use antumbra_render::{Options, World, render};
use antumbra_scene::{Filter, Integrator, Light, Scene};
use libfuzzer_sys::fuzz_target;

/// Takes away what makes a scene slow, not wrong.
fn shorten(scene: &mut Scene) {
    scene.film.resolution = scene.film.resolution.map(|size| size.min(4));
    scene.sampler.pixel_samples = 1;
    if let Filter::Box { radius } | Filter::Triangle { radius } = &mut scene.film.filter {
        *radius = radius.map(|r| r.min(3.0));
    }
    match &mut scene.integrator {
        Integrator::Path { max_depth, .. } | Integrator::VolumePath { max_depth, .. } => {
            *max_depth = (*max_depth).min(4);
        }
        Integrator::DirectLighting { max_depth, .. } => *max_depth = (*max_depth).min(3),
        Integrator::AmbientOcclusion { samples, .. } => *samples = (*samples).min(4),
    }
    for shape in &mut scene.shapes {
        if let Some(light) = &mut shape.area_light {
            light.samples = light.samples.min(2);
        }
    }
    for light in &mut scene.lights {
        if let Light::Infinite { samples, .. } = light {
            *samples = (*samples).min(2);
        }
    }
}

fuzz_target!(|text: &[u8]| {
    let path = Path::new("/nowhere/scene.pbrt");
    let Ok(loaded) = parse(text.to_vec(), path, &antumbra_pbrt::Options::default()) else {
        return;
    };
    let mut scene = loaded.scene;
    shorten(&mut scene);
    if scene.film.is_empty() || scene.triangle_count() > 20_000 {
        return;
    }
    let Ok(world) = World::new(&scene) else {
        return;
    };
    let options = Options {
        spp: Some(1),
        ..Options::default()
    };
    if let Ok(rendering) = render(&world, &options, &()) {
        let finite = |pixel: &[f32; 3]| pixel.iter().all(|value| !value.is_nan());
        assert!(rendering.image.pixels().iter().all(finite));
    }
});
