//! A point light that projects an image.

use std::sync::Arc;

use antumbra_scene::Image;
use glam::{DVec3, Mat3, Mat4, Vec2, Vec3};

use super::image::{lookup, texel};

/// Directions nearer to the plane of the light than this are dark, as in pbrt-v3.
const HITHER: f32 = 1e-3;

/// Intensity by direction.
#[derive(Clone, Debug)]
pub struct Projection {
    light_from_world: Mat3,
    intensity: Vec3,
    /// Half-size of the image on the plane z = 1 of the light's space.
    half: Vec2,
    image: Option<Arc<Image>>,
    /// Integral of the image over solid angle.
    flux: Vec3,
    solid_angle: f32,
}

impl Projection {
    /// Profile of an image with `fov` degrees over its shorter side. A white square without an image.
    pub fn new(
        world_from_light: &Mat4,
        intensity: Vec3,
        fov: f32,
        image: Option<Arc<Image>>,
    ) -> Self {
        let aspect = image
            .as_ref()
            .map_or(1.0, |image| image.width as f32 / image.height as f32);
        let shorter = libm::tan(f64::from(fov).to_radians() * 0.5) as f32;
        let half = shorter * Vec2::new(aspect.max(1.0), aspect.recip().max(1.0));
        let (flux, solid_angle) = measure(image.as_deref(), half);
        Self {
            light_from_world: Mat3::from_mat4(*world_from_light).inverse(),
            intensity,
            half,
            image,
            flux,
            solid_angle,
        }
    }

    /// Intensity towards the unit vector `w`. 0 behind the light and beside the image. The first row of the image is
    /// at the least y, as in pbrt-v3.
    #[inline]
    pub fn intensity(&self, w: Vec3) -> Vec3 {
        let w = self.light_from_world * w;
        let place = w.truncate() / w.z;
        // NaN is beside the image.
        let inside = w.z >= HITHER && place.abs().cmple(self.half).all();
        match &self.image {
            _ if !inside => Vec3::ZERO,
            None => self.intensity,
            Some(image) => {
                let place = place / self.half * 0.5 + 0.5;
                self.intensity * lookup(image, place.to_array())
            }
        }
    }

    /// Mean intensity over all directions.
    pub fn mean_intensity(&self) -> Vec3 {
        self.intensity * self.flux / (4.0 * std::f32::consts::PI)
    }

    /// Mean intensity over the image.
    pub fn strength(&self) -> Vec3 {
        self.intensity * self.flux / self.solid_angle
    }
}

/// Integral over solid angle of an image of half-size `half` at distance 1, and its solid angle. Both by texels.
fn measure(image: Option<&Image>, half: Vec2) -> (Vec3, f32) {
    let [width, height] = image.map_or([64; 2], |image| [image.width, image.height]);
    let size = Vec2::new(width as f32, height as f32);
    let area = 4.0 * f64::from(half.x) * f64::from(half.y) / (f64::from(width) * f64::from(height));
    let (mut flux, mut solid_angle) = (DVec3::ZERO, 0.0);
    for y in 0..height {
        for x in 0..width {
            let place = half * ((Vec2::new(x as f32, y as f32) + 0.5) / size * 2.0 - 1.0);
            let distance2 = 1.0 + f64::from(place.length_squared());
            let part = area / (distance2 * distance2.sqrt());
            let value = image.map_or(Vec3::ONE, |image| texel(image, x, y));
            flux += value.as_dvec3() * part;
            solid_angle += part;
        }
    }
    (flux.as_vec3(), solid_angle as f32)
}
