//! Points of a sphere, sampled by solid angle.

use std::f32::consts::PI;

use antumbra_scene::Sphere;
use glam::Vec3;

use crate::sampler::warp::{around_z, uniform_sphere};
use crate::surface::Frame;

/// Cone of directions that a sphere fills.
pub struct Cone {
    /// 1 - cosine of the half-angle, computed without cancellation.
    height: f32,
}

impl Cone {
    /// Density of a uniform direction in the cone.
    pub fn pdf(&self) -> f32 {
        1.0 / (2.0 * PI * self.height)
    }
}

/// Cone of a sphere as seen from a point. `None` from inside the sphere or too close to its surface.
pub fn cone(sphere: &Sphere, from: Vec3) -> Option<Cone> {
    let squared = (sphere.center - from).length_squared();
    let radius2 = sphere.radius * sphere.radius;
    (squared > 1.0001 * radius2).then(|| {
        let sin2 = radius2 / squared;
        Cone {
            height: sin2 / (1.0 + (1.0 - sin2).sqrt()),
        }
    })
}

/// Point of a sphere as an outward unit vector, and its density per solid angle. Without a density the point is
/// uniform by area.
pub fn sample_sphere(sphere: &Sphere, from: Vec3, u: [f32; 2]) -> (Vec3, Option<f32>) {
    let Some(cone) = cone(sphere, from) else {
        return (uniform_sphere(u), None);
    };
    let to_center = sphere.center - from;
    let distance = to_center.length();
    // Uniform in the height of the cone. The law of sines gives the angle at the centre.
    let height = u[0] * cone.height;
    let (cos, sin2) = (1.0 - height, height * (2.0 - height));
    let radius = sphere.radius;
    let chord = (radius * radius - distance * distance * sin2)
        .max(0.0)
        .sqrt();
    let reach = distance * cos - chord;
    let cos_alpha = ((distance - reach * cos) / radius).clamp(-1.0, 1.0);
    let sin_alpha = (reach * sin2.sqrt() / radius).clamp(0.0, 1.0);
    let outward = Frame::around(-to_center / distance)
        .to_world(around_z(cos_alpha, sin_alpha, u[1]))
        .normalize();
    (outward, Some(cone.pdf()))
}
