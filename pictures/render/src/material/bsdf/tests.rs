//! Every BSDF: sampling agrees with its density, densities integrate to what is drawn, energy is kept.

use std::sync::Arc;

use antumbra_scene::material::{
    CoatedConductor, CoatedDiffuse, Disney, Glass, Matte, Metal, Metallic, Mirror, Mix, Plastic,
    Substrate, ThinDielectric, Translucent, Uber,
};
use antumbra_scene::{DisneyBody, Material, Param};

use super::*;
use crate::sampler::warp::uniform_sphere;
use crate::sampler::{Method, Sampler, Stream};
use crate::texture::Textures;

fn bsdf(material: &Material) -> Bsdf {
    match crate::material::Material::new(material, &mut Textures::default()) {
        crate::material::Material::Constant(bsdf) => *bsdf,
        other => panic!("nothing varies: {other:?}"),
    }
}

/// Laws that a material obeys, besides the agreement of samples and densities.
#[derive(Clone, Copy, PartialEq)]
enum Holds {
    /// None: the material may reflect more than it receives, or compresses radiance.
    Nothing,
    /// Value from one direction to the other equals the value of the way back, radiance freed of the indices.
    Reciprocity,
    /// Reciprocity, and no more light leaves than arrives.
    Energy,
}

fn matte(kd: f32, sigma: f32) -> Material {
    Material::Matte(Matte {
        kd: Vec3::splat(kd).into(),
        sigma: sigma.into(),
    })
}

fn plastic(kd: f32, ks: f32, roughness: f32, remap_roughness: bool) -> Material {
    Material::Plastic(Plastic {
        kd: Vec3::splat(kd).into(),
        ks: Vec3::splat(ks).into(),
        roughness: roughness.into(),
        remap_roughness,
    })
}

fn glass(kr: f32, kt: f32, roughness: [f32; 2], eta: f32) -> Material {
    Material::Glass(Glass {
        kr: Vec3::splat(kr).into(),
        kt: Vec3::splat(kt).into(),
        eta: eta.into(),
        roughness: roughness.map(Param::Constant),
        remap_roughness: false,
    })
}

fn metal(eta: f32, k: f32, roughness: [f32; 2]) -> Material {
    Material::Metal(Metal {
        eta: Vec3::splat(eta).into(),
        k: Vec3::splat(k).into(),
        roughness: roughness.map(Param::Constant),
        remap_roughness: false,
    })
}

fn substrate(kd: f32, ks: f32, roughness: [f32; 2]) -> Material {
    Material::Substrate(Substrate {
        kd: Vec3::splat(kd).into(),
        ks: Vec3::splat(ks).into(),
        roughness: roughness.map(Param::Constant),
        remap_roughness: false,
    })
}

fn metallic(color: f32, [metallic, roughness]: [f32; 2], coat: f32, clear: f32) -> Material {
    Material::Metallic(Metallic {
        color: Vec3::splat(color).into(),
        metallic: metallic.into(),
        roughness: roughness.into(),
        coat: Vec3::splat(coat).into(),
        transmission: clear.into(),
    })
}

fn translucent(kd: f32, ks: f32, [reflect, transmit]: [f32; 2], roughness: f32) -> Material {
    Material::Translucent(Translucent {
        kd: Vec3::splat(kd).into(),
        ks: Vec3::splat(ks).into(),
        reflect: Vec3::splat(reflect).into(),
        transmit: Vec3::splat(transmit).into(),
        roughness: roughness.into(),
        remap_roughness: false,
    })
}

fn uber([kd, ks, kr, kt]: [f32; 4], opacity: f32, eta: f32) -> Material {
    let color = |value: f32| Param::Constant(Vec3::splat(value));
    Material::Uber(Uber {
        kd: color(kd),
        ks: color(ks),
        kr: color(kr),
        kt: color(kt),
        roughness: [0.3, 0.5].map(Param::Constant),
        opacity: color(opacity),
        eta: eta.into(),
        remap_roughness: false,
    })
}

