//! Reflectance of smooth interfaces, to a dielectric or a conductor.

use glam::Vec3;

/// Medium below an interface.
#[derive(Clone, Copy, Debug)]
pub enum Fresnel {
    /// Index of refraction below the normal over that above it.
    Dielectric(f32),
    /// Index of refraction and absorption coefficient, by colour. Above is vacuum.
    Conductor {
        /// Index of refraction.
        eta: Vec3,
        /// Absorption coefficient.
        k: Vec3,
    },
    /// Dielectric and metal of the material `disney`.
    Disney {
        /// Reflectance of the metal at normal incidence.
        r0: Vec3,
        /// Share of metal.
        metallic: f32,
        /// Index of refraction of the dielectric, below the normal over above it.
        eta: f32,
    },
    /// Dielectric coat of this index of refraction, equal from both sides of the surface.
    Coat(f32),
    /// Conductor below a dielectric coat, without the light that the coat itself reflects.
    Coated {
        /// Index of refraction of the conductor.
        eta: Vec3,
        /// Absorption coefficient of the conductor.
        k: Vec3,
        /// Index of refraction of the coat.
        coat: f32,
    },
}

/// Unpolarised Fresnel reflectance for a direction with cosine `cos_i` to the normal.
///
/// `eta` is the index of refraction below the normal over that above it. A negative cosine comes from below. Total
/// internal reflection has 1.
pub fn dielectric(cos_i: f32, eta: f32) -> f32 {
    let cos_i = cos_i.clamp(-1.0, 1.0);
    let (cos_i, eta) = if cos_i > 0.0 {
        (cos_i, eta)
    } else {
        (-cos_i, 1.0 / eta)
    };
    let sin2_t = (1.0 - cos_i * cos_i).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Unpolarised Fresnel reflectance of a conductor under vacuum, by colour, for a direction with cosine `cos` to the
/// normal. Both sides reflect alike.
pub fn conductor(cos: f32, eta: Vec3, k: Vec3) -> Vec3 {
    let cos = cos.abs().min(1.0);
    let (cos2, sin2) = (cos * cos, 1.0 - cos * cos);
    let (eta2, k2) = (eta * eta, k * k);
    // Born and Wolf 1999, section 14.4: a² + b² and a of the refracted wave.
    let difference = eta2 - k2 - Vec3::splat(sin2);
    let squares = root(difference * difference + 4.0 * eta2 * k2);
    let real = root(0.5 * (squares + difference));
    let (sum, part) = (squares + Vec3::splat(cos2), 2.0 * cos * real);
    let perpendicular = (sum - part) / (sum + part);
    let (sum, part) = (cos2 * squares + Vec3::splat(sin2 * sin2), part * sin2);
    let parallel = perpendicular * (sum - part) / (sum + part);
    0.5 * (parallel + perpendicular)
}

/// Light that passes a smooth coat, is reflected by the conductor below, and leaves, by colour, for a direction with cosine
/// `cos` to the normal. Light that goes to and fro in between is included.
pub fn coated(cos: f32, eta: Vec3, k: Vec3, coat: f32) -> Vec3 {
    let cos = cos.abs().min(1.0);
    let reflected = dielectric(cos, coat);
    let inside = (1.0 - (1.0 - cos * cos) / (coat * coat)).max(0.0).sqrt();
    let below = conductor(inside, eta / coat, k / coat);
    let passed = (1.0 - reflected) * (1.0 - reflected);
    // The geometric series of reflections. At grazing angles nothing passes.
    passed * below / (Vec3::ONE - reflected * below).max(Vec3::splat(f32::MIN_POSITIVE))
}

fn root(v: Vec3) -> Vec3 {
    let v = v.max(Vec3::ZERO);
    Vec3::new(v.x.sqrt(), v.y.sqrt(), v.z.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((dielectric(-1.0, 1.5) - 0.04).abs() < 1e-6);
        assert_eq!(dielectric(0.5, 1.0), 0.0);
        assert_eq!(dielectric(-0.5, 1.5), 1.0, "beyond the critical angle");
        assert_eq!(dielectric(0.0, 1.5), 1.0, "grazing");
        // Brewster's angle: the parallel part vanishes, the other is ((eta² - 1) / (eta² + 1))².
        let brewster = 1.0 / (1.0_f32 + 1.5 * 1.5).sqrt();
        let expected = 0.5 * (1.25_f32 / 3.25).powi(2);
        assert!((dielectric(brewster, 1.5) - expected).abs() < 1e-6);
    }

    /// Without absorption a conductor is a dielectric. Straight on, its reflectance is ((n - 1)² + k²) / ((n + 1)² +
    /// k²).
    #[test]
    fn conductors() {
        for i in 0..=100 {
            let cos = i as f32 / 100.0;
            let found = conductor(cos, Vec3::splat(1.5), Vec3::ZERO);
            assert!(
                (found.x - dielectric(cos, 1.5)).abs() < 1e-4,
                "{cos} {found}"
            );
        }
        // Copper.
        let (eta, k) = (
            Vec3::new(0.200, 0.924, 1.102),
            Vec3::new(3.912, 2.452, 2.142),
        );
        let found = conductor(-1.0, eta, k);
        for c in 0..3 {
            let (n, k) = (eta[c], k[c]);
            let expected = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
            assert!((found[c] - expected).abs() < 1e-5);
        }
        assert_eq!(conductor(0.0, eta, k), Vec3::ONE, "grazing");
    }

    #[test]
    fn both_ways_through_the_interface_reflect_alike() {
        for i in 1..100 {
            let cos_i = i as f32 / 100.0;
            let sin_t = (1.0 - cos_i * cos_i).sqrt() / 1.5;
            let cos_t = (1.0 - sin_t * sin_t).sqrt();
            assert!((dielectric(cos_i, 1.5) - dielectric(-cos_t, 1.5)).abs() < 1e-4);
        }
    }
}
