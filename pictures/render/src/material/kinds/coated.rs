//! Materials under a coat.

use antumbra_scene::material::{CoatedConductor, CoatedDiffuse};
use glam::Vec3;

use super::{Here, Shade};
use crate::material::bsdf::{Bsdf, Fresnel, GlossyReflection, Metallic, TrowbridgeReitz};
use crate::texture::Place;

impl Shade for CoatedDiffuse<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let coated = Metallic::coated(self.reflectance, self.eta, self.roughness);
        Bsdf::black().with(coated)
    }
}

impl Shade for CoatedConductor<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let Self { eta, k, .. } = self;
        let coat = self.coat_eta.max(1e-3);
        let spread = seen_through(self.roughness, self.coat_roughness, coat);
        let lobe = |alphas, fresnel| {
            GlossyReflection::new(Vec3::ONE, TrowbridgeReitz::new(alphas, false), fresnel)
        };
        Bsdf::black()
            .with(lobe(self.coat_roughness, Fresnel::Coat(coat)))
            .with(lobe(spread, Fresnel::Coated { eta, k, coat }))
    }
}

/// Alphas of facets that reflect as wide as facets seen through a rough coat.
///
/// A facet tilted by a small d turns the mirror direction by 2 d inside, and by 2 d eta outside. A facet of the coat turns
/// light by (eta - 1) d, on the way in and on the way out. Variances add up.
fn seen_through(below: [f32; 2], coat: [f32; 2], eta: f32) -> [f32; 2] {
    [0, 1].map(|axis| {
        let own = eta * below[axis];
        let passing = (eta - 1.0) * coat[axis];
        (own * own + 0.5 * passing * passing).sqrt().min(1.0)
    })
}
