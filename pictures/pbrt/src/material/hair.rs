//! Material `hair`.

use antumbra_scene::{Material, Pigment, Rgb};

use super::{positive_index, share};
use crate::texture::Textured;

/// Parameters that no other material has, which a shape may override. Not "alpha", which masks shapes.
pub(super) const PARAMETERS: &[&str] = &["beta_m", "beta_n", "eumelanin", "pheomelanin"];

/// Concentration of eumelanin without parameters: brown hair.
const BROWN: f32 = 1.3;

/// Reads hair: by absorption, by colour, or by pigments, the first of them that is given, as in pbrt-v3.
pub(super) fn hair(values: &mut Textured) -> Material {
    let absorption = values.find::<Rgb>("sigma_a");
    let color = values.find::<Rgb>("color");
    let melanin = ["eumelanin", "pheomelanin"].map(|name| values.find::<f32>(name));
    let given = [
        absorption.is_some(),
        color.is_some(),
        melanin.iter().any(Option::is_some),
    ];
    if given.iter().filter(|given| **given).count() > 1 {
        values.report.note(
            values.lookup.at,
            "of \"sigma_a\", \"color\" and melanin, hair takes the first, as in pbrt-v3",
        );
    }
    let [eumelanin, pheomelanin] = melanin.map(|found| found.map(|(value, _)| value));
    let pigment = match (absorption, color) {
        (Some((absorption, _)), _) => Pigment::Absorption(absorption),
        (None, Some((color, _))) => Pigment::Color(color),
        (None, None) if given[2] => {
            Pigment::Melanin([eumelanin, pheomelanin].map(|found| found.unwrap_or(0.0.into())))
        }
        (None, None) => Pigment::Melanin([BROWN.into(), 0.0.into()]),
    };
    let eta = values.find("eta");
    Material::Hair {
        pigment,
        eta: positive_index(values, eta, 1.55),
        roughness: ["beta_m", "beta_n"].map(|name| share(values, name, 0.3)),
        tilt: values.param("alpha", 2.0),
    }
}
