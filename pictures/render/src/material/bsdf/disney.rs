//! Lobes of the material `disney` that no other material has (Burley 2012 and 2015).
//!
//! Highlight and refraction of that material are microfacets with separable masking and the term [`super::Fresnel::Disney`].

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::Vec3;

use super::Scatter;
use super::albedo::schlick_part;
use crate::surface::{reflect, same_hemisphere};

/// All that a base reflects around the normal: diffuse light, light scattered below, light sent back, and sheen.
///
/// Directions are sampled in proportion to the cosine.
#[derive(Clone, Copy, Debug)]
pub struct DisneyBase {
    /// Reflectance of the diffuse part.
    pub diffuse: Vec3,
    /// Reflectance of the part that looks like light scattered below the surface (Hanrahan and Krueger 1993).
    pub flat: Vec3,
    /// Scale of the light that is sent back at grazing angles.
    pub retro: Vec3,
    /// Scale of the light at grazing angles.
    pub sheen: Vec3,
    /// Perceptual roughness.
    pub roughness: f32,
}

impl Scatter for DisneyBase {
    fn is_black(&self) -> bool {
        [self.diffuse, self.flat, self.retro, self.sheen] == [Vec3::ZERO; 4]
    }

    fn scale(&mut self, by: Vec3) {
        for part in [
            &mut self.diffuse,
            &mut self.flat,
            &mut self.retro,
            &mut self.sheen,
        ] {
            *part *= by;
        }
    }

    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let (cos_o, cos_i) = (wo.z.abs(), wi.z.abs());
        let (at_o, at_i) = (schlick_part(cos_o), schlick_part(cos_i));
        // Burley 2015, equation 4.
        let diffuse = self.diffuse * (FRAC_1_PI * (1.0 - 0.5 * at_o) * (1.0 - 0.5 * at_i));
        let Some(h) = (wo + wi).try_normalize() else {
            return diffuse;
        };
        let cos_h = wi.dot(h);
        let rough = self.roughness * cos_h * cos_h;
        let back = 2.0 * rough;
        let retro = FRAC_1_PI * back * (at_o + at_i + at_o * at_i * (back - 1.0));
        let mut value = diffuse + self.retro * retro + self.sheen * schlick_part(cos_h);
        if self.flat != Vec3::ZERO {
            let grazing = |part: f32| 1.0 + (rough - 1.0) * part;
            let below = grazing(at_o) * grazing(at_i) * (1.0 / (cos_o + cos_i) - 0.5) + 0.5;
            value += self.flat * (1.25 * FRAC_1_PI * below);
        }
        value
    }
}

/// Reflectance of the coat at normal incidence, of index 1.5.
const COAT: f32 = 0.04;
/// Alpha of the facets that mask and shadow each other, whatever the gloss.
const MASKING_ALPHA: f32 = 0.25;

/// A second highlight with wide flanks.
#[derive(Clone, Copy, Debug)]
pub struct Clearcoat {
    weight: Vec3,
    /// Square of the alpha of the normals' distribution.
    alpha2: f32,
}

/// Smith's masking over twice the cosine.
fn masking(cos: f32) -> f32 {
    let (cos, alpha2) = (cos.abs(), MASKING_ALPHA * MASKING_ALPHA);
    1.0 / (cos + (alpha2 + (1.0 - alpha2) * cos * cos).sqrt())
}

impl Clearcoat {
    /// Coat of a weight, with normals distributed by an alpha between 0 and 1.
    pub fn new(weight: f32, alpha: f32) -> Self {
        Self {
            weight: Vec3::splat(weight),
            alpha2: alpha * alpha,
        }
    }

    /// Density of normals per solid angle, with the cosine: GTR of exponent 1 (Burley 2012).
    fn density(&self, h: Vec3) -> f32 {
        let sin2 = h.x * h.x + h.y * h.y;
        (self.alpha2 - 1.0)
            / (PI * libm::logf(self.alpha2) * (sin2 + self.alpha2 * (1.0 - sin2).max(0.0)))
    }
}

impl Scatter for Clearcoat {
    fn is_black(&self) -> bool {
        self.weight == Vec3::ZERO
    }

    fn scale(&mut self, by: Vec3) {
        self.weight *= by;
    }

    fn value(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(h) = (wo + wi).try_normalize() else {
            return Vec3::ZERO;
        };
        let fresnel = COAT + (1.0 - COAT) * schlick_part(wo.dot(h));
        self.weight * (0.25 * masking(wo.z) * masking(wi.z) * fresnel * self.density(h))
    }

    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if !same_hemisphere(wo, wi) {
            return 0.0;
        }
        let h = (wo + wi).normalize();
        self.density(h) * h.z.abs() / (4.0 * wo.dot(h))
    }

    /// Mirror direction at a facet of the distribution. `None` if it ends below the surface.
    fn sample(&self, wo: Vec3, _: f32, u: [f32; 2]) -> Option<Vec3> {
        // The distribution function of sin² is log(1 + sin² (1 / alpha² - 1)) / log(1 / alpha²).
        let grown = libm::powf(self.alpha2, 1.0 - u[0]);
        let cos2 = ((1.0 - grown) / (1.0 - self.alpha2)).clamp(0.0, 1.0);
        let sin = (1.0 - cos2).sqrt();
        let turn = TAU * u[1];
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let h = Vec3::new(
            sin * libm::cosf(turn),
            sin * libm::sinf(turn),
            side * cos2.sqrt(),
        );
        let wi = reflect(wo, h);
        (wo.dot(h) > 0.0 && same_hemisphere(wo, wi)).then_some(wi)
    }
}
