//! Every BSDF: sampling agrees with its density, densities integrate to what is drawn, energy is kept.

use super::*;
use crate::frame::uniform_sphere;
use crate::sampler::{Method, Sampler, Stream};

fn materials() -> Vec<(&'static str, Material, bool)> {
    let half = Vec3::splat(0.5);
    let one = Vec3::ONE;
    let matte = |sigma: f32| Material::Matte {
        kd: one.into(),
        sigma: sigma.into(),
    };
    let plastic = |kd: Vec3, ks: Vec3, roughness: f32, remap_roughness| Material::Plastic {
        kd: kd.into(),
        ks: ks.into(),
        roughness: roughness.into(),
        remap_roughness,
    };
    let glass = |kr: Vec3, kt: Vec3, roughness: [f32; 2], eta: f32| Material::Glass {
        kr: kr.into(),
        kt: kt.into(),
        eta: eta.into(),
        roughness: roughness.map(Param::Constant),
        remap_roughness: false,
    };
    vec![
        ("lambert", matte(0.0), true),
        ("oren-nayar", matte(30.0), false),
        ("plastic", plastic(half, half, 0.1, true), true),
        ("coat", plastic(Vec3::ZERO, one, 0.3, false), true),
        ("rough glass", glass(one, one, [0.3, 0.3], 1.5), false),
        ("anisotropic glass", glass(one, one, [0.2, 0.6], 1.3), false),
        (
            "rough transmission",
            glass(Vec3::ZERO, one, [0.4, 0.4], 1.5),
            false,
        ),
        (
            "rough reflection",
            glass(one, Vec3::ZERO, [0.4, 0.4], 1.5),
            true,
        ),
    ]
}

fn views() -> Vec<Vec3> {
    [
        [0.0, 0.0, 1.0],
        [0.5, 0.2, 0.8],
        [-0.8, 0.3, 0.3],
        [0.3, 0.1, -0.9],
        [0.7, -0.5, -0.4],
    ]
    .map(|v| Vec3::from(v).normalize())
    .to_vec()
}

fn streams(count: u32) -> impl Iterator<Item = Stream> {
    let sampler = Sampler::new(Method::OwenSobol, 17);
    (0..count).map(move |i| sampler.stream(1, 2, i))
}

/// Sides of local and geometric normal agree here.
fn evaluate(bsdf: &Bsdf, wo: Vec3, wi: Vec3) -> Evaluation {
    bsdf.evaluate(wo, wi, wo.z * wi.z > 0.0)
}

/// The share of successful draws in every cell of the sphere is the integral of the density over it.
#[test]
fn samples_follow_their_density() {
    let count = 1 << 18;
    let (rows, columns) = (8, 8);
    let cell = |w: Vec3| {
        let row = ((w.z + 1.0) / 2.0 * rows as f32) as usize;
        let turn = libm::atan2f(w.y, w.x) / std::f32::consts::TAU + 0.5;
        row.min(rows - 1) * columns + ((turn * columns as f32) as usize).min(columns - 1)
    };
    for (name, material, _) in materials() {
        let bsdf = Bsdf::new(&material);
        for wo in views() {
            let mut drawn = vec![0.0; rows * columns];
            let mut expected = vec![0.0; rows * columns];
            for stream in streams(count) {
                if let Some(wi) = bsdf.sample(wo, stream.uniform(0), stream.pair(1)) {
                    assert!((wi.length() - 1.0).abs() < 1e-3, "{name} {wo} {wi}");
                    drawn[cell(wi)] += 1.0 / f64::from(count);
                }
                let wi = uniform_sphere(stream.pair(2));
                let pdf = f64::from(evaluate(&bsdf, wo, wi).pdf);
                expected[cell(wi)] += pdf * 4.0 * std::f64::consts::PI / f64::from(count);
            }
            for (i, (d, e)) in drawn.iter().zip(&expected).enumerate() {
                assert!(
                    (d - e).abs() < 0.004 + 0.03 * e,
                    "{name} {wo} cell {i}: {d} {e}"
                );
            }
        }
    }
}

/// The albedo measured by sampling the density equals the one measured blindly, and is at most 1.
#[test]
fn albedo_does_not_depend_on_how_it_is_measured() {
    let count = 1 << 17;
    for (name, material, energy_bound) in materials() {
        let bsdf = Bsdf::new(&material);
        for wo in views() {
            let (mut by_density, mut blind) = (0.0, 0.0);
            for stream in streams(count) {
                let value = |wi: Vec3| {
                    let e = evaluate(&bsdf, wo, wi);
                    (f64::from(e.value.x * wi.z.abs()), f64::from(e.pdf))
                };
                if let Some(wi) = bsdf.sample(wo, stream.uniform(0), stream.pair(1)) {
                    let (value, pdf) = value(wi);
                    if pdf > 0.0 {
                        by_density += value / pdf;
                    }
                }
                blind += value(uniform_sphere(stream.pair(2))).0 * 4.0 * std::f64::consts::PI;
            }
            let (by_density, blind) = (by_density / f64::from(count), blind / f64::from(count));
            assert!(
                (by_density - blind).abs() < 0.01 + 0.02 * blind,
                "{name} {wo}: {by_density} {blind}"
            );
            if energy_bound {
                assert!(by_density < 1.005, "{name} {wo}: {by_density}");
            }
        }
    }
}