fn coated(reflectance: f32, eta: f32, alpha: f32) -> Material {
    Material::CoatedDiffuse(CoatedDiffuse {
        reflectance: Vec3::splat(reflectance).into(),
        eta: eta.into(),
        roughness: alpha.into(),
    })
}

fn coated_metal([eta, k]: [f32; 2], roughness: f32, coat_eta: f32, coat: [f32; 2]) -> Material {
    Material::CoatedConductor(CoatedConductor {
        eta: Vec3::splat(eta).into(),
        k: Vec3::splat(k).into(),
        roughness: [roughness; 2].map(Param::Constant),
        coat_eta: coat_eta.into(),
        coat_roughness: coat.map(Param::Constant),
    })
}

/// A `disney` of one grey: metal, roughness, anisotropy, sheen, clear coat, its gloss, and refraction.
fn disney(color: f32, numbers: [f32; 7], thin: Option<[f32; 2]>) -> Material {
    let [
        metallic,
        roughness,
        anisotropic,
        sheen,
        coat,
        gloss,
        refracted,
    ] = numbers;
    Material::Disney(Disney {
        color: Vec3::splat(color).into(),
        metallic: metallic.into(),
        eta: 1.5.into(),
        roughness: roughness.into(),
        specular_tint: 0.3.into(),
        anisotropic: anisotropic.into(),
        sheen: sheen.into(),
        sheen_tint: 0.5.into(),
        clearcoat: coat.into(),
        clearcoat_gloss: gloss.into(),
        specular_transmission: refracted.into(),
        body: match thin {
            Some([flatness, passed]) => DisneyBody::Thin {
                flatness: flatness.into(),
                diffuse_transmission: passed.into(),
            },
            None => DisneyBody::Solid {
                scatter_distance: Vec3::ZERO.into(),
            },
        },
    })
}

fn mix(first: Material, second: Material, amount: f32) -> Material {
    Material::Mix(Mix {
        materials: [Arc::new(first), Arc::new(second)],
        amount: Vec3::splat(amount).into(),
    })
}

