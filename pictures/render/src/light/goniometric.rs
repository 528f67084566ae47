//! A point light with an intensity by an image of longitude and latitude.

use std::sync::Arc;

use antumbra_scene::Image;
use glam::{DVec3, Mat3, Mat4, Vec3};

use super::image::{longitude_latitude, lookup, texel, texel_solid_angle};

/// Intensity by direction.
#[derive(Clone, Debug)]
pub struct Goniometric {
    light_from_world: Mat3,
    intensity: Vec3,
    image: Option<Arc<Image>>,
    mean: Vec3,
}

impl Goniometric {
    /// Profile by an image. Uniform without one.
    pub fn new(world_from_light: &Mat4, intensity: Vec3, image: Option<Arc<Image>>) -> Self {
        let mean = image.as_deref().map_or(Vec3::ONE, mean);
        Self {
            light_from_world: Mat3::from_mat4(*world_from_light).inverse(),
            intensity,
            image,
            mean,
        }
    }

    /// Intensity towards `w`. As in pbrt-v3, y and z are swapped: the pole of the image is the light's y axis.
    #[inline]
    pub fn intensity(&self, w: Vec3) -> Vec3 {
        let Some(image) = &self.image else {
            return self.intensity;
        };
        let w = self.light_from_world * w;
        let place = longitude_latitude(Vec3::new(w.x, w.z, w.y));
        self.intensity * lookup(image, place)
    }

    /// Mean intensity over all directions.
    pub fn mean_intensity(&self) -> Vec3 {
        self.intensity * self.mean
    }
}

fn mean(image: &Image) -> Vec3 {
    let sum: DVec3 = (0..image.height)
        .map(|y| {
            let row: DVec3 = (0..image.width)
                .map(|x| texel(image, x, y).as_dvec3())
                .sum();
            row * texel_solid_angle(image, y)
        })
        .sum();
    (sum / (4.0 * std::f64::consts::PI)).as_vec3()
}
