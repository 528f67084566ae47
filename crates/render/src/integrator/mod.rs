//! What is computed along camera rays, for a whole wave of them at a time.
//!
//! A [`Wave`] holds one camera ray per sample and collects their radiance; an [`Integrator`] carries all of
//! them through the same stages: closest hits, shading, shadow rays, next rays. Buffers are kept from wave
//! to wave. The radiance of a sample never depends on which others share its wave.
//!
//! - `path.rs`: path tracing
//! - `direct.rs`: direct lighting with specular chains
//! - `ambient.rs`: ambient occlusion
//! - `shadow.rs`: shadow rays waiting with the light they would bring

mod ambient;
mod direct;
mod hits;
mod path;
mod shadow;
pub mod tracer;

use antumbra::Ray;
use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::integrator::tracer::Tracer;
use crate::sampler::Stream;
use crate::world::World;
use shadow::ShadowQueue;

/// A queue of so many rays is traced at once, to bound memory.
const ENOUGH: usize = 1 << 14;

/// Dimensions of a sample's random values; what follows is the integrator's.
pub mod dimension {
    /// Position inside the pixel.
    pub const FILM: u32 = 0;
    /// Position on the lens.
    pub const LENS: u32 = 1;
    /// First dimension of the integrator.
    pub const FIRST: u32 = 2;
}

/// Camera rays with their random values, and the radiance they bring.
#[derive(Debug, Default)]
pub struct Wave {
    /// One ray per sample.
    pub rays: Vec<Ray>,
    /// Its random values.
    pub streams: Vec<Stream>,
    /// How far the next sample is, in pixels: textures are averaged over that. 0 if they are not to be.
    pub step: f32,
    /// Where it lies inside its pixel; the integrators do not care.
    pub inside: Vec<[f32; 2]>,
    /// Light that paths, shadow rays and probes brought. They are kept apart so that the order of additions
    /// does not depend on when a queue is traced.
    emitted: Vec<Vec3>,
    reflected: Vec<Vec3>,
    probed: Vec<Vec3>,
    /// Node and primitive tests of the sample's shadow rays, and their number; empty unless asked for.
    pub costs: Vec<SampleCost>,
}

/// What the shadow rays of one sample cost.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct SampleCost {
    /// Node tests plus primitive tests.
    pub tests: u64,
    /// Shadow rays.
    pub rays: u64,
}

impl SampleCost {
    /// Adds another sample of the same pixel.
    pub fn add(&mut self, other: &Self) {
        self.tests += other.tests;
        self.rays += other.rays;
    }

    /// Tests per ray; 0 without rays.
    pub fn mean(&self) -> f32 {
        if self.rays == 0 {
            0.0
        } else {
            (self.tests as f64 / self.rays as f64) as f32
        }
    }
}

impl Wave {
    /// Forgets all rays.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.streams.clear();
        self.inside.clear();
    }

    /// Makes room for the answers to the rays given; `costs` asks for [`Self::costs`].
    fn begin(&mut self, costs: bool) {
        for sums in [&mut self.emitted, &mut self.reflected, &mut self.probed] {
            sums.clear();
            sums.resize(self.rays.len(), Vec3::ZERO);
        }
        self.costs.clear();
        if costs {
            self.costs.resize(self.rays.len(), SampleCost::default());
        }
    }

    /// Radiance along ray `index`.
    pub fn radiance(&self, index: usize) -> Vec3 {
        self.emitted[index] + self.reflected[index] + self.probed[index]
    }
}

/// An integrator with its buffers; each worker has its own.
#[derive(Debug)]
pub struct Integrator {
    method: Method,
    shadows: ShadowQueue,
}

#[derive(Debug)]
enum Method {
    Path(path::PathTracer),
    Direct(direct::DirectLighting),
    Ambient(ambient::AmbientOcclusion),
}

impl Integrator {
    /// The integrator a scene asks for.
    pub fn new(world: &World) -> Self {
        use antumbra_scene::Integrator as Scene;
        let method = match world.integrator {
            Scene::Path {
                max_depth,
                rr_threshold,
                // The lights know it.
                light_strategy: _,
            } => Method::Path(path::PathTracer::new(max_depth, rr_threshold)),
            Scene::DirectLighting {
                strategy,
                max_depth,
            } => {
                let lights = world.lights.all();
                Method::Direct(direct::DirectLighting::new(strategy, max_depth, lights))
            }
            Scene::AmbientOcclusion {
                samples,
                cosine_sampling,
            } => Method::Ambient(ambient::AmbientOcclusion::new(samples, cosine_sampling)),
        };
        Self {
            method,
            shadows: ShadowQueue::default(),
        }
    }

    /// Computes the radiance of every ray of the wave; with `costs`, what each one's shadow rays cost too.
    pub fn trace(&mut self, world: &World, tracer: &mut Tracer, wave: &mut Wave, costs: bool) {
        wave.begin(costs);
        let shadows = &mut self.shadows;
        match &mut self.method {
            Method::Path(path) => path.trace(world, tracer, wave, shadows),
            Method::Direct(direct) => direct.trace(world, tracer, wave, shadows),
            Method::Ambient(ambient) => ambient.trace(world, tracer, wave, shadows),
        }
    }
}

/// Weight of a sample drawn with density `own` where another technique would draw it with density `other`
/// (Veach 1997, the power heuristic with exponent 2). `own` must be positive.
#[inline]
fn power_heuristic(own: f32, other: f32) -> f32 {
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests;