fn materials() -> Vec<(&'static str, Material, Holds)> {
    use Holds::{Energy, Nothing, Reciprocity};
    let mixture = mix(
        mix(matte(0.9, 0.0), metal(0.2, 3.9, [0.4, 0.4]), 0.3),
        mix(
            glass(1.0, 1.0, [0.0, 0.0], 1.5),
            substrate(0.5, 0.5, [0.5, 0.5]),
            0.6,
        ),
        0.4,
    );
    let rough = |kr, kt, u, v, eta| glass(kr, kt, [u, v], eta);
    vec![
        ("lambert", matte(1.0, 0.0), Energy),
        ("oren-nayar", matte(1.0, 30.0), Reciprocity),
        ("plastic", plastic(0.5, 0.5, 0.1, true), Energy),
        ("coat", plastic(0.0, 1.0, 0.3, false), Energy),
        ("rough glass", rough(1.0, 1.0, 0.3, 0.3, 1.5), Reciprocity),
        ("brushed glass", rough(1.0, 1.0, 0.2, 0.6, 1.3), Reciprocity),
        ("transmission", rough(0.0, 1.0, 0.4, 0.4, 1.5), Reciprocity),
        ("reflection", rough(1.0, 0.0, 0.4, 0.4, 1.5), Energy),
        ("metal", metal(0.2, 3.9, [0.3, 0.3]), Energy),
        ("brushed metal", metal(1.1, 2.1, [0.15, 0.6]), Energy),
        ("substrate", substrate(0.6, 0.4, [0.3, 0.3]), Energy),
        ("brushed substrate", substrate(0.2, 0.7, [0.6, 0.2]), Energy),
        ("sheet", translucent(0.9, 0.0, [0.3, 0.7], 0.4), Energy),
        (
            "translucent",
            translucent(0.5, 0.5, [0.4, 0.6], 0.4),
            Nothing,
        ),
        ("uber", uber([0.3, 0.3, 0.2, 0.4], 0.7, 1.4), Energy),
        ("opaque uber", uber([0.3, 0.6, 0.0, 0.0], 1.0, 1.4), Energy),
        ("mixture", mixture, Reciprocity),
        ("paint", metallic(0.9, [0.0, 0.4], 0.04, 0.0), Energy),
        ("diamond", metallic(1.0, [0.0, 0.6], 0.17, 0.0), Energy),
        (
            "polished metal",
            metallic(0.8, [1.0, 0.3], 0.04, 0.0),
            Energy,
        ),
        ("rough metal", metallic(0.9, [1.0, 1.0], 0.04, 0.0), Energy),
        ("half metal", metallic(0.7, [0.5, 0.7], 0.04, 0.0), Energy),
        ("coated white", coated(1.0, 1.5, 0.2), Energy),
        ("coated grey", coated(0.5, 1.8, 0.6), Energy),
        (
            "coated metal",
            coated_metal([0.2, 3.9], 0.3, 1.5, [0.2, 0.2]),
            Energy,
        ),
        (
            "brushed coat",
            coated_metal([1.5, 7.0], 0.2, 1.4, [0.2, 0.5]),
            Energy,
        ),
        (
            "disney",
            disney(0.7, [0.0, 0.5, 0.0, 0.0, 0.0, 1.0, 0.0], None),
            Reciprocity,
        ),
        (
            "brushed disney",
            disney(0.9, [0.6, 0.6, 0.8, 0.5, 1.0, 0.3, 0.0], None),
            Reciprocity,
        ),
        (
            "clear disney",
            disney(0.9, [0.2, 0.5, 0.5, 0.0, 0.5, 0.0, 0.7], None),
            Reciprocity,
        ),
        (
            "thin disney",
            disney(0.9, [0.1, 0.7, 0.3, 0.4, 0.0, 0.0, 0.0], Some([0.6, 1.2])),
            Reciprocity,
        ),
        ("foil", metallic(0.8, [0.1, 0.5], 0.04, 0.6), Energy),
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
        let bsdf = bsdf(&material);
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
    for (name, material, holds) in materials() {
        let bsdf = bsdf(&material);
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
            if holds == Holds::Energy {
                let delta = bsdf.delta_reflection(wo).map_or(0.0, |lobe| lobe.weight.x);
                let passed = mean_transmission(&bsdf, wo);
                let total = by_density + f64::from(delta) + passed;
                assert!(total < 1.005, "{name} {wo}: {total}");
            }
        }
    }
}

