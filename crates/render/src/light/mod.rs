//! Lights: what arrives from one of them at a point, and with which density a sample of it is chosen.
//!
//! - `point.rs`: lights without extent; by direction `spot.rs`, `goniometric.rs`, `projection.rs`
//! - `sky.rs`: the same radiance from everywhere outside the scene
//! - `environment.rs`: radiance from outside by an image, chosen by `distribution.rs`
//! - `emitter.rs`, `sphere.rs`: emitting shapes
//! - `image.rs`: what the lights that have one read from an image

pub mod choice;
mod distribution;
mod emitter;
pub mod emitter_tree;
mod environment;
mod goniometric;
mod image;
mod point;
mod projection;
mod sky;
mod sphere;
mod spot;

use std::f32::consts::PI;

use antumbra::Ray;
use glam::Vec3;

use crate::color::luminance;
use crate::surface::Surface;
pub use emitter::Emitter;
use environment::Environment;
use point::Point;
use sky::Sky;

/// A light of the scene, ready to be sampled.
#[derive(Clone, Debug)]
pub enum Light {
    /// A light without extent.
    Point(Point),
    /// Parallel light from infinitely far away.
    Distant {
        /// Unit direction towards it.
        to_light: Vec3,
        /// Irradiance on a surface that faces it.
        radiance: Vec3,
    },
    /// The same radiance from every direction that leaves the scene.
    Sky(Sky),
    /// Radiance by an image from every direction that leaves the scene.
    Environment(Environment),
    /// An emitting shape: a whole mesh is one light, chosen from by area.
    Area(Emitter),
}

/// The point that asks for light.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Where it is.
    pub point: Vec3,
    /// Unit geometric normal on the side of the viewer.
    pub normal: Vec3,
    /// Whether light from the other side matters too.
    pub both_sides: bool,
}

/// A direction from which light may arrive.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the receiver to the light.
    pub wi: Vec3,
    /// Radiance that arrives if nothing is in between.
    pub radiance: Vec3,
    /// Density per solid angle; 1 for a delta light.
    pub pdf: f32,
    /// Whether no other technique can find this direction.
    pub is_delta: bool,
    end: End,
}

#[derive(Clone, Copy, Debug)]
enum End {
    Infinity,
    Point(Vec3),
    Surface {
        point: Vec3,
        error: Vec3,
        normal: Vec3,
    },
}

impl LightSample {
    /// The shadow ray from the receiver's surface.
    #[inline]
    pub fn shadow_ray(&self, from: &Surface) -> Ray {
        match self.end {
            End::Infinity => from.ray_along(self.wi),
            End::Point(point) => from.ray_to(point),
            End::Surface {
                point,
                error,
                normal,
            } => from.ray_to_surface(point, error, normal),
        }
    }

    /// What an infinitely large light sends along `wi`; `None` if that is nothing.
    #[inline]
    fn from_outside(wi: Vec3, radiance: Vec3, pdf: f32) -> Option<Self> {
        (pdf > 0.0 && radiance != Vec3::ZERO).then_some(Self {
            wi,
            radiance,
            pdf,
            is_delta: false,
            end: End::Infinity,
        })
    }
}

/// Where a light is and how much it sends out, as seen from afar.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Luminance of the irradiance it gives: at distance 1 if it has a place, everywhere if not.
    pub strength: f32,
    /// Centre and radius of a ball around it; `None` if it is infinitely far away.
    pub ball: Option<(Vec3, f32)>,
}

impl Light {
    /// Prepares a light of the scene that is no shape.
    pub fn new(light: &antumbra_scene::Light) -> Self {
        use antumbra_scene::Light as Scene;
        match light {
            Scene::Point { .. }
            | Scene::Spot { .. }
            | Scene::Goniometric { .. }
            | Scene::Projection { .. } => Self::Point(Point::new(light)),
            &Scene::Distant { to_light, radiance } => Self::Distant { to_light, radiance },
            &Scene::Infinite {
                radiance,
                environment: None,
                samples,
            } => Self::Sky(Sky { radiance, samples }),
            Scene::Infinite {
                radiance,
                environment: Some(environment),
                samples,
            } => Self::Environment(Environment::new(environment, *radiance, *samples)),
        }
    }

