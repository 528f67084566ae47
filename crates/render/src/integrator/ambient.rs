//! Ambient occlusion: how much of the hemisphere above the first surface is open, weighted by the cosine.
//! An open plane has the value π, as in pbrt-v3's `ambientocclusion`; camera rays that escape have 0.

use std::f32::consts::PI;

use glam::Vec3;

use super::{ShadowQueue, Wave, dimension};
use crate::frame::{Frame, cosine_hemisphere, uniform_hemisphere};
use crate::hits::Hits;
use crate::tracer::Tracer;
use crate::world::World;

/// The ambient occlusion integrator with its buffers.
#[derive(Debug)]
pub struct AmbientOcclusion {
    samples: u32,
    cosine_sampling: bool,
    hits: Hits,
}

impl AmbientOcclusion {
    /// `samples` occlusion rays per camera ray, cosine-weighted or uniform.
    pub fn new(samples: u32, cosine_sampling: bool) -> Self {
        Self {
            samples,
            cosine_sampling,
            hits: Hits::default(),
        }
    }

    /// Traces a wave to its end.
    pub fn trace(
        &mut self,
        world: &World,
        tracer: &mut Tracer,
        wave: &mut Wave,
        shadows: &mut ShadowQueue,
    ) {
        self.hits.find(tracer, &wave.rays);
        for index in 0..wave.rays.len() {
            let Some(surface) = self.hits.surface(&world.shapes, &wave.rays, index) else {
                continue;
            };
            let frame = Frame::around(surface.facing_normal());
            let stream = wave.streams[index];
            for part in 0..self.samples {
                let u = stream.pair_of(dimension::FIRST, part, self.samples);
                let (local, open) = if self.cosine_sampling {
                    (cosine_hemisphere(u), PI)
                } else {
                    let local = uniform_hemisphere(u);
                    (local, 2.0 * PI * local.z)
                };
                let ray = surface.ray_along(frame.to_world(local));
                let value = Vec3::splat(open / self.samples as f32);
                shadows.push(ray, index as u32, value);
                shadows.relieve(tracer, wave);
            }
        }
        shadows.flush(tracer, wave);
    }
}
