//! Rays of a scene in two lots that share no sample: training rays and held-out rays.

use antumbra::Ray;
use antumbra_render::World;
use antumbra_scene::Scene;

use super::Options;
use crate::study::Kind;
use crate::{Lot, SampledRays};

/// The lots of a scene.
pub struct Lots {
    train: Lot,
    test: Lot,
}

impl Lots {
    /// Samples of the picture that a rendering of the scene would take.
    pub fn new(world: &World, scene: &Scene, options: &Options) -> Self {
        let tracing = world.bvh(options.width, options.isa);
        let spp = scene.sampler.pixel_samples;
        let mut samples = SampledRays::new(world, &tracing, spp, options.seed);
        Self {
            train: samples.take(options.log_rays, options.log_rays),
            test: samples.take_in_picture_order(options.rays, options.rays),
        }
    }

    /// Training rays.
    pub fn train(&self, kind: Kind) -> &[Ray] {
        self.train.of(kind)
    }

    /// Held-out rays, in the order of a picture.
    pub fn test(&self, kind: Kind) -> &[Ray] {
        self.test.of(kind)
    }
}
