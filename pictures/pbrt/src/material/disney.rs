//! Material `disney`.

use antumbra_scene::material::{Disney, DisneyBody, Limit};
use antumbra_scene::{Material, Param, Rgb};

use crate::texture::Textured;

/// Reads a `disney`.
pub(super) fn disney(values: &mut Textured) -> Material {
    let mut disney = Disney::read(values);
    disney.body = body(values, &disney.specular_transmission);
    disney.into()
}

/// Body below the surface. As in pbrt-v3, sheets scatter no light inside, and only sheets let diffuse light through.
fn body(values: &mut Textured, clear: &Param<f32>) -> DisneyBody {
    let is_thin = values.bool("thin", false);
    let flatness = values.limited("flatness", Limit::SHARE);
    let diffuse_transmission = values.limited("difftrans", Limit::UpTo(2.0));
    let scatter_distance: Param<Rgb> = values.param("scatterdistance", 0.0);
    let scatters = scatter_distance.constant() != Some(&Rgb::ZERO);
    if is_thin {
        if scatters {
            values.note("\"scatterdistance\" is left out where \"thin\" is true, as in pbrt-v3");
        }
        return DisneyBody::Thin {
            flatness: flatness.unwrap_or(0.0.into()),
            diffuse_transmission: diffuse_transmission.unwrap_or(1.0.into()),
        };
    }
    for name in ["flatness", "difftrans"] {
        if values.has(name) {
            values.note(format!(
                "{name:?} is left out where \"thin\" is false, as in pbrt-v3"
            ));
        }
    }
    if scatters {
        let message =
            "subsurface scattering is rendered by walks inside of shapes, which must be closed";
        values.note(message);
    }
    if scatters && clear.constant() != Some(&0.0) {
        values.unsupported("\"scatterdistance\" together with \"spectrans\" is");
        return DisneyBody::default();
    }
    DisneyBody::Solid { scatter_distance }
}
