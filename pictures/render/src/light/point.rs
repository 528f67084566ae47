//! Lights at a point, with a profile of intensity by direction.

use antumbra_scene::Light as Scene;
use glam::Vec3;

use super::goniometric::Goniometric;
use super::projection::Projection;
use super::spot::Spot;
use super::{End, LightSample, Receiver};

/// A light at a point.
#[derive(Clone, Debug)]
pub struct Point {
    position: Vec3,
    profile: Profile,
}

/// Intensity by direction.
#[derive(Clone, Debug)]
enum Profile {
    Even(Vec3),
    Spot(Spot),
    Goniometric(Goniometric),
    Projection(Projection),
}

impl Point {
    /// Point light of a scene. Dark for any other light.
    pub fn new(light: &Scene) -> Self {
        let (position, profile) = match light {
            &Scene::Point {
                position,
                intensity,
            } => (position, Profile::Even(intensity)),
            &Scene::Spot {
                position,
                axis,
                intensity,
                cos_total_width,
                cos_falloff_start,
            } => {
                let spot = Spot {
                    axis,
                    intensity,
                    cos_total_width,
                    cos_falloff_start,
                };
                (position, Profile::Spot(spot))
            }
            Scene::Goniometric {
                world_from_light,
                intensity,
                image,
            } => {
                let light = Goniometric::new(world_from_light, *intensity, image.clone());
                let position = world_from_light.project_point3(Vec3::ZERO);
                (position, Profile::Goniometric(light))
            }
            Scene::Projection {
                world_from_light,
                intensity,
                fov,
                image,
            } => {
                let light = Projection::new(world_from_light, *intensity, *fov, image.clone());
                let position = world_from_light.project_point3(Vec3::ZERO);
                (position, Profile::Projection(light))
            }
            Scene::Distant { .. } | Scene::Infinite { .. } => {
                (Vec3::ZERO, Profile::Even(Vec3::ZERO))
            }
        };
        Self { position, profile }
    }

    /// Position in the world.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Radiance that arrives at a point, as the only possible sample.
    #[inline]
    pub fn sample(&self, at: &Receiver) -> Option<LightSample> {
        let to_light = self.position - at.point;
        let wi = to_light.try_normalize()?;
        let intensity = match &self.profile {
            Profile::Even(intensity) => *intensity,
            Profile::Spot(spot) => spot.intensity(-wi),
            Profile::Goniometric(light) => light.intensity(-wi),
            Profile::Projection(light) => light.intensity(-wi),
        };
        let radiance = intensity / to_light.length_squared();
        (radiance != Vec3::ZERO).then_some(LightSample {
            wi,
            radiance,
            pdf: 1.0,
            is_delta: true,
            end: End::Point(self.position),
        })
    }

    /// Mean intensity over all directions: the power over 4π.
    pub fn mean_intensity(&self) -> Vec3 {
        match &self.profile {
            Profile::Even(intensity) => *intensity,
            Profile::Spot(spot) => spot.mean_intensity(),
            Profile::Goniometric(light) => light.mean_intensity(),
            Profile::Projection(light) => light.mean_intensity(),
        }
    }

    /// Mean intensity over the lit directions.
    pub fn strength(&self) -> Vec3 {
        match &self.profile {
            Profile::Even(intensity) => *intensity,
            Profile::Spot(spot) => spot.intensity,
            Profile::Goniometric(light) => light.mean_intensity(),
            Profile::Projection(light) => light.strength(),
        }
    }
}
