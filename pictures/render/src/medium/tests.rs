use std::sync::Arc;

use antumbra_scene::DensityGrid;
use glam::{Mat4, Vec3};

use super::*;

const COUNT: u64 = 200_000;

fn medium(density: Option<DensityGrid>) -> Medium {
    Medium::new(&antumbra_scene::Medium {
        absorption: Vec3::new(0.2, 0.5, 0.0),
        scattering: Vec3::new(0.6, 0.3, 1.4),
        asymmetry: 0.4,
        density,
    })
}

/// Density 0.75 everywhere in a cube from (-3, -3, -3) to (5, 5, 5), far from whose border cells are not blended.
fn constant_grid() -> DensityGrid {
    DensityGrid {
        size: [16; 3],
        values: vec![0.75; 16 * 16 * 16].into(),
        world_from_grid: Mat4::from_translation(Vec3::splat(-3.0))
            * Mat4::from_scale(Vec3::splat(8.0)),
    }
}

fn near(found: Vec3, expected: Vec3, tolerance: f32, what: &str) {
    let error = (found - expected).abs().max_element();
    assert!(error < tolerance, "{what}: {found} {expected}");
}

/// Mean weights of events by a function of the distance, and of rays that pass.
fn means(medium: &Medium, end: f32, weigh: impl Fn(f32) -> f32) -> [Vec3; 2] {
    let mut sums = [glam::DVec3::ZERO; 2];
    for seed in 0..COUNT {
        let mut random = Random::new(seed);
        match medium.event(
            Vec3::ZERO,
            Vec3::Z,
            end,
            Vec3::new(1.0, 0.3, 0.6),
            &mut random,
        ) {
            Event::Scattered { distance, weight } => {
                assert!(distance < end);
                sums[0] += (weight * weigh(distance)).as_dvec3();
            }
            Event::Passed { weight } => sums[1] += weight.as_dvec3(),
        }
    }
    sums.map(|sum| (sum / COUNT as f64).as_vec3())
}

/// Beer and Lambert: `exp(-σ_t d)` passes, and `∫ σ_s exp(-σ_t t) f(t) dt` is scattered.
#[test]
fn events_have_the_means_of_beer_and_lambert() {
    let end = 1.5;
    for (density, medium) in [(1.0, medium(None)), (0.75, medium(Some(constant_grid())))] {
        let sigma_t = Vec3::new(0.8, 0.8, 1.4) * density;
        let sigma_s = Vec3::new(0.6, 0.3, 1.4) * density;
        let passed = exp(-sigma_t * end);
        let [all, passes] = means(&medium, end, |_| 1.0);
        near(passes, passed, 0.01, "passes");
        near(
            all,
            sigma_s / sigma_t * (Vec3::ONE - passed),
            0.01,
            "scattered",
        );
        let [distances, _] = means(&medium, end, |distance| distance);
        let integral = (Vec3::ONE - passed * (Vec3::ONE + sigma_t * end)) / (sigma_t * sigma_t);
        near(distances, sigma_s * integral, 0.01, "mean distance");
        let mut sum = Vec3::ZERO;
        for seed in 0..20_000 {
            let mut random = Random::new(seed);
            sum += medium.transmittance(Vec3::ZERO, Vec3::Z, end, &mut random);
        }
        near(sum / 20_000.0, passed, 0.01, "transmittance");
    }
}

#[test]
fn nothing_is_attenuated_without_coefficients() {
    let clear = Medium::new(&antumbra_scene::Medium {
        absorption: Vec3::ZERO,
        scattering: Vec3::new(0.0, 0.0, 1.0),
        asymmetry: 0.0,
        density: None,
    });
    let mut random = Random::new(1);
    let passed = clear.transmittance(Vec3::ZERO, Vec3::X, f32::INFINITY, &mut random);
    assert_eq!(passed, Vec3::new(1.0, 1.0, 0.0));
    for seed in 0..100 {
        let throughput = Vec3::new(1.0, 0.0, 0.0);
        let mut random = Random::new(seed);
        match clear.event(Vec3::ZERO, Vec3::X, f32::INFINITY, throughput, &mut random) {
            Event::Passed { weight } => assert_eq!(weight, Vec3::new(1.0, 1.0, 0.0)),
            Event::Scattered { .. } => panic!("red is not scattered"),
        }
    }
}

/// A ramp of density along z, `2 z` in the unit cube, against its integral away from the border cells.
#[test]
fn densities_between_cells_are_interpolated() {
    let side = 10;
    let values: Vec<f32> = (0..side * side * side)
        .map(|index| 2.0 * ((index / (side * side)) as f32 + 0.5) / side as f32)
        .collect();
    let medium = Medium::new(&antumbra_scene::Medium {
        absorption: Vec3::ONE,
        scattering: Vec3::ZERO,
        asymmetry: 0.0,
        density: Some(DensityGrid {
            size: [side as u32; 3],
            values: Arc::from(values),
            world_from_grid: Mat4::IDENTITY,
        }),
    });
    let mut sum = 0.0;
    for seed in 0..100_000 {
        let mut random = Random::new(seed);
        let org = Vec3::new(0.5, 0.4, 0.1);
        sum += f64::from(medium.transmittance(org, Vec3::Z, 0.8, &mut random).x);
    }
    let expected = f64::exp(-(0.9 * 0.9 - 0.1 * 0.1));
    let found = sum / 100_000.0;
    assert!((found - expected).abs() < 0.004, "{found} {expected}");
}

#[test]
fn directions_are_drawn_with_the_density_of_the_phase_function() {
    let dir = Vec3::new(0.6, 0.0, 0.8);
    for g in [-0.7_f32, 0.0, 0.3, 0.9] {
        // The mean cosine of the function is g. So is the mean over drawn directions.
        let (mut cosines, mut inverse) = (0.0, 0.0);
        let count = 40_000;
        for seed in 0..count {
            let wi = phase::sample(g, dir, Random::new(seed).pair());
            assert!((wi.length() - 1.0).abs() < 1e-5);
            let cos = wi.dot(dir);
            cosines += f64::from(cos);
            // The mean of 1 / density over drawn directions is the whole solid angle, weighted to stay finite.
            inverse += f64::from((1.0 + cos) / phase::density(g, cos));
        }
        let mean = cosines / count as f64;
        assert!((mean - f64::from(g)).abs() < 0.015, "{g}: {mean}");
        let whole = inverse / count as f64 / (4.0 * std::f64::consts::PI);
        assert!((whole - 1.0).abs() < 0.05, "{g}: {whole}");
    }
}