/// Reflection is symmetric. So is refraction, once radiance is divided by the squared index on each side.
#[test]
fn values_are_reciprocal() {
    for (name, material, holds) in materials() {
        if holds == Holds::Nothing {
            continue;
        }
        let bsdf = bsdf(&material);
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
    let rough = bsdf(&glass(1.0, 1.0, [0.01, 0.01], 1.5));
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

/// A white base under any coat reflects all light, and a coat makes coloured bases darker: light that returns to the base is
/// absorbed again.
#[test]
fn white_bases_under_coats_lose_nothing() {
    let mean = |material: &Material, wo: Vec3| {
        let bsdf = bsdf(material);
        let count = 1 << 14;
        let sum: f64 = streams(count)
            .filter_map(|stream| {
                let wi = bsdf.sample(wo, stream.uniform(0), stream.pair(1))?;
                let e = evaluate(&bsdf, wo, wi);
                (e.pdf > 0.0).then(|| f64::from(e.value.x * wi.z.abs() / e.pdf))
            })
            .sum();
        sum / f64::from(count)
    };
    for wo in views() {
        for (eta, alpha) in [(1.5, 0.0), (1.5, 0.25), (1.3, 0.8), (2.4, 0.1)] {
            let white = mean(&coated(1.0, eta, alpha), wo);
            assert!((white - 1.0).abs() < 0.012, "{wo} {eta} {alpha}: {white}");
        }
        // Less than the base times what passes and the reflection of the coat would add up to.
        let [coated, paint] = [coated(0.5, 1.5, 0.25), metallic(0.5, [0.0, 0.5], 0.04, 0.0)]
            .map(|material| mean(&material, wo));
        assert!(coated < 0.9 * paint, "{wo}: {coated} {paint}");
    }
}

/// The series of returns, with Fresnel's formulas in the place of Schlick's: straight on, a smooth coat of index 1.5 over a
/// base of 0.5 has `(1 - 0.04)² 0.5 / (π 2.25 (1 - 0.5 R))` with R = 0.596, the mean reflectance from inside.
#[test]
fn smooth_coats_have_the_value_of_the_series() {
    let bsdf = bsdf(&coated(0.5, 1.5, 0.0));
    let [wo, wi] = [Vec3::Z, Vec3::new(0.2, 0.0, 1.0).normalize()];
    let found = f64::from(evaluate(&bsdf, wo, wi).value.x);
    let expected = 0.96 * 0.96 * 0.5 / (std::f64::consts::PI * 2.25 * (1.0 - 0.5 * 0.596));
    assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
}

/// A coat of index 1 is none. Smooth coats over mirrors reflect `F + (1 - F)² C / (1 - F C)`.
#[test]
fn coats_over_conductors() {
    let bare = bsdf(&metal(0.2, 3.9, [0.3, 0.3]));
    let under = bsdf(&coated_metal([0.2, 3.9], 0.3, 1.0, [0.3, 0.3]));
    for wo in views() {
        for stream in streams(100) {
            let wi = uniform_sphere(stream.pair(3));
            let [bare, under] = [&bare, &under].map(|bsdf| evaluate(bsdf, wo, wi).value.x);
            assert!(
                (bare - under).abs() <= 1e-3 * bare + 1e-6,
                "{wo} {wi}: {bare} {under}"
            );
        }
    }
    // Straight on: F = 0.04, and the metal of index 1.5 n has the reflectance C of n in vacuum.
    let (n, k) = (Vec3::splat(0.3), Vec3::splat(4.5));
    let c = ((0.2_f32 - 1.0).powi(2) + 9.0) / ((0.2_f32 + 1.0).powi(2) + 9.0);
    let found = fresnel::coated(1.0, n, k, 1.5).x;
    let expected = 0.96 * 0.96 * c / (1.0 - 0.04 * c);
    assert!((found - expected).abs() < 1e-4, "{found} {expected}");
    assert_eq!(fresnel::coated(0.0, n, k, 1.5), Vec3::ZERO, "grazing");
}

/// A pane reflects `2 F / (1 + F)` and lets the rest pass, straight on.
#[test]
fn panes_keep_energy() {
    let pane = bsdf(&Material::ThinDielectric(ThinDielectric {
        eta: 1.5.into(),
    }));
    for wo in views() {
        let reflected = pane.delta_reflection(wo).expect("a reflection").weight.x;
        let passed = pane.delta_transmission(wo, 0.5).expect("light goes on");
        assert_eq!((passed.wi, passed.eta), (-wo, 1.0));
        assert!((reflected + passed.weight.x - 1.0).abs() < 1e-6, "{wo}");
        if wo == Vec3::Z {
            assert!((reflected - 0.08 / 1.04).abs() < 1e-5, "{reflected}");
        }
        let mut share = 0.0;
        for stream in streams(4096) {
            let lobe = pane.sample_delta(wo, stream.uniform(0)).expect("a lobe");
            assert_eq!(lobe.weight, Vec3::ONE);
            share += f32::from(u8::from(lobe.wi.z * wo.z > 0.0)) / 4096.0;
        }
        assert!(
            (share - reflected).abs() < 0.01,
            "{wo}: {share} {reflected}"
        );
    }
}

/// Mean transmission of the delta lobes, without the factor of refraction for radiance from below.
fn mean_transmission(bsdf: &Bsdf, wo: Vec3) -> f64 {
    let count = 64;
    let taken = (0..count).filter_map(|i| bsdf.delta_transmission(wo, i as f32 / count as f32));
    let freed = taken.map(|lobe| {
        let ratio = if wo.z > 0.0 { lobe.eta } else { 1.0 / lobe.eta };
        f64::from(lobe.weight.x * ratio * ratio)
    });
    freed.sum::<f64>() / f64::from(count)
}

#[test]
fn black_materials_and_missing_lobes() {
    assert!(bsdf(&glass(0.0, 0.0, [0.1, 0.1], 1.5)).is_black());
    let mirror = |kr: f32| {
        Material::Mirror(Mirror {
            kr: Vec3::splat(kr).into(),
        })
    };
    assert!(bsdf(&mirror(-1.0)).is_black());
    assert!(bsdf(&matte(0.0, 0.0)).is_black());
    assert!(bsdf(&substrate(0.0, 0.0, [0.1; 2])).is_black());
    assert!(bsdf(&translucent(1.0, 1.0, [0.0; 2], 0.1)).is_black());
    assert!(bsdf(&uber([0.0; 4], 1.0, 1.5)).is_black());
    assert!(bsdf(&mix(Material::None, matte(0.5, 0.0), 1.0)).is_black());
    let smooth = bsdf(&glass(1.0, 0.0, [0.0, 0.0], 1.5));
    assert!(smooth.delta_share() == 1.0 && smooth.transmits());
    assert!(bsdf(&glass(1.0, 1.0, [0.0, 0.1], 1.5)).is_anisotropic());
    assert!(bsdf(&metal(1.0, 1.0, [0.2, 0.1])).is_anisotropic());
    assert!(bsdf(&substrate(1.0, 1.0, [0.2, 0.1])).is_anisotropic());
    assert!(!bsdf(&metal(1.0, 1.0, [0.2, 0.2])).is_anisotropic());
    let mixed = bsdf(&mix(mirror(1.0), plastic(0.5, 0.5, 0.1, true), 0.5));
    assert_eq!(mixed.delta_share(), 1.0 / 3.0);
    assert!(!mixed.transmits());
    assert!(bsdf(&uber([0.5, 0.0, 0.0, 0.0], 0.5, 1.5)).transmits());
    // A mix with none of the first material is the second.
    let other = bsdf(&mix(mirror(1.0), matte(0.5, 0.0), 0.0));
    assert!(other.lambert().is_some());
}

/// Smooth facets of a conductor that reflects all, and a sheet that scatters all, lose nothing.
#[test]
fn white_furnace() {
    for (material, tolerance) in [
        (metal(1.0, 1e4, [0.02, 0.02]), 0.01),
        (matte(1.0, 0.0), 1e-4),
        (translucent(1.0, 0.0, [0.3, 0.7], 0.1), 0.01),
        // Light goes straight through.
        (glass(1.0, 1.0, [0.1, 0.1], 1.0), 0.03),
    ] {
        let bsdf = bsdf(&material);
        for wo in views() {
            let (count, mut albedo) = (4096, 0.0);
            for stream in streams(count) {
                if let Some(wi) = bsdf.sample(wo, stream.uniform(0), stream.pair(1)) {
                    let e = evaluate(&bsdf, wo, wi);
                    albedo += f64::from(e.value.x * wi.z.abs() / e.pdf) / f64::from(count);
                }
            }
            assert!(
                (albedo - 1.0).abs() < tolerance,
                "{material:?} {wo}: {albedo}"
            );
        }
    }
}

/// Values and delta lobes of a mixture are sums over its parts, scaled, in whatever way they are drawn.
#[test]
fn mixtures_are_sums() {
    let parts = [
        uber([0.3, 0.3, 0.2, 0.4], 0.6, 1.4),
        mix(
            glass(0.8, 0.9, [0.0; 2], 1.3),
            translucent(0.5, 0.5, [0.4, 0.6], 0.4),
            0.3,
        ),
    ];
    let whole = bsdf(&mix(parts[0].clone(), parts[1].clone(), 0.25));
    let parts = parts.map(|part| bsdf(&part));
    let shares = [0.25, 0.75];
    for wo in views() {
        for stream in streams(100) {
            let wi = uniform_sphere(stream.pair(0));
            let found = evaluate(&whole, wo, wi).value;
            let sum = parts.iter().zip(shares);
            let sum = sum.map(|(part, share)| evaluate(part, wo, wi).value * share);
            let sum = sum.sum::<Vec3>();
            assert!(
                (found - sum).length() <= 1e-4 * sum.length() + 1e-6,
                "{wo} {wi}"
            );
        }
        // Drawn one by one, as a path does, and branch by branch.
        let count = 1 << 14;
        let mut drawn = 0.0;
        for stream in streams(count) {
            if let Some(lobe) = whole.sample_delta(wo, stream.uniform(0)) {
                drawn += f64::from(lobe.weight.x) / f64::from(count);
            }
        }
        let branches = |bsdf: &Bsdf| {
            let mut sum = f64::from(bsdf.delta_reflection(wo).map_or(0.0, |l| l.weight.x));
            for i in 0..60 {
                let branch = bsdf.delta_transmission(wo, (i as f32 + 0.5) / 60.0);
                sum += branch.map_or(0.0, |lobe| f64::from(lobe.weight.x)) / 60.0;
            }
            sum
        };
        let sum = 0.25 * branches(&parts[0]) + 0.75 * branches(&parts[1]);
        assert!((branches(&whole) - sum).abs() < 1e-5, "{wo}");
        assert!((drawn - sum).abs() < 0.01, "{wo}: {drawn} {sum}");
    }
}

/// A reflection by the geometric normal has a value below the shading horizon and is never drawn there.
#[test]
fn the_geometric_normal_decides_between_reflection_and_transmission() {
    let bsdf = bsdf(&matte(1.0, 0.0));
    let wo = Vec3::new(0.6, 0.0, 0.8);
    let below = Vec3::new(0.8, 0.0, -0.6);
    let seen = bsdf.evaluate(wo, below, true);
    assert!(seen.value.x > 0.3 && seen.pdf == 0.0);
    let hidden = bsdf.evaluate(wo, -below, false);
    assert!(hidden.value.x == 0.0 && hidden.pdf > 0.0);
}

/// White surfaces lose no light, at any roughness, share of metal and coat.
#[test]
fn white_metallic_surfaces_reflect_all_light() {
    let count = 1 << 16;
    for metal in [0.0, 0.5, 1.0] {
        for roughness in [0.1, 0.25, 0.5, 0.77, 1.0] {
            for coat in [0.0, 0.04, 0.3] {
                let bsdf = bsdf(&metallic(1.0, [metal, roughness], coat, 0.0));
                for wo in views() {
                    let mut sum = 0.0;
                    for stream in streams(count) {
                        let wi = bsdf.sample(wo, stream.uniform(0), stream.pair(1));
                        let Some(wi) = wi else {
                            continue;
                        };
                        let e = evaluate(&bsdf, wo, wi);
                        sum += f64::from(e.value.x * wi.z.abs() / e.pdf);
                    }
                    let found = sum / f64::from(count);
                    assert!(
                        (found - 1.0).abs() < 0.005,
                        "metal {metal} roughness {roughness} coat {coat} {wo}: {found}"
                    );
                }
            }
        }
    }
}

/// Clear sheets pass what their coat does not reflect: together they lose nothing, seen straight on and from the side.
#[test]
fn clear_sheets_lose_nothing() {
    for roughness in [0.2, 0.6] {
        let bsdf = bsdf(&metallic(1.0, [0.0, roughness], 0.04, 1.0));
        for wo in views() {
            let passed = mean_transmission(&bsdf, wo);
            let count = 1 << 15;
            let mut reflected = 0.0;
            for stream in streams(count) {
                if let Some(wi) = bsdf.sample(wo, stream.uniform(0), stream.pair(1)) {
                    let e = evaluate(&bsdf, wo, wi);
                    reflected += f64::from(e.value.x * wi.z.abs() / e.pdf) / f64::from(count);
                }
            }
            let sum = passed + reflected;
            assert!(
                (sum - 1.0).abs() < 0.01,
                "{roughness} {wo}: {passed} {reflected}"
            );
        }
    }
}
