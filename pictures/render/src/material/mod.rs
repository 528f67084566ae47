//! Materials: parameters, and how they scatter light at a point.
//!
//! - [`Material`]: a material ready for shading
//! - `kinds/`: parameters of every kind of material, and the BSDF that they make
//! - `patch.rs`: surroundings of a point, for textures and bumps
//! - `bsdf/`: how a point scatters light
//!
//! Materials whose parameters are constant have one [`Bsdf`]. Other materials make one at every point.

pub mod bsdf;
mod kinds;
mod patch;

use antumbra::{Hit, Ray};
use antumbra_scene::Rgb;
use antumbra_scene::material::Map;
use glam::Vec3;

use crate::surface::{Frame, Shapes, Surface};
use crate::texture::{Input, Place, Textures};
use bsdf::Bsdf;
use kinds::{Here, Lowered, Lowering};
pub use patch::Patch;

/// A material ready for shading.
#[derive(Clone, Debug)]
pub enum Material {
    /// No surface: rays go on.
    None,
    /// One [`Bsdf`] for all points.
    Constant(Box<Bsdf>),
    /// A [`Bsdf`] for every point.
    Varying(Box<Varying>),
}

/// A material that varies over the surface.
#[derive(Clone, Debug)]
pub struct Varying {
    parameters: antumbra_scene::Material<Lowered>,
    /// Height of bumps above the surface.
    height: Option<Input<f32>>,
    /// Normals as colours, and the factor of their parts along the surface.
    normals: Option<(Input<Rgb>, f32)>,
}

impl Material {
    /// Lowers a material of the scene.
    pub fn new(material: &antumbra_scene::Material, textures: &mut Textures) -> Self {
        if let antumbra_scene::Material::None = material {
            return Self::None;
        }
        let mut lowering = Lowering {
            textures,
            varies: false,
        };
        let parameters = lowering.material(material);
        let height = bumps(&parameters).cloned();
        let normals = match &parameters {
            antumbra_scene::Material::NormalMapped(mapped) => {
                Some((mapped.normal.clone(), mapped.scale))
            }
            _ => None,
        };
        if lowering.varies || normals.is_some() {
            Self::Varying(Box::new(Varying {
                parameters,
                height,
                normals,
            }))
        } else {
            Self::Constant(Box::new(kinds::bsdf(&parameters, &Place::default())))
        }
    }
}

/// Height of the bumps of a material. A mix has the bumps of its first material, as in pbrt-v3. A constant height moves the
/// surface and tilts nothing.
fn bumps(material: &antumbra_scene::Material<Lowered>) -> Option<&Input<f32>> {
    match material {
        antumbra_scene::Material::Bumped(bumped) => {
            Some(&bumped.height).filter(|height| matches!(height, Input::Texture(_)))
        }
        antumbra_scene::Material::Mix(mix) => bumps(&mix.materials[0]),
        _ => None,
    }
}

impl Varying {
    /// BSDF at a hit, and the frame in which the BSDF is evaluated. `neighbours` as for [`Patch::at`].
    pub fn shade(
        &self,
        shapes: &Shapes,
        surface: &Surface,
        hit: &Hit,
        neighbours: Option<&[Ray; 2]>,
    ) -> (Bsdf, Frame) {
        let patch = Patch::at(shapes, surface, hit, neighbours);
        let bsdf = kinds::bsdf(&self.parameters, &patch.place);
        if let Some((normals, scale)) = &self.normals {
            let mapped = normals.at(&patch.place) * 2.0 - Vec3::ONE;
            let mapped = Vec3::new(mapped.x * scale, mapped.y * scale, mapped.z);
            return (bsdf, normal_mapped(surface, &patch, mapped));
        }
        let frame = match &self.height {
            Some(height) => {
                let [u, v] = bumped(surface, &patch, height);
                let normal = u.cross(v).try_normalize().unwrap_or(surface.shading_normal);
                // Bumps do not tilt the geometric normal, whose side decides.
                let turned = normal.dot(surface.normal) < 0.0;
                Frame::along(if turned { -normal } else { normal }, u)
            }
            None if bsdf.is_anisotropic() => {
                Frame::along(surface.shading_normal, patch.tangents[0])
            }
            None => Frame::around(surface.shading_normal),
        };
        (bsdf, frame)
    }
}

/// Frame around a normal that is given by its parts along u, v and the shading normal.
fn normal_mapped(surface: &Surface, patch: &Patch, mapped: Vec3) -> Frame {
    let z = surface.shading_normal;
    let [u, v] = patch.tangents;
    let along = |tangent: Vec3| (tangent - z * tangent.dot(z)).try_normalize();
    let (Some(x), Some(toward_v)) = (along(u), along(v)) else {
        return Frame::around(z);
    };
    // Mirrored coordinates have v on the other side.
    let y = z.cross(x);
    let y = if y.dot(toward_v) < 0.0 { -y } else { y };
    let normal = x * mapped.x + y * mapped.y + z * mapped.z.max(0.0);
    Frame::around(normal.try_normalize().unwrap_or(z))
}

/// Step in texture coordinates where the distance of samples is unknown.
const LITTLE: f32 = 0.0005;

/// Tangents of the surface displaced along its normal (Blinn 1978, constants as in pbrt-v3).
///
/// The height is compared with the height half a sample further, or [`LITTLE`] further where samples are unknown.
fn bumped(surface: &Surface, patch: &Patch, height: &Input<f32>) -> [Vec3; 2] {
    let place = &patch.place;
    let here = height.at(place);
    let reach = 0.5 * (place.uv_steps[0].abs() + place.uv_steps[1].abs());
    [0, 1].map(|axis| {
        let reach = if reach[axis] == 0.0 {
            LITTLE
        } else {
            reach[axis]
        };
        let tangent = patch.bump_tangents[axis];
        let mut there = *place;
        there.point += tangent * reach;
        there.uv[axis] += reach;
        let slope = (height.at(&there) - here) / reach;
        tangent + surface.shading_normal * slope + patch.normal_changes[axis] * here
    })
}

#[cfg(test)]
mod tests;
