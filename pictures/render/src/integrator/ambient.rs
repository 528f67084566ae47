//! Ambient occlusion: the open part of the hemisphere above the first surface, weighted by the cosine.
//!
//! An open plane has the value that the scene says: π in pbrt-v3's `ambientocclusion`, or 1. Camera rays that escape have 0. Rays go on
//! through surfaces without a material.

use antumbra::Ray;
use glam::Vec3;

use super::hits::Hits;
use super::tracer::Tracer;
use super::{Batch, ShadowQueue, dimension};
use crate::material::Material;
use crate::sampler::warp::{cosine_hemisphere, uniform_hemisphere};
use crate::surface::Frame;
use crate::world::World;

/// The ambient occlusion integrator with its buffers.
#[derive(Debug)]
pub struct AmbientOcclusion {
    samples: u32,
    cosine_sampling: bool,
    distance: f32,
    open: f32,
    hits: Hits,
    /// Rays under way, with their samples.
    current: Rays,
    /// Rays that go on through a surface without a material.
    through: Rays,
}

#[derive(Debug, Default)]
struct Rays {
    rays: Vec<Ray>,
    samples: Vec<u32>,
}

impl AmbientOcclusion {
    /// Integrator with `samples` occlusion rays per camera ray, cosine-weighted or uniform, of a length up to `distance`. An open
    /// plane has the value `open`.
    pub fn new(samples: u32, cosine_sampling: bool, distance: f32, open: f32) -> Self {
        Self {
            samples,
            cosine_sampling,
            distance,
            open,
            hits: Hits::default(),
            current: Rays::default(),
            through: Rays::default(),
        }
    }

    /// Traces a batch to its end.
    pub fn trace(
        &mut self,
        world: &World,
        tracer: &mut Tracer,
        batch: &mut Batch,
        shadows: &mut ShadowQueue,
    ) {
        self.current.rays.clone_from(&batch.rays);
        self.current.samples.clear();
        self.current.samples.extend(0..batch.rays.len() as u32);
        while !self.current.rays.is_empty() && !tracer.is_stopped() {
            self.through.rays.clear();
            self.through.samples.clear();
            self.look_around(world, tracer, batch, shadows);
            std::mem::swap(&mut self.current, &mut self.through);
        }
        shadows.flush(tracer, batch);
    }

    /// Queues the occlusion rays from the hits of the current rays.
    fn look_around(
        &mut self,
        world: &World,
        tracer: &mut Tracer,
        batch: &mut Batch,
        shadows: &mut ShadowQueue,
    ) {
        let rays = &self.current.rays;
        let samples = self.current.samples.iter().copied();
        self.hits.find(tracer, rays, samples);
        for (index, &sample) in self.current.samples.iter().enumerate() {
            let Some(surface) = self.hits.surface(&world.shapes, rays, index) else {
                continue;
            };
            if let Material::None = world.material(surface.shape) {
                let ray = surface.ray_along(rays[index].dir.into());
                self.through.rays.push(ray);
                self.through.samples.push(sample);
                continue;
            }
            let frame = Frame::around(surface.facing_normal());
            let stream = batch.streams[sample as usize];
            for part in 0..self.samples {
                let u = stream.pair_of(dimension::FIRST, part, self.samples);
                let (local, open) = if self.cosine_sampling {
                    (cosine_hemisphere(u), self.open)
                } else {
                    let local = uniform_hemisphere(u);
                    (local, 2.0 * self.open * local.z)
                };
                let mut ray = surface.ray_along(frame.to_world(local));
                ray.tfar = ray.tfar.min(self.distance);
                let value = Vec3::splat(open / self.samples as f32);
                shadows.push(ray, sample, value);
                if shadows.relieve(tracer, batch) {
                    return;
                }
            }
        }
    }
}
