//! Material `fourier`.

use antumbra_scene::material::Fourier;

use super::{Here, Shade};
use crate::material::bsdf::{self, Bsdf};
use crate::texture::Place;

impl Shade for Fourier<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        Bsdf::black().with(bsdf::Fourier::new(self.table))
    }
}
