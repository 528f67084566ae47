//! Layers beside the colours: what the first surface of every camera ray is like, for denoisers and compositing.

use antumbra::Isa;
use antumbra::recipe::Engine;
use antumbra_image::Window;
use glam::Vec3;
use rayon::prelude::*;

use crate::Error;
use crate::film::Sample;
use crate::integrator::{Batch, Hits, Observe, Tracer, shade};
use crate::sampler::{Method, Sampler};
use crate::surface::Frame;
use crate::world::World;

/// Means over the first surfaces that the samples of every pixel hit.
///
/// Lists have a value for every pixel of the window, row by row. Every sample counts alike, whatever the filter. Samples
/// that hit nothing count as black for the albedo, and not at all for the other layers. Pixels without a surface are 0.
#[derive(Clone, Debug)]
pub struct Layers {
    /// Pixels that are covered.
    pub window: Window,
    /// Light that the surface reflects or lets through, of light from all around.
    pub albedo: Vec<Vec3>,
    /// Geometric normal on the side of the camera, in the world.
    pub normal: Vec<Vec3>,
    /// Shading normal, bump and normal maps included, in the world.
    pub shading_normal: Vec<Vec3>,
    /// Mean position in the world.
    pub position: Vec<Vec3>,
    /// Distance from the camera along its axis.
    pub depth: Vec<f32>,
}

/// Values of one pixel.
#[derive(Clone, Copy, Default)]
struct Pixel {
    albedo: Vec3,
    normal: Vec3,
    shading_normal: Vec3,
    position: Vec3,
    depth: f32,
}

impl Layers {
    /// Traces the camera rays of the first `samples` samples of every pixel, in the current rayon pool. They are the rays of
    /// a picture with `spp` samples per pixel and this seed. `texture_spp` is as in
    /// [`Options`](crate::Options::texture_spp).
    ///
    /// # Errors
    /// [`Error::NoSamples`].
    pub fn trace(
        world: &World,
        isa: Isa,
        [spp, samples]: [u32; 2],
        texture_spp: Option<u32>,
        seed: u64,
    ) -> Result<Self, Error> {
        let samples = samples.min(spp);
        if samples == 0 {
            return Err(Error::NoSamples {
                what: "samples of layers",
            });
        }
        let [x0, x1, y0, y1] = world.film.pixel_bounds().map(|bound| bound as i32);
        let window = Window { x0, y0, x1, y1 };
        let bvh = world.bvh(Engine::of(isa));
        let moving = world.moving(&bvh)?;
        let sampler = Sampler::new(Method::of(world.sampler.kind, spp), seed);
        let rows: Vec<Vec<Pixel>> = (y0..y1)
            .into_par_iter()
            .map(|y| {
                let mut tracer = Tracer::new(&bvh, Observe::Nothing).moving(world, moving.as_ref());
                let mut hits = Hits::default();
                let mut batch = Batch::default();
                let pixel = |x: i32| {
                    batch.clear();
                    for index in 0..samples {
                        let pixel = [x, y];
                        batch.push(&world.camera, &sampler, Sample { pixel, index });
                    }
                    tracer.begin(&batch.times);
                    hits.find(&mut tracer, &batch.rays, 0..samples);
                    batch.step = 1.0 / (texture_spp.unwrap_or(spp).max(1) as f32).sqrt();
                    mean(world, &batch, &mut hits)
                };
                (x0..x1).map(pixel).collect()
            })
            .collect();
        let mut layers = Self {
            window,
            albedo: Vec::with_capacity(window.area()),
            normal: Vec::with_capacity(window.area()),
            shading_normal: Vec::with_capacity(window.area()),
            position: Vec::with_capacity(window.area()),
            depth: Vec::with_capacity(window.area()),
        };
        for pixel in rows.into_iter().flatten() {
            layers.albedo.push(pixel.albedo);
            layers.normal.push(pixel.normal);
            layers.shading_normal.push(pixel.shading_normal);
            layers.position.push(pixel.position);
            layers.depth.push(pixel.depth);
        }
        Ok(layers)
    }
}

/// Mean over the samples of a pixel.
fn mean(world: &World, batch: &Batch, hits: &mut Hits) -> Pixel {
    let mut sum = Pixel::default();
    let mut found = 0.0;
    for (index, ray) in batch.rays.iter().enumerate() {
        let surface = hits.surface(&world.shapes, &batch.rays, index);
        let (Some(surface), Some(hit)) = (surface, hits.hit(index)) else {
            continue;
        };
        let moved = batch.camera(world, index as u32);
        let camera = moved.as_ref().unwrap_or(&world.camera);
        let shaded = shade(world, batch, (ray, index as u32, true), &surface, hit);
        found += 1.0;
        let frame = match shaded {
            Some((bsdf, frame)) => {
                sum.albedo += bsdf.reflectance(frame.to_local(surface.wo));
                frame
            }
            None => Frame::around(surface.shading_normal),
        };
        sum.normal += surface.facing_normal();
        sum.shading_normal += surface.facing(frame.to_world(Vec3::Z));
        sum.position += surface.point;
        sum.depth += camera.depth(surface.point);
    }
    let count = batch.rays.len() as f32;
    if found == 0.0 {
        return Pixel::default();
    }
    let albedo = sum.albedo / count;
    Pixel {
        albedo: if albedo.is_finite() {
            albedo.clamp(Vec3::ZERO, Vec3::ONE)
        } else {
            Vec3::ZERO
        },
        normal: sum.normal / found,
        shading_normal: sum.shading_normal / found,
        position: sum.position / found,
        depth: sum.depth / found,
    }
}
