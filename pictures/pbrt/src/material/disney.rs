//! Material `disney`.

use antumbra_scene::{Disney, DisneyBody, Material, Param, Rgb};

use super::{limited, positive_index, roughness, share};
use crate::texture::Textured;

/// Parameters that no other material has, which a shape may override.
pub(super) const PARAMETERS: &[&str] = &[
    "anisotropic",
    "clearcoat",
    "clearcoatgloss",
    "color",
    "difftrans",
    "flatness",
    "metallic",
    "scatterdistance",
    "sheen",
    "sheentint",
    "spectrans",
    "speculartint",
    "thin",
];

/// Reads a `disney`.
pub(super) fn disney(values: &mut Textured) -> Material {
    let specular_transmission = share(values, "spectrans", 0.0);
    let eta = values.find("eta");
    let body = body(values, &specular_transmission);
    Material::Disney(Box::new(Disney {
        color: values.param("color", 0.5),
        metallic: share(values, "metallic", 0.0),
        eta: positive_index(values, eta, 1.5),
        roughness: roughness(values, "roughness", 0.5),
        specular_tint: share(values, "speculartint", 0.0),
        anisotropic: share(values, "anisotropic", 0.0),
        sheen: values.param("sheen", 0.0),
        sheen_tint: share(values, "sheentint", 0.5),
        clearcoat: values.param("clearcoat", 0.0),
        clearcoat_gloss: share(values, "clearcoatgloss", 1.0),
        specular_transmission,
        body,
    }))
}

/// Body below the surface. As in pbrt-v3, sheets scatter no light inside, and only sheets let diffuse light through.
fn body(values: &mut Textured, clear: &Param<f32>) -> DisneyBody {
    let is_thin = values.lookup.bool("thin", false, values.report);
    let flatness = share(values, "flatness", 0.0);
    let diffuse_transmission = limited(values, "difftrans", 1.0, 2.0);
    let scatter_distance: Param<Rgb> = values.param("scatterdistance", 0.0);
    let scatters = scatter_distance.constant() != Some(&Rgb::ZERO);
    let at = values.lookup.at;
    if is_thin {
        if scatters {
            let message = "\"scatterdistance\" is left out where \"thin\" is true, as in pbrt-v3";
            values.report.note(at, message);
        }
        return DisneyBody::Thin {
            flatness,
            diffuse_transmission,
        };
    }
    for name in ["flatness", "difftrans"] {
        if values.lookup.has(name) {
            let message = format!("{name:?} is left out where \"thin\" is false, as in pbrt-v3");
            values.report.note(at, message);
        }
    }
    if scatters {
        let message =
            "subsurface scattering is rendered by walks inside of shapes, which must be closed";
        values.report.note(at, message);
    }
    if scatters && clear.constant() != Some(&0.0) {
        let feature = "\"scatterdistance\" together with \"spectrans\" is";
        values.report.unsupported(at, feature);
        return DisneyBody::Solid {
            scatter_distance: Rgb::ZERO.into(),
        };
    }
    DisneyBody::Solid { scatter_distance }
}
