//! Material `metal`.

use antumbra_scene::material::Metal;
use glam::Vec3;

use super::{Here, Shade};
use crate::material::bsdf::{Bsdf, Fresnel, GlossyReflection, TrowbridgeReitz};
use crate::texture::Place;

impl Shade for Metal<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let Self { eta, k, .. } = self;
        let facets = TrowbridgeReitz::new(self.roughness, self.remap_roughness);
        let fresnel = Fresnel::Conductor { eta, k };
        Bsdf::black().with(GlossyReflection::new(Vec3::ONE, facets, fresnel))
    }
}
