//! Material `uber`.

use antumbra_scene::material::Uber;
use glam::Vec3;

use super::{Here, Shade, positive};
use crate::material::bsdf::{Bsdf, Diffuse, Fresnel, GlossyReflection, Specular, TrowbridgeReitz};
use crate::texture::Place;

impl Shade for Uber<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let (opacity, eta) = (positive(self.opacity), self.eta);
        let [kd, ks, kr, kt] =
            [self.kd, self.ks, self.kr, self.kt].map(|color| positive(color) * opacity);
        let facets = TrowbridgeReitz::new(self.roughness, self.remap_roughness);
        let share = positive(Vec3::ONE - opacity);
        Bsdf::black()
            .with(Diffuse::new(kd, 0.0))
            .with(GlossyReflection::new(ks, facets, Fresnel::Dielectric(eta)))
            .with_delta(Specular::Glass { kr, kt, eta })
            .with_delta(Specular::Through { share })
    }
}
