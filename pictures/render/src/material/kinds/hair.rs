//! Material `hair`.

use antumbra_scene::material::{Hair, Pigment};

use super::{Here, Shade, positive};
use crate::material::bsdf::{self, Bsdf, absorption_of_color, absorption_of_melanin};
use crate::texture::Place;

impl Shade for Hair<Here> {
    fn bsdf(self, place: &Place) -> Bsdf {
        let absorption = match self.pigment {
            Pigment::Absorption(value) => positive(value),
            Pigment::Color(value) => absorption_of_color(positive(value), self.roughness[1]),
            Pigment::Melanin(melanin) => absorption_of_melanin(melanin),
        };
        let offset = 2.0 * place.uv.y - 1.0;
        let eta = self.eta.max(1e-3);
        Bsdf::black().with(bsdf::Hair::new(
            eta,
            absorption,
            self.roughness,
            self.tilt,
            offset,
        ))
    }
}
