//! Mappings from a place of a surface to texture coordinates.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::{Mat4, Vec2, Vec3};

use super::Place;

/// Texture coordinates (s, t), with their change from one sample of the picture to the next.
#[derive(Clone, Copy, Debug)]
pub struct Coordinates {
    pub st: Vec2,
    /// Along x and y of the picture.
    pub steps: [Vec2; 2],
}

/// Mapping of places to coordinates, see [`antumbra_scene::Mapping`].
#[derive(Clone, Copy, Debug)]
pub enum Mapping {
    Uv { scale: Vec2, offset: Vec2 },
    Affine { columns: [Vec2; 2], offset: Vec2 },
    Spherical { texture_from_world: Mat4 },
    Cylindrical { texture_from_world: Mat4 },
    Planar { axes: [Vec3; 2], offset: Vec2 },
}

impl Mapping {
    /// Mapping of the scene in single precision.
    pub fn new(mapping: &antumbra_scene::Mapping) -> Self {
        use antumbra_scene::Mapping as Scene;
        match *mapping {
            Scene::Uv { scale, offset } => Self::Uv { scale, offset },
            Scene::Affine { columns, offset } => Self::Affine { columns, offset },
            Scene::Spherical { texture_from_world } => Self::Spherical {
                texture_from_world: texture_from_world.as_mat4(),
            },
            Scene::Cylindrical { texture_from_world } => Self::Cylindrical {
                texture_from_world: texture_from_world.as_mat4(),
            },
            Scene::Planar { axes, offset } => Self::Planar { axes, offset },
        }
    }

    /// Coordinates of a place.
    #[inline]
    pub fn at(&self, place: &Place) -> Coordinates {
        match self {
            Self::Uv { scale, offset } => Coordinates {
                st: *scale * place.uv + *offset,
                steps: place.uv_steps.map(|step| *scale * step),
            },
            Self::Affine {
                columns: [u, v],
                offset,
            } => {
                let turn = |uv: Vec2| *u * uv.x + *v * uv.y;
                Coordinates {
                    st: turn(place.uv) + *offset,
                    steps: place.uv_steps.map(turn),
                }
            }
            Self::Spherical { texture_from_world } => around(place, 0.1, Vec2::Y, |p| {
                let w = texture_from_world.project_point3(p).normalize_or(Vec3::Z);
                let turn = libm::atan2f(w.y, w.x) / TAU;
                let turn = if turn < 0.0 { turn + 1.0 } else { turn };
                Vec2::new(libm::acosf(w.z.clamp(-1.0, 1.0)) * FRAC_1_PI, turn)
            }),
            Self::Cylindrical { texture_from_world } => around(place, 0.01, Vec2::X, |p| {
                // As in pbrt-v3, the height is taken from the direction.
                let w = texture_from_world.project_point3(p).normalize_or(Vec3::Z);
                Vec2::new((PI + libm::atan2f(w.y, w.x)) / TAU, w.z)
            }),
            Self::Planar { axes, offset } => {
                let [s, t] = *axes;
                let project = |v: Vec3| Vec2::new(v.dot(s), v.dot(t));
                Coordinates {
                    st: *offset + project(place.point),
                    steps: place.point_steps.map(project),
                }
            }
        }
    }
}

/// Coordinates by a mapping of positions. Steps are differences over the fraction `delta` of a step.
///
/// Steps take the short way round where the `periodic` coordinate starts again. (pbrt-v3 compares the scaled
/// difference by mistake.)
fn around(place: &Place, delta: f32, periodic: Vec2, map: impl Fn(Vec3) -> Vec2) -> Coordinates {
    let st = map(place.point);
    let steps = place.point_steps.map(|step| {
        if step == Vec3::ZERO {
            return Vec2::ZERO;
        }
        let change = map(place.point + step * delta) - st;
        (change - change.round() * periodic) / delta
    });
    Coordinates { st, steps }
}