    /// Radiance that a ray which leaves the scene along the unit vector `dir` brings from this light.
    #[inline]
    pub fn escaped_radiance(&self, dir: Vec3) -> Vec3 {
        match self {
            Self::Sky(sky) => sky.radiance,
            Self::Environment(environment) => environment.radiance(dir),
            _ => Vec3::ZERO,
        }
    }

    /// The same, with the density with which [`Self::sample`] at the point `at` chooses this direction.
    #[inline]
    pub fn escaped(&self, at: &Receiver, dir: Vec3) -> (Vec3, f32) {
        match self {
            Self::Sky(sky) => (sky.radiance, sky.pdf(at, dir)),
            Self::Environment(environment) => environment.radiance_and_pdf(dir),
            _ => (Vec3::ZERO, 0.0),
        }
    }

    /// Whether rays that leave the scene find it.
    pub fn is_outside(&self) -> bool {
        matches!(self, Self::Sky(_) | Self::Environment(_))
    }

    /// Whether only light samples can find it, since no ray ever meets it.
    #[inline]
    pub fn is_delta(&self) -> bool {
        matches!(self, Self::Point(_) | Self::Distant { .. })
    }

    /// Number of lights that pbrt-v3 would count: one per triangle of an emitting mesh.
    pub fn elements(&self) -> usize {
        match self {
            Self::Area(emitter) => emitter.elements(),
            _ => 1,
        }
    }

    /// Samples that a strategy which asks every light takes of each element.
    pub fn samples(&self) -> u32 {
        match self {
            Self::Area(emitter) => emitter.samples(),
            Self::Sky(sky) => sky.samples.max(1),
            Self::Environment(environment) => environment.samples.max(1),
            Self::Point(_) | Self::Distant { .. } => 1,
        }
    }

    /// A sample of the light for `u` in `[0, 1)²`. `None` where none arrives: behind the emitter, outside the
    /// cone of a spot.
    #[inline]
    pub fn sample(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        match self {
            Self::Area(emitter) => emitter.sample(at, u),
            Self::Sky(sky) => sky.sample(at, u),
            Self::Environment(environment) => environment.sample(at, u),
            Self::Point(point) => point.sample(at),
            &Self::Distant { to_light, radiance } => {
                (radiance != Vec3::ZERO).then_some(LightSample {
                    wi: to_light,
                    radiance,
                    pdf: 1.0,
                    is_delta: true,
                    end: End::Infinity,
                })
            }
        }
    }

    /// A sample of one element alone, with the density of that choice.
    pub fn sample_element(
        &self,
        at: &Receiver,
        element: usize,
        u: [f32; 2],
    ) -> Option<LightSample> {
        match self {
            Self::Area(emitter) => emitter.sample_element(at, element, u),
            _ => self.sample(at, u),
        }
    }

    /// Luminance of the power it sends into a scene inside a ball of radius `radius`: as in pbrt-v3, lights
    /// infinitely far away count with their mean radiance times the area of its disk, and π for that.
    pub fn power(&self, radius: f32) -> f32 {
        let disk = PI * radius * radius;
        match self {
            Self::Point(point) => luminance(point.mean_intensity()) * (4.0 * PI),
            Self::Distant { radiance, .. } => luminance(*radiance) * disk,
            Self::Sky(sky) => luminance(sky.radiance) * disk,
            Self::Environment(environment) => environment.mean_luminance() * disk,
            Self::Area(emitter) => luminance(emitter.strength()) * PI,
        }
    }

    /// What it amounts to from afar.
    pub fn extent(&self) -> Extent {
        let (strength, ball) = match self {
            Self::Point(point) => (luminance(point.strength()), Some((point.position(), 0.0))),
            Self::Distant { radiance, .. } => (luminance(*radiance), None),
            Self::Sky(sky) => (luminance(sky.radiance) * PI, None),
            Self::Environment(environment) => (environment.mean_luminance() * PI, None),
            Self::Area(emitter) => (luminance(emitter.strength()), Some(emitter.ball())),
        };
        Extent { strength, ball }
    }
}

#[cfg(test)]
mod tests;
