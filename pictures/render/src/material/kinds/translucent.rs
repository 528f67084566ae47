//! Material `translucent`.

use antumbra_scene::material::Translucent;

use super::{Here, Shade, positive};
use crate::material::bsdf::{
    Bsdf, Diffuse, DiffuseTransmission, Fresnel, GlossyReflection, GlossyTransmission,
    TrowbridgeReitz,
};
use crate::texture::Place;

/// Index of refraction of pbrt-v3, which files cannot change.
const ETA: f32 = 1.5;

impl Shade for Translucent<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let [kd, ks, reflect, transmit] =
            [self.kd, self.ks, self.reflect, self.transmit].map(positive);
        let facets = TrowbridgeReitz::new([self.roughness; 2], self.remap_roughness);
        let fresnel = Fresnel::Dielectric(ETA);
        Bsdf::black()
            .with(Diffuse::new(kd * reflect, 0.0))
            .with(DiffuseTransmission(kd * transmit))
            .with(GlossyReflection::new(ks * reflect, facets, fresnel))
            .with(GlossyTransmission::new(ks * transmit, facets, ETA))
    }
}