/// Reflection is symmetric; refraction is once radiance is freed of the index on each side.
#[test]
fn values_are_reciprocal() {
    for (name, material, _) in materials() {
        let bsdf = Bsdf::new(&material);
        let squared = bsdf.eta() * bsdf.eta();
        for wo in views() {
            for stream in streams(200) {
                let wi = uniform_sphere(stream.pair(3));
                let [there, back] = [(wo, wi), (wi, wo)].map(|(o, i)| {
                    let basic = if o.z * i.z < 0.0 && o.z > 0.0 {
                        squared
                    } else {
                        1.0
                    };
                    evaluate(&bsdf, o, i).value.x * basic
                });
                let size = there.abs().max(back.abs());
                assert!(
                    (there - back).abs() <= 1e-3 * size + 1e-6,
                    "{name} {wo} {wi}: {there} {back}"
                );
            }
        }
    }
}

/// A rough interface between almost equal roughness 0 approaches the smooth one.
#[test]
fn rough_glass_tends_to_smooth_glass() {
    let rough = Bsdf::new(&Material::Glass {
        kr: Vec3::ONE.into(),
        kt: Vec3::ONE.into(),
        eta: 1.5.into(),
        roughness: [0.01, 0.01].map(Param::Constant),
        remap_roughness: false,
    });
    let smooth = Specular::Glass {
        kr: Vec3::ONE,
        kt: Vec3::ONE,
        eta: 1.5,
    };
    for wo in views() {
        let mut sum = [0.0_f64; 2];
        let count = 1 << 15;
        for stream in streams(count) {
            if let Some(wi) = rough.sample(wo, stream.uniform(0), stream.pair(1)) {
                let e = evaluate(&rough, wo, wi);
                let side = usize::from(wo.z * wi.z < 0.0);
                sum[side] += f64::from(e.value.x * wi.z.abs() / e.pdf) / f64::from(count);
            }
        }
        let expected = [smooth.reflection(wo), smooth.transmission(wo)]
            .map(|lobe| lobe.map_or(0.0, |lobe| f64::from(lobe.weight.x)));
        for (found, expected) in sum.iter().zip(expected) {
            assert!(
                (found - expected).abs() < 0.02 + 0.02 * expected,
                "{wo}: {sum:?} {expected:?}"
            );
        }
    }
}

/// Smooth glass loses nothing: flux is radiance over the squared index on its side.
#[test]
fn smooth_glass_keeps_energy() {
    let glass = Specular::Glass {
        kr: Vec3::ONE,
        kt: Vec3::ONE,
        eta: 1.5,
    };
    for wo in views() {
        let ratio: f32 = if wo.z > 0.0 { 1.5 } else { 1.0 / 1.5 };
        let reflected = glass.reflection(wo).map_or(0.0, |lobe| lobe.weight.x);
        let passed = glass.transmission(wo).map_or(0.0, |lobe| lobe.weight.x);
        assert!(
            (reflected + passed * ratio * ratio - 1.0).abs() < 1e-4,
            "{wo}"
        );
        let mut mean = 0.0;
        for stream in streams(4096) {
            let lobe = glass
                .sample(wo, stream.uniform(0))
                .expect("one lobe always exists");
            mean += lobe.weight.x / 4096.0;
        }
        assert!((mean - reflected - passed).abs() < 0.01, "{wo}");
    }
}

#[test]
fn black_materials_and_missing_lobes() {
    let glass = |kr: Vec3, kt: Vec3, roughness: [f32; 2]| Material::Glass {
        kr: kr.into(),
        kt: kt.into(),
        eta: 1.5.into(),
        roughness: roughness.map(Param::Constant),
        remap_roughness: true,
    };
    let zero = Vec3::ZERO;
    assert!(Bsdf::new(&glass(zero, zero, [0.1, 0.1])).is_black());
    assert!(
        Bsdf::new(&Material::Mirror {
            kr: (-Vec3::ONE).into()
        })
        .is_black()
    );
    assert!(
        Bsdf::new(&Material::Matte {
            kd: zero.into(),
            sigma: 0.0.into()
        })
        .is_black()
    );
    let smooth = Bsdf::new(&glass(Vec3::ONE, zero, [0.0, 0.0]));
    assert!(smooth.specular().is_some() && smooth.transmits());
    assert!(Bsdf::new(&glass(Vec3::ONE, Vec3::ONE, [0.0, 0.1])).is_anisotropic());
}

/// A reflection by the geometric normal has a value below the shading horizon and is never drawn there.
#[test]
fn the_geometric_normal_decides_between_reflection_and_transmission() {
    let bsdf = Bsdf::new(&Material::Matte {
        kd: Vec3::ONE.into(),
        sigma: 0.0.into(),
    });
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let below = Vec3::new(0.8, 0.0, -0.6);
    let seen = bsdf.evaluate(wo, below, true);
    assert!(seen.value.x > 0.3 && seen.pdf == 0.0);
    let hidden = bsdf.evaluate(wo, -below, false);
    assert!(hidden.value.x == 0.0 && hidden.pdf > 0.0);
}
