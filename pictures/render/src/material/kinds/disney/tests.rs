//! Compares `disney` with the formulas of pbrt-v3 in double precision, written again from Burley's notes.

use antumbra_scene::{DisneyBody, Material, Param};

use super::*;
use crate::sampler::warp::uniform_sphere;
use crate::sampler::{Method, Sampler};
use crate::texture::Textures;
use std::f64::consts::PI;

type Color = [f64; 3];

/// Plain numbers of a `disney`.
#[derive(Clone, Copy, Debug)]
struct Numbers {
    color: Color,
    metallic: f64,
    eta: f64,
    roughness: f64,
    specular_tint: f64,
    anisotropic: f64,
    sheen: f64,
    sheen_tint: f64,
    clearcoat: f64,
    gloss: f64,
    clear: f64,
    /// Flatness and diffuse transmission.
    thin: Option<[f64; 2]>,
}

const PLAIN: Numbers = Numbers {
    color: [0.8, 0.4, 0.1],
    metallic: 0.0,
    eta: 1.5,
    roughness: 0.5,
    specular_tint: 0.0,
    anisotropic: 0.0,
    sheen: 0.0,
    sheen_tint: 0.5,
    clearcoat: 0.0,
    gloss: 1.0,
    clear: 0.0,
    thin: None,
};

fn scene(n: &Numbers) -> Disney {
    let number = |value: f64| Param::Constant(value as f32);
    Disney {
        color: Vec3::from(n.color.map(|c| c as f32)).into(),
        metallic: number(n.metallic),
        eta: number(n.eta),
        roughness: number(n.roughness),
        specular_tint: number(n.specular_tint),
        anisotropic: number(n.anisotropic),
        sheen: number(n.sheen),
        sheen_tint: number(n.sheen_tint),
        clearcoat: number(n.clearcoat),
        clearcoat_gloss: number(n.gloss),
        specular_transmission: number(n.clear),
        body: match n.thin {
            Some([flatness, passed]) => DisneyBody::Thin {
                flatness: number(flatness),
                diffuse_transmission: number(passed),
            },
            None => DisneyBody::Solid {
                scatter_distance: Vec3::ZERO.into(),
            },
        },
    }
}

fn lowered(disney: Disney) -> Bsdf {
    let material = Material::Disney(disney);
    match crate::material::Material::new(&material, &mut Textures::default()) {
        crate::material::Material::Constant(bsdf) => *bsdf,
        other => panic!("nothing varies: {other:?}"),
    }
}

fn lerp(t: f64, a: f64, b: f64) -> f64 {
    (1.0 - t) * a + t * b
}

