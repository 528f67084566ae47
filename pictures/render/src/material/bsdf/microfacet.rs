//! The Trowbridge-Reitz (GGX) distribution of microfacets, sampled by visible area.

use glam::Vec3;

use crate::sampler::warp::disk;

/// Facets whose slopes follow an ellipsoid.
#[derive(Clone, Copy, Debug)]
pub struct TrowbridgeReitz {
    alpha: [f32; 2],
    /// Whether masking and shadowing are independent of each other.
    separable: bool,
}

/// Least alpha, as in pbrt-v3.
const MIN_ALPHA: f32 = 0.001;

impl TrowbridgeReitz {
    /// Facets of the given roughness along x and y. `remap` maps a roughness in 0..=1 to alpha by pbrt-v3's
    /// polynomial.
    pub fn new(roughness: [f32; 2], remap: bool) -> Self {
        let alpha = |value| if remap { alpha_of(value) } else { value };
        Self {
            alpha: roughness.map(|value| alpha(value).max(MIN_ALPHA)),
            separable: false,
        }
    }

    /// Facets of these alphas along x and y, whose masking is independent of their shadowing, as `disney` has them.
    pub fn separable(alpha: [f32; 2]) -> Self {
        Self {
            separable: true,
            ..Self::new(alpha, false)
        }
    }

    /// Whether the roughness along x and y differs.
    pub fn is_anisotropic(self) -> bool {
        self.alpha[0] != self.alpha[1]
    }

    /// Area of facets with unit normal `h`, per solid angle and unit of surface.
    pub fn density(self, h: Vec3) -> f32 {
        let [ax, ay] = self.alpha;
        let (x, y) = (h.x / ax, h.y / ay);
        let squared = x * x + y * y + h.z * h.z;
        1.0 / (std::f32::consts::PI * ax * ay * squared * squared)
    }

    /// Smith's Λ: hidden over visible facet area, seen from direction `w`. Infinite at grazing angles.
    fn lambda(self, w: Vec3) -> f32 {
        let [ax, ay] = self.alpha;
        let (x, y) = (ax * w.x, ay * w.y);
        0.5 * ((1.0 + (x * x + y * y) / (w.z * w.z)).sqrt() - 1.0)
    }

    /// Share of facets seen from both directions (Smith, by default correlated by height).
    pub fn masking_shadowing(self, wo: Vec3, wi: Vec3) -> f32 {
        if self.separable {
            return self.masking(wo) * self.masking(wi);
        }
        1.0 / (1.0 + self.lambda(wo) + self.lambda(wi))
    }

    /// Share of facets seen from one direction.
    pub fn masking(self, w: Vec3) -> f32 {
        1.0 / (1.0 + self.lambda(w))
    }

    /// Density of `h` in [`Self::sample`].
    pub fn pdf(self, wo: Vec3, h: Vec3) -> f32 {
        let masking = self.masking(wo);
        self.density(h) * masking * wo.dot(h).abs() / wo.z.abs()
    }

    /// Facet normal on the side of `wo`, in proportion to its visible area (Heitz 2018, *Sampling the GGX
    /// Distribution of Visible Normals*).
    pub fn sample(self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        let side = if wo.z < 0.0 { -1.0 } else { 1.0 };
        let wo = wo * side;
        let [ax, ay] = self.alpha;
        // Stretched facets are a hemisphere, whose visible half-disks are sampled in projection.
        let view = Vec3::new(ax * wo.x, ay * wo.y, wo.z).normalize();
        let flat = view.x * view.x + view.y * view.y;
        let across = if flat > 0.0 {
            Vec3::new(-view.y, view.x, 0.0) / flat.sqrt()
        } else {
            Vec3::X
        };
        let along = view.cross(across);
        let [x, y] = disk(u);
        let seen = 0.5 * (1.0 + view.z);
        let y = (1.0 - seen) * (1.0 - x * x).max(0.0).sqrt() + seen * y;
        let height = (1.0 - x * x - y * y).max(0.0).sqrt();
        let h = across * x + along * y + view * height;
        Vec3::new(ax * h.x, ay * h.y, h.z.max(1e-6)).normalize() * side
    }
}

/// Alpha of a roughness in 0..=1, by pbrt-v3's polynomial.
fn alpha_of(roughness: f32) -> f32 {
    let x = libm::logf(roughness.max(1e-3));
    let polynomial = [1.62142, 0.819_955, 0.1734, 0.017_120_1, 0.000_640_711];
    polynomial.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::warp::uniform_hemisphere;
    use crate::sampler::{Method, Sampler};

    #[test]
    fn roughness_remapping() {
        assert!((alpha_of(1.0) - 1.62142).abs() < 1e-5);
        // ln 0.1 = -2.302585: 1.62142 - 1.888016 + 0.919343 - 0.209004 + 0.018010
        assert!(
            (alpha_of(0.1) - 0.461_753).abs() < 2e-5,
            "{}",
            alpha_of(0.1)
        );
        assert_eq!(alpha_of(0.0), alpha_of(1e-3));
    }

    /// Projected facet area is 1. Visible normals integrate to 1 from every direction.
    #[test]
    fn densities_are_normalised() {
        let sampler = Sampler::new(Method::OwenSobol, 5);
        let count = 1 << 16;
        for alpha in [[0.3, 0.3], [0.2, 0.7], [1.0, 1.0]] {
            let facets = TrowbridgeReitz::new(alpha, false);
            for wo in [
                Vec3::Z,
                Vec3::new(0.6, 0.3, 0.5).normalize(),
                Vec3::new(-0.9, 0.1, 0.1).normalize(),
            ] {
                let (mut projected, mut visible) = (0.0, 0.0);
                for i in 0..count {
                    let h = uniform_hemisphere(sampler.stream(0, 0, i).pair(0));
                    projected += f64::from(facets.density(h) * h.z);
                    if h.dot(wo) > 0.0 {
                        visible += f64::from(facets.pdf(wo, h));
                    }
                }
                let scale = std::f64::consts::TAU / f64::from(count);
                assert!(
                    (projected * scale - 1.0).abs() < 0.01,
                    "{alpha:?} {}",
                    projected * scale
                );
                assert!(
                    (visible * scale - 1.0).abs() < 0.01,
                    "{alpha:?} {wo} {}",
                    visible * scale
                );
            }
        }
    }
}
