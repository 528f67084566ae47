//! Mappings from points of surfaces to texture coordinates.

use antumbra_scene::Mapping;
use glam::{DMat3, DVec3, Vec2};

use super::TextureSpace;
use crate::lookup::Lookup;
use crate::transform;

/// Kinds of mappings. All mappings of pbrt-v3 are supported.
pub(crate) const SUPPORTED: &[&str] = &["cylindrical", "planar", "spherical", "uv"];

/// Reads the parameters of a mapping. `None`: a mistake was reported.
pub(super) fn read(lookup: &mut Lookup, space: &TextureSpace) -> Option<Mapping> {
    let (kind, span) = lookup.string("mapping").unwrap_or(("uv", lookup.at));
    match kind {
        "uv" => {
            let scale = [lookup.float("uscale", 1.0), lookup.float("vscale", 1.0)];
            Some(Mapping::Uv {
                scale: scale.into(),
                offset: offset(lookup),
            })
        }
        "planar" => {
            let axes = [lookup.vector("v1", DVec3::X), lookup.vector("v2", DVec3::Y)];
            let (axes, from) = match lookup.is_version4() {
                // pbrt-v4 measures in the space of the texture, pbrt-v3 in the world.
                true => {
                    let matrix = space.world_from_texture.inverse();
                    let linear = DMat3::from_mat4(matrix).transpose();
                    let moved = matrix.w_axis.truncate();
                    let from = axes.map(|axis| axis.dot(moved));
                    (axes.map(|axis| linear * axis), from)
                }
                false => (axes, [0.0; 2]),
            };
            let [s, t] = [0, 1].map(|k| (axes[k].dot(space.origin) + from[k]) as f32);
            Some(Mapping::Planar {
                axes: axes.map(|axis| axis.as_vec3()),
                offset: offset(lookup) + Vec2::new(s, t),
            })
        }
        "spherical" | "cylindrical" => {
            let world_from_texture = space.world_from_texture;
            if !transform::is_invertible(&world_from_texture) {
                return lookup.fail("the current transformation cannot be inverted");
            }
            let texture_from_world = world_from_texture.inverse() * space.world_from_scene();
            Some(if kind == "spherical" {
                Mapping::Spherical { texture_from_world }
            } else {
                Mapping::Cylindrical { texture_from_world }
            })
        }
        unknown => {
            lookup.report.unknown(span, "mapping", unknown, SUPPORTED);
            None
        }
    }
}

fn offset(lookup: &mut Lookup) -> Vec2 {
    let u = lookup.float("udelta", 0.0);
    let v = lookup.float("vdelta", 0.0);
    Vec2::new(u, v)
}
