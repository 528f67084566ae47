//! Radiance from outside the scene by an image, sampled in proportion to its luminance.

use std::sync::Arc;

use antumbra_scene::{EnvironmentMapping, Image};
use glam::{Mat3, Vec3};

use super::distribution::SphereDistribution;
use super::image::{longitude_latitude, lookup};
use super::octahedron::{self, SquareDistribution};
use super::{LightSample, Receiver};

/// Radiance by direction.
#[derive(Clone, Debug)]
pub struct Environment {
    image: Arc<Image>,
    scale: Vec3,
    world_from_light: Mat3,
    light_from_world: Mat3,
    distribution: Distribution,
    /// Samples per point. 0 counts as 1.
    pub samples: u32,
}

/// Probabilities of directions, by the layout of the image.
#[derive(Clone, Debug)]
enum Distribution {
    Sphere(SphereDistribution),
    Square(SquareDistribution),
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
            distribution: match environment.mapping {
                EnvironmentMapping::LongitudeLatitude => {
                    Distribution::Sphere(SphereDistribution::new(&environment.image, scale))
                }
                EnvironmentMapping::EqualArea => {
                    Distribution::Square(SquareDistribution::new(&environment.image, scale))
                }
            },
            samples,
        }
    }

    /// Radiance along a ray in direction `dir`.
    #[inline]
    pub fn radiance(&self, dir: Vec3) -> Vec3 {
        self.lookup(self.place(dir))
    }

    /// Radiance along a ray in direction `dir`, and density of that direction in [`Self::sample`].
    #[inline]
    pub fn radiance_and_pdf(&self, dir: Vec3) -> (Vec3, f32) {
        let place = self.place(dir);
        let pdf = match &self.distribution {
            Distribution::Sphere(sphere) => sphere.pdf(place),
            Distribution::Square(square) => square.pdf(place),
        };
        (self.lookup(place), pdf)
    }

    /// Sample of a bright direction. `None` on the far side of a receiver with one side, and if all is dark.
    #[inline]
    pub fn sample(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        let choice = match &self.distribution {
            Distribution::Sphere(sphere) => sphere.sample(u),
            Distribution::Square(square) => square.sample(u),
        };
        let wi = (self.world_from_light * choice.direction).try_normalize()?;
        if !at.both_sides && wi.dot(at.normal) <= 0.0 {
            return None;
        }
        LightSample::from_outside(wi, self.lookup(choice.place), choice.pdf)
    }

    /// Luminance of the mean over all directions.
    pub fn mean_luminance(&self) -> f32 {
        match &self.distribution {
            Distribution::Sphere(sphere) => sphere.mean(),
            Distribution::Square(square) => square.mean(),
        }
    }

    /// Place of a direction in the image.
    #[inline]
    fn place(&self, dir: Vec3) -> [f32; 2] {
        let local = self.light_from_world * dir;
        match self.distribution {
            Distribution::Sphere(_) => longitude_latitude(local),
            Distribution::Square(_) => octahedron::place(local),
        }
    }

    #[inline]
    fn lookup(&self, place: [f32; 2]) -> Vec3 {
        let color = match self.distribution {
            Distribution::Sphere(_) => lookup(&self.image, place),
            Distribution::Square(_) => octahedron::lookup(&self.image, place),
        };
        self.scale * color
    }
}
