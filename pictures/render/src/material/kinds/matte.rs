//! Material `matte`.

use antumbra_scene::material::Matte;

use super::{Here, Shade, positive};
use crate::material::bsdf::{Bsdf, Diffuse};
use crate::texture::Place;

impl Shade for Matte<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        Bsdf::black().with(Diffuse::new(positive(self.kd), self.sigma))
    }
}
