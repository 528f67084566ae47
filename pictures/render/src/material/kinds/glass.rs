//! Material `glass`, and thin panes of it.

use antumbra_scene::material::{Glass, ThinDielectric};
use glam::Vec3;

use super::{Here, Shade, positive};
use crate::material::bsdf::{
    Bsdf, Fresnel, GlossyReflection, GlossyTransmission, Specular, TrowbridgeReitz,
};
use crate::texture::Place;

impl Shade for Glass<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let (kr, kt, eta) = (positive(self.kr), positive(self.kt), self.eta);
        if self.roughness == [0.0, 0.0] {
            return Bsdf::black().with_delta(Specular::Glass { kr, kt, eta });
        }
        let facets = TrowbridgeReitz::new(self.roughness, self.remap_roughness);
        Bsdf::black()
            .with(GlossyReflection::new(kr, facets, Fresnel::Dielectric(eta)))
            .with(GlossyTransmission::new(kt, facets, eta))
    }
}

impl Shade for ThinDielectric<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        Bsdf::black().with_delta(Specular::Pane {
            scale: Vec3::ONE,
            eta: self.eta,
        })
    }
}
