//! Metallic-roughness materials of glTF.

use antumbra_scene::material::Metallic;

use super::{Here, Shade, positive};
use crate::material::bsdf::{self, Bsdf, Specular};
use crate::texture::Place;

impl Shade for Metallic<Here> {
    fn bsdf(mut self, _: &Place) -> Bsdf {
        (self.color, self.coat) = (positive(self.color), positive(self.coat));
        let (lobe, kt) = bsdf::Metallic::new(&self);
        let coat = lobe.coat();
        (Bsdf::black().with(lobe)).with_delta(Specular::Sheet { kt, coat })
    }
}
