//! Estimates of the memory that a scene and its picture take.
//!
//! A file of a few lines can need more memory than any machine has. Running out of it would end the program
//! without a word.

use antumbra_scene::{Geometry, Instance, Scene};

use crate::{Error, MemorySize};

/// Bytes per stored triangle: its mesh, the kernel's geometry, the binary and the wide tree. Measured as the peak of
/// the whole program on the built-in city of 1 and 3 million triangles (245 to 256).
const PER_TRIANGLE: u64 = 256;
/// Bytes per stored curve. Measured as the peak of the whole program on 20,000 hairs of 11 segments each (700).
const PER_CURVE: u64 = 1024;
/// Bytes per instance in the scene, in the kernel and in the tree. Measured as the peak of the whole program on 400,000
/// instances of two triangles, spread out (1500), and on a million in one place (1250).
const PER_INSTANCE: u64 = 1440;
/// Bytes per pixel: sums, squares for the standard error, and the finished picture.
const PER_PIXEL: u64 = 128;
/// Bytes per pixel of layers beside that: 232 of a whole picture were measured, and a checkpoint's copy is 50.
const PER_PIXEL_OF_LAYERS: u64 = 160;
/// Samples of the pre-pass that learns are kept: bytes each, and their share of all samples.
const PER_LOGGED_SAMPLE: f64 = 12.0;
const LOGGED_SHARE: f64 = 0.01;

/// Refuses a scene that does not fit, before any tree is built over it. An estimate: scenes near the limit may be
/// misjudged by some tenths either way.
pub(crate) fn check(scene: &Scene, allowed: MemorySize) -> Result<(), Error> {
    let needed = MemorySize::new(geometry(scene));
    if needed <= allowed {
        return Ok(());
    }
    Err(Error::SceneTooLarge {
        scene: scene.name.clone(),
        triangles: scene.stored_triangle_count(),
        instances: scene.instances.len(),
        needed,
        allowed,
    })
}

/// Refuses a picture that does not fit beside its scene, with or without layers. `samples` is the number per pixel; `None`
/// is the scene's own.
///
/// # Errors
/// [`Error::PictureTooLarge`].
pub fn check_picture(
    scene: &Scene,
    samples: Option<u32>,
    layers: bool,
    allowed: MemorySize,
) -> Result<(), Error> {
    let per_pixel = match layers {
        true => PER_PIXEL + PER_PIXEL_OF_LAYERS,
        false => PER_PIXEL,
    };
    let [x0, x1, y0, y1] = scene.film.pixel_bounds().map(u64::from);
    let pixels = x1.saturating_sub(x0) * y1.saturating_sub(y0);
    let samples = samples.unwrap_or(scene.sampler.pixel_samples);
    let logged = pixels as f64 * f64::from(samples) * LOGGED_SHARE * PER_LOGGED_SAMPLE;
    let needed = pixels
        .saturating_mul(per_pixel)
        .saturating_add(logged as u64)
        .saturating_add(geometry(scene));
    let needed = MemorySize::new(needed);
    if needed <= allowed {
        return Ok(());
    }
    Err(Error::PictureTooLarge {
        scene: scene.name.clone(),
        pixels,
        samples,
        needed,
        allowed,
    })
}

fn geometry(scene: &Scene) -> u64 {
    let meshes = scene.stored_shapes().map(|shape| match &shape.geometry {
        Geometry::Mesh(mesh) => mesh.indices.len() as u64 * PER_TRIANGLE,
        Geometry::Sphere(_) => PER_TRIANGLE,
        Geometry::Curves(curves) => curves.first.len() as u64 * PER_CURVE,
    });
    let instances = scene.instances.len() as u64 * (PER_INSTANCE + size_of::<Instance>() as u64);
    meshes.fold(instances, u64::saturating_add)
}
