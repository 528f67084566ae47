//! Material `hair`.

use antumbra_scene::material::{Hair, Pigment};
use antumbra_scene::{Material, Rgb};

use crate::texture::Textured;

/// Reads hair: by absorption, by colour, or by pigments, the first of them that is given, as in pbrt-v3.
pub(super) fn hair(values: &mut Textured) -> Material {
    let absorption = values.textured::<Rgb>("sigma_a");
    let color = values.textured::<Rgb>("color");
    let melanin = ["eumelanin", "pheomelanin"].map(|name| values.textured::<f32>(name));
    let given = [
        absorption.is_some(),
        color.is_some(),
        melanin.iter().any(Option::is_some),
    ];
    if given.iter().filter(|given| **given).count() > 1 {
        values.note("of \"sigma_a\", \"color\" and melanin, hair takes the first, as in pbrt-v3");
    }
    let pigment = match (absorption, color) {
        (Some((absorption, _)), _) => Pigment::Absorption(absorption),
        (None, Some((color, _))) => Pigment::Color(color),
        (None, None) if given[2] => {
            Pigment::Melanin(melanin.map(|found| found.map_or(0.0.into(), |(value, _)| value)))
        }
        (None, None) => Pigment::default(),
    };
    let read = Hair::read(values);
    Hair { pigment, ..read }.into()
}
