//! Materials `subsurface` and `kdsubsurface`.

use antumbra_scene::material::Subsurface;
use antumbra_scene::{Interior, Material, Param, Rgb};

use super::{remap_roughness, roughness_along};
use crate::lookup::{Lookup, POSITIVE};
use crate::presets;
use crate::texture::Textured;

/// Material `subsurface`: by coefficients, or by the name of a measured material.
pub(super) fn coefficients(values: &mut Textured) -> Material {
    let own = asymmetry(values);
    // Measured coefficients are reduced ones.
    let (found, asymmetry) = match presets::named(values, "name", "material") {
        Some(measured) => (measured, 0.0),
        None => (presets::DEFAULT, own),
    };
    let interior = Interior::Coefficients {
        absorption: color(values, "sigma_a", found.absorption),
        scattering: color(values, "sigma_s", found.scattering),
        scale: scale(values),
    };
    body(values, interior, asymmetry)
}

/// Material `kdsubsurface`: by diffuse reflectance and mean free path.
pub(super) fn diffuse(values: &mut Textured) -> Material {
    let mean_free_path = color(values, "mfp", Rgb::ONE);
    if let Param::Constant(path) = mean_free_path
        && path.min_element() <= 0.0
    {
        values.error(format!("\"mfp\" must be positive, found {path}"));
    }
    let interior = Interior::Diffuse {
        reflectance: color(values, "Kd", Rgb::splat(0.5)),
        mean_free_path,
        scale: scale(values),
    };
    let asymmetry = asymmetry(values);
    body(values, interior, asymmetry)
}

fn body(values: &mut Textured, interior: Interior, asymmetry: f32) -> Material {
    let eta = values.float_in("eta", 1.33, POSITIVE);
    values
        .note("subsurface scattering is rendered by walks inside of shapes, which must be closed");
    Material::Subsurface(Subsurface {
        kr: values.param("Kr", 1.0),
        kt: values.param("Kt", 1.0),
        eta,
        roughness: roughness_along(values),
        remap_roughness: remap_roughness(values),
        interior,
        asymmetry,
    })
}

pub(super) fn color(values: &mut Textured, name: &'static str, default: Rgb) -> Param<Rgb> {
    let found = values.textured(name);
    found.map_or(Param::Constant(default), |(value, _)| value)
}

fn scale(lookup: &mut Lookup) -> f32 {
    lookup.float_in("scale", 1.0, POSITIVE)
}

fn asymmetry(lookup: &mut Lookup) -> f32 {
    let found = lookup.float("g", 0.0);
    if found.abs() < 1.0 {
        return found;
    }
    lookup.error(format!("\"g\" must be between -1 and 1, found {found}"));
    0.0
}
