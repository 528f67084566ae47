//! Materials of pbrt-v4, with its parameters and defaults.

use std::sync::Arc;

use antumbra_scene::material::{
    CoatedConductor, CoatedDiffuse, Glass, Limit, Matte, Metal, Metallic, ThinDielectric,
    Translucent,
};
use antumbra_scene::{Material, Param, Rgb, Texture};

use super::optional_roughness;
use super::subsurface::color;
use crate::named_spectra;
use crate::params::{ParamType, Values};
use crate::spectrum;
use crate::texture::Textured;

/// Wavelength in nanometres at which catalogues have the index of refraction of glasses.
const YELLOW: f64 = 587.6;

/// Materials of pbrt-v4 that version 3 has not, or under another name.
pub(crate) const SUPPORTED: &[&str] = &[
    "coatedconductor",
    "coateddiffuse",
    "conductor",
    "dielectric",
    "diffuse",
    "diffusetransmission",
    "thindielectric",
];

/// Materials of pbrt-v4 that are not supported.
#[cfg(test)]
pub(crate) const UNSUPPORTED: &[&str] = &["measured"];

/// Reads a material by its name. `None`: the name is not in [`SUPPORTED`].
pub(super) fn build(name: &str, values: &mut Textured) -> Option<Material> {
    Some(match name {
        "diffuse" => Material::Matte(Matte {
            kd: values.param("reflectance", 0.5),
            sigma: 0.0.into(),
        }),
        "diffusetransmission" => diffuse_transmission(values),
        "dielectric" => Material::Glass(Glass {
            kr: Rgb::ONE.into(),
            kt: Rgb::ONE.into(),
            eta: index(values, "eta"),
            roughness: alphas(values, ["roughness", "uroughness", "vroughness"], 0.0),
            remap_roughness: false,
        }),
        "thindielectric" => Material::ThinDielectric(ThinDielectric {
            eta: index(values, "eta"),
        }),
        "conductor" => {
            let alphas = alphas(values, ["roughness", "uroughness", "vroughness"], 0.0);
            conductor(values, alphas)
        }
        "coateddiffuse" => coated_diffuse(values),
        "coatedconductor" => coated_conductor(values),
        _ => return None,
    })
}

/// Diffuse light on both sides. Together they must not gain energy, which pbrt-v4 does not check.
fn diffuse_transmission(values: &mut Textured) -> Material {
    let scale = values.float("scale", 1.0);
    Material::Translucent(Translucent {
        kd: Rgb::splat(scale).into(),
        ks: Rgb::ZERO.into(),
        reflect: values.param("reflectance", 0.25),
        transmit: values.param("transmittance", 0.25),
        roughness: 0.0.into(),
        remap_roughness: false,
    })
}

/// Index of refraction: a number, a glass by its name, or a spectrum, which then has one index for all colours.
fn index(values: &mut Textured, name: &'static str) -> Param<f32> {
    if values.textured::<f32>(name).is_some() {
        return values.limited(name, Limit::Index).unwrap_or(1.5.into());
    }
    let Some(param) = values.lookup.find(name, &[ParamType::Spectrum]) else {
        return 1.5.into();
    };
    let found = match &param.values {
        Values::Strings(names) if names.len() == 1 => named_spectra::index(&names[0]),
        Values::Floats(values) if !values.is_empty() => {
            let pairs = values.chunks_exact(2);
            let pairs = pairs.map(|pair| [f64::from(pair[0]), f64::from(pair[1])]);
            let index = spectrum::interpolated(pairs.collect())(YELLOW);
            (index > 0.0).then_some(index)
        }
        Values::Broken => return 1.5.into(),
        _ => None,
    };
    match found {
        Some(index) => {
            let message = "glass has one index of refraction for all colours, that of 587.6 nm";
            values.report.note(param.declaration, message);
            (index as f32).into()
        }
        None => {
            let feature = "a spectrum from a file as an index of refraction is";
            values.report.unsupported(param.value, feature);
            1.5.into()
        }
    }
}

