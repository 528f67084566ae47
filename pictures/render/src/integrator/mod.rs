//! Radiance along camera rays, a batch of them at a time.
//!
//! A [`Batch`] holds one camera ray per sample and collects their radiance. An [`Integrator`] carries all of them
//! through the same stages: closest hits, shading, shadow rays, next rays. The radiance of a sample never depends on
//! the other samples of its batch.
//!
//! - `path/`: path tracing
//! - `volume/`: path tracing through participating media
//! - `direct.rs`: direct lighting with specular chains
//! - `ambient.rs`: ambient occlusion
//! - `arrival.rs`: shadow rays to light samples, in columns
//! - `shadow.rs`: queued shadow rays, each with the light it may bring
//! - `hits.rs`: closest hits, and the surfaces that were hit
//! - `tracer.rs`: queries of the kernel, counted, timed and observed
//! - `queries.rs`: the hook of an observer who answers the queries instead

mod ambient;
mod arrival;
mod direct;
mod hits;
mod path;
mod queries;
mod shadow;
mod tracer;
mod volume;

use antumbra::Ray;
use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::film::Sample;
use crate::light::LightSample;
use crate::sampler::{Sampler, Stream};
use crate::world::{Camera, World};
pub use hits::Hits;
pub use path::shade;
pub use queries::{Observer, PathBatch, Queries};
use shadow::ShadowQueue;
pub use tracer::{Counts, Observe, Tracer};

/// Number of rays at which a queue is traced, to bound memory.
const ENOUGH: usize = 1 << 14;

/// Dimensions of a sample's random values.
pub mod dimension {
    /// Position inside the pixel.
    pub const FILM: u32 = 0;
    /// Position on the lens.
    pub const LENS: u32 = 1;
    /// Time between opening and closing of the shutter.
    pub const TIME: u32 = u32::MAX;
    /// First dimension of the integrator.
    pub const FIRST: u32 = 2;
}

/// Batch of paths: camera rays with their random values, and the radiance they bring.
#[derive(Debug, Default)]
pub struct Batch {
    /// One ray per sample.
    pub rays: Vec<Ray>,
    /// Random values of every sample.
    pub streams: Vec<Stream>,
    /// Time of every sample, from 0 to 1. Empty where nothing moves.
    pub times: Vec<f32>,
    /// Distance to the next sample in pixels, over which textures are averaged. 0 to average nothing.
    pub step: f32,
    /// Position of every sample inside its pixel. Integrators ignore it.
    pub inside: Vec<[f32; 2]>,
    /// Factor of the light of every sample. Empty where all are 1.
    weights: Vec<f32>,
    /// Light of paths, shadow rays and probes. Three sums, so that the order of additions does not depend on when a
    /// queue is traced.
    emitted: Vec<Vec3>,
    reflected: Vec<Vec3>,
    probed: Vec<Vec3>,
    /// Cost of the shadow rays of every sample. Empty unless requested.
    pub costs: Vec<SampleCost>,
}

/// Cost of the shadow rays of one sample.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct SampleCost {
    /// Node tests plus primitive tests.
    pub tests: u64,
    /// Number of shadow rays.
    pub rays: u64,
}

impl SampleCost {
    /// Adds another sample of the same pixel.
    pub fn add(&mut self, other: &Self) {
        self.tests += other.tests;
        self.rays += other.rays;
    }

    /// Mean number of tests per ray. 0 without rays.
    pub fn mean(&self) -> f32 {
        if self.rays == 0 {
            0.0
        } else {
            (self.tests as f64 / self.rays as f64) as f32
        }
    }
}

