//! Radiance from outside the scene by an image, sampled in proportion to its luminance.

use std::sync::Arc;

use antumbra_scene::Image;
use glam::{Mat3, Vec3};

use super::distribution::SphereDistribution;
use super::image::{longitude_latitude, lookup};
use super::{LightSample, Receiver};

/// Radiance by direction.
#[derive(Clone, Debug)]
pub struct Environment {
    image: Arc<Image>,
    scale: Vec3,
    world_from_light: Mat3,
    light_from_world: Mat3,
    distribution: SphereDistribution,
    /// Samples per point. 0 counts as 1.
    pub samples: u32,
}

impl Environment {
    /// Prepares the image for sampling, in the current rayon pool.
    pub fn new(environment: &antumbra_scene::Environment, scale: Vec3, samples: u32) -> Self {
        Self {
            image: Arc::clone(&environment.image),
            scale,
            world_from_light: environment.world_from_light,
            // The inverse of a rotation.
            light_from_world: environment.world_from_light.transpose(),
            distribution: SphereDistribution::new(&environment.image, scale),
            samples,
        }
    }

    /// Radiance along a ray in direction `dir`.
    #[inline]
    pub fn radiance(&self, dir: Vec3) -> Vec3 {
        self.lookup(longitude_latitude(self.light_from_world * dir))
    }

    /// Radiance along a ray in direction `dir`, and density of that direction in [`Self::sample`].
    #[inline]
    pub fn radiance_and_pdf(&self, dir: Vec3) -> (Vec3, f32) {
        let place = longitude_latitude(self.light_from_world * dir);
        (self.lookup(place), self.distribution.pdf(place))
    }

    /// Sample of a bright direction. `None` on the far side of a receiver with one side, and if all is dark.
    #[inline]
    pub fn sample(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        let choice = self.distribution.sample(u);
        let wi = (self.world_from_light * choice.direction).try_normalize()?;
        if !at.both_sides && wi.dot(at.normal) <= 0.0 {
            return None;
        }
        LightSample::from_outside(wi, self.lookup(choice.place), choice.pdf)
    }

    /// Luminance of the mean over all directions.
    pub fn mean_luminance(&self) -> f32 {
        self.distribution.mean()
    }

    #[inline]
    fn lookup(&self, place: [f32; 2]) -> Vec3 {
        self.scale * lookup(&self.image, place)
    }
}
