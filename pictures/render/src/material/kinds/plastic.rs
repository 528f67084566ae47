//! Material `plastic`.

use antumbra_scene::material::Plastic;

use super::{Here, Shade, positive};
use crate::material::bsdf::{Bsdf, Diffuse, Fresnel, GlossyReflection, TrowbridgeReitz};
use crate::texture::Place;

impl Shade for Plastic<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        // Index 1.5 on the side of the normal: the coat is seen from inside, as in pbrt.
        let fresnel = Fresnel::Dielectric(1.0 / 1.5);
        let facets = TrowbridgeReitz::new([self.roughness; 2], self.remap_roughness);
        Bsdf::black()
            .with(Diffuse::new(positive(self.kd), 0.0))
            .with(GlossyReflection::new(positive(self.ks), facets, fresnel))
    }
}
