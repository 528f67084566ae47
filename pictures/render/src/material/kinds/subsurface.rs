//! Materials `subsurface` and `kdsubsurface`.

use antumbra_scene::material::{Interior, Subsurface};
use glam::Vec3;

use super::{Here, Shade, positive};
use crate::material::bsdf::{
    self, Bsdf, Fresnel, GlossyReflection, Interface, Specular, TrowbridgeReitz, albedo_of,
};
use crate::medium::Coefficients;
use crate::texture::Place;

/// Shortest mean free path. Zero would let no light travel.
const SHORTEST: Vec3 = Vec3::splat(1e-8);

impl Shade for Subsurface<Here> {
    fn bsdf(self, _: &Place) -> Bsdf {
        let Self { eta, asymmetry, .. } = self;
        let (kr, kt) = (positive(self.kr), Vec3::ZERO);
        let surface = if self.roughness == [0.0, 0.0] {
            Bsdf::black().with_delta(Specular::Glass { kr, kt, eta })
        } else {
            let facets = TrowbridgeReitz::new(self.roughness, self.remap_roughness);
            Bsdf::black().with(GlossyReflection::new(kr, facets, Fresnel::Dielectric(eta)))
        };
        surface.above(bsdf::Subsurface {
            kt: positive(self.kt),
            interface: Interface::new(eta),
            coefficients: coefficients(self.interior, eta, asymmetry),
            asymmetry,
        })
    }
}

fn coefficients(interior: Interior<Here>, eta: f32, asymmetry: f32) -> Coefficients {
    match interior {
        Interior::Coefficients {
            absorption,
            scattering,
            scale,
        } => Coefficients::new(positive(absorption) * scale, positive(scattering) * scale),
        Interior::Diffuse {
            reflectance,
            mean_free_path,
            scale,
        } => {
            let albedo = albedo_of(reflectance, eta, asymmetry);
            let attenuation = (mean_free_path * scale).max(SHORTEST).recip();
            let scattering = attenuation * albedo;
            Coefficients::new(attenuation - scattering, scattering)
        }
    }
}