impl Batch {
    /// Forgets all rays.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.streams.clear();
        self.inside.clear();
        self.times.clear();
        self.weights.clear();
    }

    /// The camera of the world at the time of a sample, if the camera moves.
    pub fn camera(&self, world: &World, sample: u32) -> Option<Camera> {
        let time = self.times.get(sample as usize)?;
        world.camera.at(*time)
    }

    /// Adds the camera ray of a sample.
    pub fn push(&mut self, camera: &Camera, sampler: &Sampler, sample: Sample) {
        let [x, y] = sample.pixel;
        let stream = sampler.stream(x, y, sample.index);
        let [dx, dy] = stream.pair(dimension::FILM);
        let lens = if camera.has_lens() {
            stream.pair(dimension::LENS)
        } else {
            [0.0; 2]
        };
        let film = [x as f32 + dx, y as f32 + dy];
        let (ray, weight) = match camera.has_time() {
            false => camera.weighted_ray(film, lens),
            true => {
                let time = camera.time(stream.uniform(dimension::TIME));
                self.times.push(time);
                let moved = camera.at(time);
                moved.as_ref().unwrap_or(camera).weighted_ray(film, lens)
            }
        };
        if camera.has_weights() {
            self.weights.push(weight);
        }
        self.rays.push(ray);
        self.streams.push(stream);
        self.inside.push([dx, dy]);
    }

    /// Makes room for the radiance of the rays, and with `costs` for [`Self::costs`].
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

    /// Radiance along ray `index`, times its weight.
    pub fn radiance(&self, index: usize) -> Vec3 {
        let light = self.emitted[index] + self.reflected[index] + self.probed[index];
        match self.weights.get(index) {
            None => light,
            // A blocked ray brings nothing, whatever is beyond.
            Some(&0.0) => Vec3::ZERO,
            Some(weight) => light * weight,
        }
    }
}

/// An integrator with its buffers. Every thread has its own.
#[derive(Debug)]
pub struct Integrator {
    method: Method,
    shadows: ShadowQueue,
}

#[derive(Debug)]
enum Method {
    Path(path::PathTracer),
    Volume(volume::VolumePathTracer),
    Direct(Box<direct::DirectLighting>),
    Ambient(ambient::AmbientOcclusion),
}

impl Integrator {
    /// Integrator of a scene.
    pub fn new(world: &World) -> Self {
        use antumbra_scene::Integrator as Scene;
        let method = match world.integrator {
            // `Lights` has applied the strategy.
            Scene::Path {
                max_depth,
                rr_threshold,
                light_strategy: _,
            }
            | Scene::VolumePath {
                max_depth,
                rr_threshold,
                light_strategy: _,
            } => {
                let has_insides = match world.integrator {
                    Scene::Path { .. } => world.has_bodies(),
                    _ => world.has_volumes(),
                };
                match has_insides {
                    true => Method::Volume(volume::VolumePathTracer::new(max_depth, rr_threshold)),
                    false => Method::Path(path::PathTracer::new(max_depth, rr_threshold)),
                }
            }
            Scene::DirectLighting {
                strategy,
                max_depth,
            } => {
                let lights = world.lights.all();
                let direct = direct::DirectLighting::new(strategy, max_depth, lights);
                Method::Direct(Box::new(direct))
            }
            Scene::AmbientOcclusion {
                samples,
                cosine_sampling,
                distance,
                open,
            } => Method::Ambient(ambient::AmbientOcclusion::new(
                samples,
                cosine_sampling,
                distance,
                open,
            )),
        };
        Self {
            method,
            shadows: ShadowQueue::default(),
        }
    }

    /// Computes the radiance of every ray of the batch. With `costs`, also the cost of its shadow rays.
    pub fn trace(&mut self, world: &World, tracer: &mut Tracer, batch: &mut Batch, costs: bool) {
        batch.begin(costs);
        tracer.begin(&batch.times);
        let shadows = &mut self.shadows;
        match &mut self.method {
            Method::Path(path) => path.trace(world, tracer, batch, shadows),
            Method::Volume(volume) => volume.trace(world, tracer, batch),
            Method::Direct(direct) => direct.trace(world, tracer, batch, shadows),
            Method::Ambient(ambient) => ambient.trace(world, tracer, batch, shadows),
        }
    }
}

/// Weight of a sample of density `own`, which another technique draws with density `other` (Veach 1997, the power
/// heuristic with exponent 2). `own` must be positive.
#[inline]
fn power_heuristic(own: f32, other: f32) -> f32 {
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}

impl LightSample {
    /// Weight of a sample of density `own`, which the BSDF or the medium draws with density `other`. 1 if only lights find it.
    fn technique(&self, own: f32, other: f32) -> f32 {
        if self.is_delta {
            1.0
        } else {
            power_heuristic(own, other)
        }
    }
}

#[cfg(test)]
mod tests;