fn fifth(cos: f64) -> f64 {
    (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// Fresnel's formulas for a ray in a medium of index 1 over one of `eta`, or below it where the cosine is negative.
fn fresnel(cos: f64, eta: f64) -> f64 {
    let [outer, inner] = if cos > 0.0 { [1.0, eta] } else { [eta, 1.0] };
    let cos = cos.abs();
    let sin_inner = outer / inner * (1.0 - cos * cos).max(0.0).sqrt();
    if sin_inner >= 1.0 {
        return 1.0;
    }
    let cos_inner = (1.0 - sin_inner * sin_inner).sqrt();
    let parallel = (inner * cos - outer * cos_inner) / (inner * cos + outer * cos_inner);
    let across = (outer * cos - inner * cos_inner) / (outer * cos + inner * cos_inner);
    (parallel * parallel + across * across) / 2.0
}

/// Slope distribution of Trowbridge and Reitz, by tangent and azimuth.
fn distribution(h: [f64; 3], [ax, ay]: [f64; 2]) -> f64 {
    let cos2 = h[2] * h[2];
    let tan2 = (1.0 - cos2).max(0.0) / cos2;
    let across2 = h[0] * h[0] + h[1] * h[1];
    let [part_x, part_y] = match across2 > 0.0 {
        true => [h[0] * h[0] / across2, h[1] * h[1] / across2],
        false => [1.0, 0.0],
    };
    let e = tan2 * (part_x / (ax * ax) + part_y / (ay * ay));
    1.0 / (PI * ax * ay * cos2 * cos2 * (1.0 + e) * (1.0 + e))
}

fn lambda(w: [f64; 3], [ax, ay]: [f64; 2]) -> f64 {
    let slope2 = (ax * w[0] / w[2]).powi(2) + (ay * w[1] / w[2]).powi(2);
    ((1.0 + slope2).sqrt() - 1.0) / 2.0
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn normalized(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

/// Value for reflection, light and viewer on one side.
fn reflected(n: &Numbers, o: [f64; 3], i: [f64; 3]) -> Color {
    let h = normalized([o[0] + i[0], o[1] + i[1], o[2] + i[2]]);
    let up = if h[2] < 0.0 { h.map(|x| -x) } else { h };
    let (cos_o, cos_i, cos_d) = (o[2].abs(), i[2].abs(), dot(i, h));
    let light = dot(n.color, [0.212_671, 0.715_160, 0.072_169]);
    let base = (1.0 - n.metallic) * (1.0 - n.clear);
    let (fo, fi) = (fifth(cos_o), fifth(cos_i));
    let lambert = (1.0 - fo / 2.0) * (1.0 - fi / 2.0) / PI;
    let rr = 2.0 * n.roughness * cos_d * cos_d;
    let retro = rr * (fo + fi + fo * fi * (rr - 1.0)) / PI;
    let fss90 = cos_d * cos_d * n.roughness;
    let fss = lerp(fo, 1.0, fss90) * lerp(fi, 1.0, fss90);
    let flat_value = 1.25 * (fss * (1.0 / (cos_o + cos_i) - 0.5) + 0.5) / PI;
    let [flat, kept] = n.thin.map_or([0.0, 1.0], |[f, t]| [f, 1.0 - t / 2.0]);

    let aspect = (1.0 - 0.9 * n.anisotropic).sqrt();
    let square = n.roughness * n.roughness;
    let alphas = [square / aspect, square * aspect].map(|a| a.max(0.001));
    let masked = 1.0 / (1.0 + lambda(o, alphas)) / (1.0 + lambda(i, alphas));
    let facets = distribution(h, alphas) * masked / (4.0 * cos_o * cos_i);
    let cos_f = dot(i, up);

    let coat_alpha = lerp(n.gloss, 0.1, 0.001);
    let a2: f64 = coat_alpha * coat_alpha;
    let gtr1 = (a2 - 1.0) / (PI * a2.ln() * (1.0 + (a2 - 1.0) * h[2] * h[2]));
    let smith = |cos: f64| 1.0 / (cos + (0.0625 + cos * cos - 0.0625 * cos * cos).sqrt());
    let coat =
        n.clearcoat * smith(cos_o) * smith(cos_i) * lerp(fifth(dot(o, h)), 0.04, 1.0) * gtr1 / 4.0;
    [0, 1, 2].map(|c| {
        let tint = n.color[c] / light;
        let straight = ((n.eta - 1.0) / (n.eta + 1.0)).powi(2);
        let f0 = straight * lerp(n.specular_tint, 1.0, tint);
        let r0 = lerp(n.metallic, f0, n.color[c]);
        let shine = lerp(
            n.metallic,
            fresnel(cos_f, n.eta),
            lerp(fifth(cos_f), r0, 1.0),
        );
        let sheen = n.sheen * lerp(n.sheen_tint, 1.0, tint) * fifth(cos_d);
        let diffuse = n.color[c] * (kept * lerp(flat, lambert, flat_value) + retro);
        base * (diffuse + sheen) + facets * shine + coat
    })
}

/// Value for light and viewer on different sides.
fn transmitted(n: &Numbers, o: [f64; 3], i: [f64; 3]) -> Color {
    let diffuse = n.thin.map_or(0.0, |[_, t]| t / 2.0 / PI);
    let eta = if o[2] > 0.0 { n.eta } else { 1.0 / n.eta };
    let h = normalized([0, 1, 2].map(|c| o[c] + eta * i[c]));
    let h = if h[2] < 0.0 { h.map(|x| -x) } else { h };
    let (oh, ih) = (dot(o, h), dot(i, h));
    // Facets that one of the directions sees from behind count in pbrt-v3, and not here.
    let sees = oh * o[2] > 0.0 && ih * i[2] > 0.0;
    let aspect = (1.0 - 0.9 * n.anisotropic).sqrt();
    let rough = n.roughness * n.thin.map_or(1.0, |_| 0.65 * n.eta - 0.35);
    let alphas = [rough * rough / aspect, rough * rough * aspect].map(|a| a.max(0.001));
    let (lo, li) = (lambda(o, alphas), lambda(i, alphas));
    let masked = match n.thin {
        None => 1.0 / (1.0 + lo) / (1.0 + li),
        Some(_) => 1.0 / (1.0 + lo + li),
    };
    let root = oh + eta * ih;
    let jacobian = (ih * oh / (i[2] * o[2] * root * root)).abs();
    let facets = (1.0 - fresnel(oh, n.eta)) * distribution(h, alphas) * masked * jacobian;
    let refracted = if sees { n.clear * facets } else { 0.0 };
    n.color.map(|c| c * diffuse + c.sqrt() * refracted)
}

fn cases() -> Vec<Numbers> {
    vec![
        PLAIN,
        Numbers {
            roughness: 0.0,
            sheen: 1.0,
            ..PLAIN
        },
        Numbers {
            metallic: 1.0,
            anisotropic: 0.9,
            ..PLAIN
        },
        Numbers {
            metallic: 0.3,
            specular_tint: 0.7,
            eta: 1.8,
            sheen: 2.0,
            sheen_tint: 1.0,
            ..PLAIN
        },
        Numbers {
            clearcoat: 1.0,
            gloss: 0.0,
            ..PLAIN
        },
        Numbers {
            clearcoat: 3.0,
            gloss: 0.95,
            ..PLAIN
        },
        Numbers {
            clear: 0.8,
            roughness: 0.6,
            anisotropic: 0.5,
            ..PLAIN
        },
        Numbers {
            thin: Some([0.7, 1.4]),
            clear: 0.4,
            metallic: 0.2,
            roughness: 0.8,
            ..PLAIN
        },
        Numbers {
            thin: Some([0.0, 1.0]),
            sheen: 0.5,
            eta: 1.3,
            ..PLAIN
        },
    ]
}

#[test]
fn values_are_those_of_the_formulas() {
    let sampler = Sampler::new(Method::OwenSobol, 3);
    for numbers in cases() {
        let bsdf = lowered(scene(&numbers));
        let mut lit = [0; 2];
        for index in 0..2000 {
            let stream = sampler.stream(0, 0, index);
            let [wo, wi] = [0, 1].map(|pair| uniform_sphere(stream.pair(pair)));
            if wo.z.abs() < 0.02 || wi.z.abs() < 0.02 {
                continue;
            }
            let [o, i] = [wo, wi].map(|w| normalized(w.to_array().map(f64::from)));
            let reflects = o[2] * i[2] > 0.0;
            let found = bsdf.evaluate(wo, wi, reflects).value;
            let expected = match reflects {
                true => reflected(&numbers, o, i),
                false => transmitted(&numbers, o, i),
            };
            for (found, expected) in found.to_array().into_iter().zip(expected) {
                assert!(
                    (f64::from(found) - expected).abs() < 2e-4 * expected.abs() + 1e-5,
                    "{numbers:?} {wo} {wi}: {found} {expected}"
                );
                lit[usize::from(reflects)] += usize::from(expected > 0.0);
            }
        }
        let passes = numbers.clear > 0.0 || numbers.thin.is_some();
        assert!(lit[1] > 2000 && (lit[0] > 100) == passes, "{lit:?}");
    }
}

/// Straight on: a rough white base has its colour over pi and half of the dielectric's 4 % at the peak of the facets.
#[test]
fn closed_forms_straight_on() {
    let white = Numbers {
        color: [1.0; 3],
        roughness: 1.0,
        ..PLAIN
    };
    let found = lowered(scene(&white)).evaluate(Vec3::Z, Vec3::Z, true);
    let expected = std::f32::consts::FRAC_1_PI * (1.0 + 0.04 / 4.0);
    assert!((found.value.x - expected).abs() < 1e-5, "{found:?}");
    // A coat of full weight: 0.04 / 4 of GTR1 at its peak, over (1 + 1)².
    let coated = Numbers {
        clearcoat: 1.0,
        gloss: 0.0,
        ..white
    };
    let with = lowered(scene(&coated)).evaluate(Vec3::Z, Vec3::Z, true);
    let peak = 0.99 / (std::f32::consts::PI * 0.01 * 100.0_f32.ln());
    let coat = with.value.x - found.value.x;
    assert!((coat - 0.04 / 16.0 * peak).abs() < 1e-4, "{coat}");
}

/// A distance makes a body of the solid part, with the mean free path of the profile. Metals have none.
#[test]
fn scatter_distances_make_bodies() {
    let body = |distance: Vec3, metallic: f64| {
        let numbers = Numbers {
            color: [0.8; 3],
            metallic,
            ..PLAIN
        };
        let mut disney = scene(&numbers);
        disney.body = DisneyBody::Solid {
            scatter_distance: distance.into(),
        };
        lowered(disney)
    };
    let surface = body(Vec3::new(1.0, 2.0, 0.0), 0.25);
    let found = surface.body().expect("light walks inside");
    assert_eq!(found.kt, Vec3::splat(0.75));
    let path = mean_free_path(Vec3::splat(0.8), Vec3::new(1.0, 2.0, 0.0));
    // 0.2 (1.9 - 0.8) = 0.22.
    let expected = Vec3::new(0.22, 0.44, 0.44e-4);
    assert!((path - expected).length() < 1e-6, "{path}");
    // The diffuse part, 0.19, is replaced.
    let surface = surface.evaluate(Vec3::Z, Vec3::Z, true).value.x;
    assert!((surface - 0.111).abs() < 1e-3, "{surface}");
    assert!(body(Vec3::ONE, 1.0).body().is_none());
    assert!(body(Vec3::ZERO, 0.0).body().is_none());
}

/// Shares beyond 0..=1 count as the nearest of these.
#[test]
fn shares_are_limited() {
    let limits = Numbers {
        metallic: 1.0,
        anisotropic: 1.0,
        specular_tint: 1.0,
        ..PLAIN
    };
    let beyond = Numbers {
        metallic: 1.5,
        anisotropic: 2.0,
        specular_tint: 7.0,
        sheen: -1.0,
        clearcoat: -1.0,
        clear: -3.0,
        ..PLAIN
    };
    let [a, b] = [limits, beyond].map(|numbers| lowered(scene(&numbers)));
    let (wo, wi) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.6, 0.8));
    assert_eq!(a.evaluate(wo, wi, true), b.evaluate(wo, wi, true));
}
