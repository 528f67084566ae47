//! Lights: radiance that arrives at a point, and the density of its samples.
//!
//! - `block.rs`: light samples of many points at once
//! - `choice/`: all lights of a scene, and the choice of one of them
//! - `point.rs`: lights at a point, with the profiles `spot.rs`, `goniometric.rs`, `projection.rs`
//! - `sky.rs`: uniform radiance from outside the scene
//! - `environment.rs`: radiance from outside by an image, sampled by `distribution.rs` or `octahedron.rs`
//! - `emitter.rs`, `sphere.rs`: emitting shapes
//! - `emitter_tree.rs`: a tree of only the emitting shapes
//! - `image.rs`: images as lights read them

mod block;
mod choice;
mod distribution;
mod emitter;
mod emitter_tree;
mod environment;
mod goniometric;
mod image;
pub mod octahedron;
mod point;
mod projection;
mod sky;
mod sphere;
mod spot;

use std::f32::consts::PI;

use antumbra::Ray;
use glam::Vec3;

use crate::color::luminance;
use crate::surface::{Room, Surface, offset, offset_distance, segment};
pub use block::{Asked, ElementSample, LightBlock, LightSamples};
pub use choice::Lights;
pub use emitter::Emitter;
pub use emitter_tree::{EmitterTree, before};
use environment::Environment;
pub use image::longitude_latitude;
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
    /// Uniform radiance from every direction that leaves the scene.
    Sky(Sky),
    /// Radiance by an image from every direction that leaves the scene.
    Environment(Environment),
    /// An emitting shape. A whole mesh is one light, sampled by area.
    Area(Emitter),
}

/// Point at which light arrives.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position in the world.
    pub point: Vec3,
    /// Unit geometric normal on the side of the viewer.
    pub normal: Vec3,
    /// Whether light from the other side counts, too.
    pub both_sides: bool,
}

/// A direction from which light may arrive.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the receiver to the light.
    pub wi: Vec3,
    /// Radiance that arrives unless the light is occluded.
    pub radiance: Vec3,
    /// Density per solid angle. 1 for a delta light.
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
    /// Shadow ray from the receiver's surface.
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

    /// Shadow ray from a point that is on no surface. `origin_offset` as of [`Shapes`](crate::surface::Shapes).
    pub fn ray_from(&self, org: Vec3, origin_offset: f32) -> Ray {
        match self.end {
            End::Infinity => Ray {
                org: org.to_array(),
                dir: self.wi.to_array(),
                tnear: 0.0,
                tfar: f32::INFINITY,
            },
            End::Point(point) => segment(org, point),
            End::Surface {
                point,
                error,
                normal,
            } => {
                let distance = offset_distance(error, normal, origin_offset, Room::OPEN);
                segment(org, offset(point, normal, distance, org - point))
            }
        }
    }

    /// Sample of an infinitely large light along `wi`. `None` if it is dark there.
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

/// Place and strength of a light, as seen from afar.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Luminance of the irradiance: at distance 1 for a light with a place, everywhere for others.
    pub strength: f32,
    /// Centre and radius of a ball around the light. `None` if the light is infinitely far away.
    pub ball: Option<(Vec3, f32)>,
}

impl Light {
    /// Prepares a light of the scene that is not a shape.
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

    /// Radiance along a ray that leaves the scene in the direction of the unit vector `dir`.
    #[inline]
    pub fn escaped_radiance(&self, dir: Vec3) -> Vec3 {
        match self {
            Self::Sky(sky) => sky.radiance,
            Self::Environment(environment) => environment.radiance(dir),
            _ => Vec3::ZERO,
        }
    }

    /// Radiance along a ray that leaves the scene, and density of that direction in [`Self::sample`] at `at`.
    #[inline]
    pub fn escaped(&self, at: &Receiver, dir: Vec3) -> (Vec3, f32) {
        match self {
            Self::Sky(sky) => (sky.radiance, sky.pdf(at, dir)),
            Self::Environment(environment) => environment.radiance_and_pdf(dir),
            _ => (Vec3::ZERO, 0.0),
        }
    }

    /// Whether rays that leave the scene find the light.
    pub fn is_outside(&self) -> bool {
        matches!(self, Self::Sky(_) | Self::Environment(_))
    }

    /// Whether only light samples find the light, since no ray ever hits it.
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

    /// Samples of each element, for a strategy that samples every light.
    pub fn samples(&self) -> u32 {
        match self {
            Self::Area(emitter) => emitter.samples(),
            Self::Sky(sky) => sky.samples.max(1),
            Self::Environment(environment) => environment.samples.max(1),
            Self::Point(_) | Self::Distant { .. } => 1,
        }
    }

    /// Sample of the light for `u` in `[0, 1)²`. `None` where no light arrives: behind an emitter, outside the cone
    /// of a spot.
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

    /// Sample of one element only.
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

    /// Luminance of the power that the light sends into a scene inside a ball of radius `radius`.
    ///
    /// As in pbrt-v3, lights infinitely far away count with their mean radiance times the area of the ball's disk.
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

    /// Place and strength, as seen from afar.
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