/// Microfacet alphas along u and v: square roots of the roughness, unless `remaproughness` is off.
fn alphas(values: &mut Textured, [both, u, v]: [&'static str; 3], default: f32) -> [Param<f32>; 2] {
    let remap = values.bool("remaproughness", true);
    let all = optional_roughness(values, both).unwrap_or(default.into());
    [u, v].map(|name| {
        let roughness = optional_roughness(values, name).unwrap_or_else(|| all.clone());
        if remap { root(roughness) } else { roughness }
    })
}

fn root(value: Param<f32>) -> Param<f32> {
    match value {
        Param::Constant(value) => value.max(0.0).sqrt().into(),
        texture => Param::Texture(Arc::new(Texture::Root(texture))),
    }
}

/// Spectrum of a metal. The default is copper.
fn metal(values: &mut Textured, name: &'static str, copper: &str) -> Param<Rgb> {
    let default = super::named_color(copper);
    color(values, name, default)
}

fn conductor(values: &mut Textured, roughness: [Param<f32>; 2]) -> Material {
    let reflectance = values.textured::<Rgb>("reflectance");
    if let Some((_, span)) = reflectance
        && (values.has("eta") || values.has("k"))
    {
        let message = "a conductor has \"reflectance\", or \"eta\" and \"k\", not both";
        values.report.error(span, message);
    }
    match reflectance {
        Some((Param::Texture(texture), span)) => {
            let message = "a texture of a conductor's reflectance is rendered with Schlick's Fresnel term and the \
                           roughness along u";
            values.report.note(span, message);
            let [u, _] = roughness;
            Material::Metallic(Metallic {
                color: Param::Texture(texture),
                metallic: 1.0.into(),
                roughness: root(u),
                coat: Rgb::ZERO.into(),
                transmission: 0.0.into(),
            })
        }
        Some((Param::Constant(reflectance), _)) => Material::Metal(Metal {
            eta: Rgb::ONE.into(),
            k: absorption_of(reflectance).into(),
            roughness,
            remap_roughness: false,
        }),
        None => Material::Metal(Metal {
            eta: metal(values, "eta", "metal-Cu-eta"),
            k: metal(values, "k", "metal-Cu-k"),
            roughness,
            remap_roughness: false,
        }),
    }
}

/// Absorption that, with index 1, reflects so much straight on, as in pbrt-v4.
fn absorption_of(reflectance: Rgb) -> Rgb {
    let r = reflectance.clamp(Rgb::ZERO, Rgb::splat(0.9999));
    Rgb::from(r.to_array().map(|r| 2.0 * r.sqrt() / (1.0 - r).sqrt()))
}

/// Refuses a medium between coat and base, and leaves out how pbrt-v4 walks between them.
fn layers(values: &mut Textured) {
    let albedo = values.textured::<Rgb>("albedo");
    if albedo.is_some_and(|(albedo, _)| albedo.constant() != Some(&Rgb::ZERO)) {
        values.unsupported("a medium between coat and base (\"albedo\") is");
    }
    // Without a medium, these change noise only.
    let _ = values.textured::<f32>("g");
    for steps in ["maxdepth", "nsamples"] {
        let _ = values.integer_from(steps, 1, 0);
    }
}

fn coated_diffuse(values: &mut Textured) -> Material {
    layers(values);
    let _ = values.textured::<f32>("thickness");
    let [u, v] = alphas(values, ["roughness", "uroughness", "vroughness"], 0.0);
    let roughness = match (u, v) {
        (Param::Constant(u), Param::Constant(v)) if u != v => {
            values.note("coateddiffuse has one roughness: the geometric mean of both");
            (u * v).sqrt().into()
        }
        (u, v) => {
            if u != v {
                values
                    .unsupported("coateddiffuse with a texture of roughness along u or v alone is");
            }
            u
        }
    };
    Material::CoatedDiffuse(CoatedDiffuse {
        reflectance: values.param("reflectance", 0.5),
        eta: index(values, "eta"),
        roughness,
    })
}

fn coated_conductor(values: &mut Textured) -> Material {
    layers(values);
    let _ = values.textured::<f32>("thickness");
    let _ = values.textured::<f32>("interface.thickness");
    let coat_names = [
        "interface.roughness",
        "interface.uroughness",
        "interface.vroughness",
    ];
    let names = [
        "conductor.roughness",
        "conductor.uroughness",
        "conductor.vroughness",
    ];
    let coat_roughness = alphas(values, coat_names, 0.0);
    let roughness = alphas(values, names, 0.0);
    let coat_eta = index(values, "interface.eta");
    let (eta, k) = match values.textured::<Rgb>("reflectance") {
        Some((Param::Constant(reflectance), _)) => {
            (Rgb::ONE.into(), absorption_of(reflectance).into())
        }
        Some((Param::Texture(_), span)) => {
            values
                .report
                .unsupported(span, "a texture of the reflectance of coatedconductor is");
            (Rgb::ONE.into(), Rgb::ONE.into())
        }
        None => (
            metal(values, "conductor.eta", "metal-Cu-eta"),
            metal(values, "conductor.k", "metal-Cu-k"),
        ),
    };
    Material::CoatedConductor(CoatedConductor {
        eta,
        k,
        roughness,
        coat_eta,
        coat_roughness,
    })
}
