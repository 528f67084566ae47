//! Settings of a scene: how the picture is computed, by integrator, sampler and accelerator.

use serde::Serialize;

/// Quantity computed along a camera ray, and the method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub enum Integrator {
    /// Unidirectional path tracing with next-event estimation and multiple importance sampling.
    Path {
        /// Largest number of scattering events of a path.
        max_depth: u32,
        /// Largest throughput component below which Russian roulette applies.
        rr_threshold: f32,
        /// Distribution from which a vertex chooses a light.
        light_strategy: LightStrategy,
    },
    /// Path tracing through participating media. Light passes surfaces without a material.
    ///
    /// Equal to [`Self::Path`] in scenes without media and without such surfaces.
    VolumePath {
        /// Largest number of scattering events of a path.
        max_depth: u32,
        /// Largest throughput component below which Russian roulette applies.
        rr_threshold: f32,
        /// Distribution from which a vertex chooses a light.
        light_strategy: LightStrategy,
    },
    /// Direct lighting plus perfectly specular chains.
    DirectLighting {
        /// Lights that are sampled at a point.
        strategy: DirectStrategy,
        /// Largest length of specular chains.
        max_depth: u32,
    },
    /// Ambient occlusion: the cosine-weighted share of the hemisphere that is not occluded, times the value of an open one.
    AmbientOcclusion {
        /// Occlusion rays per camera ray.
        samples: u32,
        /// Cosine-weighted directions if true, uniform directions if false. Both have the same mean.
        cosine_sampling: bool,
        /// Distance up to which surfaces occlude, above 0; infinite for all surfaces.
        distance: f32,
        /// Value of an open hemisphere: π in pbrt-v3, or 1.
        open: f32,
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

impl Integrator {
    /// Whether pixels are light, which has no upper limit, and not the share of a hemisphere.
    pub fn is_light(&self) -> bool {
        !matches!(self, Self::AmbientOcclusion { .. })
    }
}

/// Lights that the `directlighting` integrator samples at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum DirectStrategy {
    /// Every light, with its own number of samples.
    All,
    /// One light chosen at random.
    One,
}

/// Distribution from which a vertex of a path chooses a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum LightStrategy {
    /// Equal probability for all lights.
    Uniform,
    /// Probability proportional to emitted power.
    Power,
    /// Probability proportional to the light that arrives near the vertex.
    Spatial,
}

/// Sample generator and sample count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sampler {
    /// Generator that the scene names.
    pub kind: SamplerKind,
    /// Samples per pixel, at least 1.
    pub pixel_samples: u32,
}

impl Sampler {
    /// Largest number of samples per pixel, light or point. No picture with more would finish.
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

/// Sample generators of pbrt-v3.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum SamplerKind {
    /// Independent uniform samples, `random`.
    Random,
    /// One sample per cell of a grid, `stratified`.
    Stratified {
        /// Number of cells across. The product of `x` and `y` is the number of samples per pixel.
        x: u32,
        /// Number of cells down.
        y: u32,
        /// True if a sample lies anywhere in its cell, false if it lies in the middle.
        jitter: bool,
    },
    /// Halton points, `halton`.
    Halton,
    /// Sobol points, `sobol`.
    Sobol,
    /// (0, 2)-sequence, `02sequence`.
    ZeroTwoSequence,
    /// Points with a large minimum distance, `maxmindist`.
    MaxMinDist,
}

impl SamplerKind {
    /// Name in pbrt-v3 files.
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

/// Requests of the scene to the acceleration structure.
///
/// Names have the meaning of the kernel. Readers check them against a list from their caller.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Accelerator {
    /// Node width: 4 (`qbvh`), 8 (`obvh`) or 16 (`hbvh`). `None` leaves it to the program.
    pub width: Option<u8>,
    /// Name of the child order, from `"string order"`; `None` leaves it to the program.
    pub order: Option<String>,
}
