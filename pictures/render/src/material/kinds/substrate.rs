//! Material `substrate`.

use antumbra_scene::material::Substrate;
use glam::Vec3;

use super::{Here, Shade, positive};
use crate::material::bsdf::{Blend, Bsdf, TrowbridgeReitz};
use crate::texture::Place;

impl Shade for Substrate<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let (kd, ks) = (positive(self.kd), positive(self.ks));
        if kd == Vec3::ZERO && ks == Vec3::ZERO {
            return Bsdf::black();
        }
        let facets = TrowbridgeReitz::new(self.roughness, self.remap_roughness);
        Bsdf::black().with(Blend::new(kd, ks, facets))
    }
}
