//! The choices of a scene that say how to compute, not what is there.

use serde::Serialize;

/// What is computed along a camera ray.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum Integrator {
    /// Unidirectional path tracing with next-event estimation and multiple importance sampling.
    Path {
        /// Number of scattering events a path may have.
        max_depth: u32,
        /// Russian roulette starts when the largest throughput component falls below this.
        rr_threshold: f32,
        /// Which light a vertex asks.
        light_strategy: LightStrategy,
    },
    /// Direct lighting plus perfectly specular chains.
    DirectLighting {
        /// How many lights are sampled at a point.
        strategy: DirectStrategy,
        /// Length of specular chains.
        max_depth: u32,
    },
    /// The cosine-weighted share of the hemisphere that is open, times π.
    AmbientOcclusion {
        /// Occlusion rays per camera ray.
        samples: u32,
        /// Cosine-weighted directions if true, uniform ones if false; the mean is the same.
        cosine_sampling: bool,
    },
}

impl Default for Integrator {
    fn default() -> Self {
        Self::Path {
            max_depth: 5,
            rr_threshold: 1.0,
            light_strategy: LightStrategy::Spatial,
        }
    }
}

/// Which lights a point of the `directlighting` integrator asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum DirectStrategy {
    /// Every light, with its own number of samples.
    All,
    /// One light chosen at random.
    One,
}

/// With which probability a vertex of a path asks each light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum LightStrategy {
    /// The same for all.
    Uniform,
    /// By emitted power.
    Power,
    /// By what arrives around the vertex.
    Spatial,
}

/// How samples are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sampler {
    /// The generator the scene names.
    pub kind: SamplerKind,
    /// Samples per pixel, at least 1.
    pub pixel_samples: u32,
}

impl Sampler {
    /// Samples that a pixel, a light or a point may be given: a picture of more would not be seen to the end.
    pub const MAX_SAMPLES: u32 = 1 << 20;
}

impl Default for Sampler {
    fn default() -> Self {
        Self {
            kind: SamplerKind::Random,
            pixel_samples: 16,
        }
    }
}

/// Names of pbrt-v3's sample generators.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[allow(missing_docs, reason = "the names are pbrt's and say it all")]
pub enum SamplerKind {
    Random,
    Stratified {
        /// Samples across and down; their product is the number per pixel.
        x: u32,
        y: u32,
        /// Whether a sample lies anywhere in its cell, not in the middle.
        jitter: bool,
    },
    Halton,
    Sobol,
    ZeroTwoSequence,
    MaxMinDist,
}

impl SamplerKind {
    /// The name that pbrt-v3 gives it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Stratified { .. } => "stratified",
            Self::Halton => "halton",
            Self::Sobol => "sobol",
            Self::ZeroTwoSequence => "02sequence",
            Self::MaxMinDist => "maxmindist",
        }
    }
}

/// What the scene asks of the acceleration structure. The scene knows names only; their meaning is the
/// kernel's, and the reader checks them against the list its caller gives.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Accelerator {
    /// Node width: 4 (`qbvh`), 8 (`obvh`), 16 (`hbvh`); `None` leaves it to the program.
    pub width: Option<u8>,
    /// Name of the child order, from `"string order"`; `None` leaves it to the program.
    pub order: Option<String>,
}
