//! Reflectance of a smooth interface between two dielectrics.

/// Unpolarised Fresnel reflectance for a direction with cosine `cos_i` to the normal.
///
/// `eta` is the index of refraction below the normal over that above it; a negative cosine comes from
/// below. 1 under total internal reflection.
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
