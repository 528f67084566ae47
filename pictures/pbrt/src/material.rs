//! Directives for materials, with the parameters and defaults of pbrt-v3.
//!
//! - `disney`: many lobes with artistic parameters
//! - `hair`: hair
//! - `subsurface`: bodies in which light is scattered
//! - `version4`: materials of pbrt-v4

mod disney;
mod hair;
mod subsurface;
pub(crate) mod version4;

use std::sync::Arc;

use antumbra_scene::{Material, Param, Rgb, Texture};

use crate::directive::Quoted;
use crate::lookup::Lookup;
use crate::params::Params;
use crate::report::Report;
use crate::source::Span;
use crate::state::{MaterialSpec, State};
use crate::texture::Textured;
use crate::{named_spectra, parts, spectrum, suggest};

/// Default material of pbrt.
pub(crate) const DEFAULT: Material = Material::Matte {
    kd: Param::Constant(Rgb::splat(0.5)),
    sigma: Param::Constant(0.0),
};

/// Copper, the default metal: index of refraction from the tables of pbrt-v3 as linear RGB.
const COPPER_ETA: [f32; 3] = [0.200438, 0.924033, 1.102212];
const COPPER_K: [f32; 3] = [3.912949, 2.452848, 2.142188];

/// Parameters of all supported materials, which a shape may override.
const OVERRIDABLE: &[&str] = &[
    "Kd",
    "Kr",
    "Ks",
    "Kt",
    "amount",
    "bumpmap",
    "eta",
    "g",
    "index",
    "k",
    "mfp",
    "namedmaterial1",
    "namedmaterial2",
    "opacity",
    "reflect",
    "remaproughness",
    "roughness",
    "scale",
    "sigma",
    "sigma_a",
    "sigma_s",
    "transmit",
    "uroughness",
    "vroughness",
];

/// Supported materials. An empty name means `none`.
pub(crate) const SUPPORTED: &[&str] = &[
    "disney",
    "fourier",
    "glass",
    "hair",
    "kdsubsurface",
    "matte",
    "metal",
    "mirror",
    "mix",
    "none",
    "plastic",
    "substrate",
    "subsurface",
    "translucent",
    "uber",
];

/// Handles `Material "kind"`.
pub(crate) fn declare(
    at: Span,
    kind: Quoted,
    params: Params,
    state: &State,
    report: &mut Report,
) -> MaterialSpec {
    let mut lookup = Lookup::new(at, format!("material {:?}", kind.text), &params);
    let material = build(&kind, &mut lookup, state, report);
    lookup.finish(report);
    MaterialSpec {
        kind,
        params,
        material,
    }
}

/// Handles `MakeNamedMaterial "name" "string type" "kind"`.
pub(crate) fn declare_named(
    at: Span,
    name: &Quoted,
    params: Params,
    state: &State,
    report: &mut Report,
) -> MaterialSpec {
    let mut lookup = Lookup::new(at, format!("named material {:?}", name.text), &params);
    let kind = match lookup.string("type", report) {
        Some((text, span)) => Quoted {
            text: text.to_owned(),
            span,
        },
        None => {
            if !lookup.has("type") {
                report.error_help(
                    name.span,
                    format!("named material {:?} has no type", name.text),
                    "add \"string type\" \"matte\" or another material",
                );
            }
            lookup.ignore_all();
            Quoted {
                text: "matte".into(),
                span: name.span,
            }
        }
    };
    let material = build(&kind, &mut lookup, state, report);
    lookup.finish(report);
    MaterialSpec {
        kind,
        params,
        material,
    }
}

/// Material of a shape: the current one, with overrides from the shape's own parameters.
pub(crate) fn of_shape<'a>(
    current: Option<&'a MaterialSpec>,
    lookup: &mut Lookup<'a>,
    state: &State,
    report: &mut Report,
) -> Material {
    let names = OVERRIDABLE.iter().chain(disney::PARAMETERS);
    let overrides = (names.chain(hair::PARAMETERS)).any(|name| lookup.has(name));
    match current {
        Some(spec) if !overrides => spec.material.clone(),
        None if !overrides => DEFAULT,
        Some(spec) => {
            lookup.fall_back_on(&spec.params);
            build(&spec.kind, lookup, state, report)
        }
        None => {
            let kind = Quoted {
                text: "matte".into(),
                span: lookup.at,
            };
            build(&kind, lookup, state, report)
        }
    }
}

/// Reads the parameters of a material. Mistakes are reported and replaced by defaults.
fn build(kind: &Quoted, lookup: &mut Lookup, state: &State, report: &mut Report) -> Material {
    let mut values = Textured {
        lookup,
        state,
        report,
    };
    let material = match kind.text.as_str() {
        "" | "none" => return Material::None,
        "matte" => Material::Matte {
            kd: values.param("Kd", 0.5),
            sigma: sigma(&mut values),
        },
        "plastic" => Material::Plastic {
            kd: values.param("Kd", 0.25),
            ks: values.param("Ks", 0.25),
            roughness: roughness(&mut values, "roughness", 0.1),
            remap_roughness: remap_roughness(&mut values),
        },
        "mirror" => Material::Mirror {
            kr: values.param("Kr", 0.9),
        },
        "glass" => Material::Glass {
            kr: values.param("Kr", 1.0),
            kt: values.param("Kt", 1.0),
            eta: index_of_refraction(&mut values),
            roughness: roughness_along(&mut values, 0.0),
            remap_roughness: remap_roughness(&mut values),
        },
        "metal" => Material::Metal {
            eta: color(&mut values, "eta", COPPER_ETA),
            k: color(&mut values, "k", COPPER_K),
            roughness: roughness_of_all(&mut values, 0.01),
            remap_roughness: remap_roughness(&mut values),
        },
        "uber" => Material::Uber {
            kd: values.param("Kd", 0.25),
            ks: values.param("Ks", 0.25),
            kr: values.param("Kr", 0.0),
            kt: values.param("Kt", 0.0),
            roughness: uber_roughness(&mut values),
            opacity: values.param("opacity", 1.0),
            eta: index_of_refraction(&mut values),
            remap_roughness: remap_roughness(&mut values),
        },
        "substrate" => Material::Substrate {
            kd: values.param("Kd", 0.5),
            ks: values.param("Ks", 0.5),
            roughness: roughness_along(&mut values, 0.1),
            remap_roughness: remap_roughness(&mut values),
        },
        "translucent" => Material::Translucent {
            kd: values.param("Kd", 0.25),
            ks: values.param("Ks", 0.25),
            reflect: values.param("reflect", 0.5),
            transmit: values.param("transmit", 0.5),
            roughness: roughness(&mut values, "roughness", 0.1),
            remap_roughness: remap_roughness(&mut values),
        },
        "disney" => disney::disney(&mut values),
        "hair" => hair::hair(&mut values),
        "subsurface" => subsurface::coefficients(&mut values),
        "kdsubsurface" => subsurface::diffuse(&mut values),
        "fourier" => match fourier(&mut values) {
            Some(material) => material,
            None => DEFAULT,
        },
        "mix" => return mix(&mut values),
        other => match version4::build(other, &mut values) {
            Some(material) => material,
            None => unknown(other, kind.span, &mut values),
        },
    };
    if let Some((height @ Param::Texture(_), _)) = values.find("bumpmap") {
        return Material::Bumped {
            material: Arc::new(material),
            height,
        };
    }
    // A constant height does not tilt normals.
    match values.report.is_version4.then(|| values.find("normalmap")) {
        Some(Some((normal, _))) => Material::NormalMapped {
            material: Arc::new(material),
            normal,
            scale: 1.0,
        },
        _ => material,
    }
}

/// Matte in the place of an unknown material, as in pbrt-v3.
fn unknown(other: &str, at: Span, values: &mut Textured) -> Material {
    let mistake = format!("unknown material {other:?}");
    let known = match values.report.is_version4 {
        true => [SUPPORTED, version4::SUPPORTED].concat(),
        false => SUPPORTED.to_vec(),
    };
    let help = || suggest::help(other, &known);
    values
        .report
        .tolerated(at, mistake, "\"matte\" is taken", help);
    let matte = Material::Matte {
        kd: values.param("Kd", 0.5),
        sigma: sigma(values),
    };
    values.lookup.ignore_all();
    matte
}

/// Colour of a named spectrum of a surface. Black if there is none of that name.
fn named_color(name: &str) -> Rgb {
    match named_spectra::find(name) {
        Some(named_spectra::Named::Samples(samples)) => spectrum::of_surface(samples).as_vec3(),
        _ => Rgb::ZERO,
    }
}

fn color(values: &mut Textured, name: &'static str, default: [f32; 3]) -> Param<Rgb> {
    values
        .find(name)
        .map_or(Param::Constant(default.into()), |(value, _)| value)
}

fn sigma(values: &mut Textured) -> Param<f32> {
    match values.find::<f32>("sigma") {
        Some((Param::Constant(value), span)) if !(0.0..=90.0).contains(&value) => {
            let clamped = value.clamp(0.0, 90.0);
            let message = format!("sigma {value} is taken as {clamped}, as pbrt does");
            values.report.note(span, message);
            clamped.into()
        }
        Some((sigma, _)) => sigma,
        None => 0.0.into(),
    }
}

/// Reads the table that a `fourier` names. `None`: a mistake was reported.
fn fourier(values: &mut Textured) -> Option<Material> {
    let Textured { lookup, report, .. } = values;
    let Some((name, span)) = lookup.string("bsdffile", report) else {
        lookup.report_missing("bsdffile", "string", report);
        return None;
    };
    let Report {
        tables, sources, ..
    } = &mut **report;
    match tables.read(name, sources) {
        Ok(table) => Some(Material::Fourier(table)),
        Err(problem) => {
            let message = format!("cannot read table {name:?}: {problem}");
            let help = "paths start at the folder of the main scene file";
            report.error_help(span, message, help);
            None
        }
    }
}

/// Index of refraction: "eta", or "index" if "eta" is not given, as in pbrt.
fn index_of_refraction(values: &mut Textured) -> Param<f32> {
    let index = values.find::<f32>("index");
    let eta = values.find("eta").or(index);
    positive_index(values, eta, 1.5)
}

/// An index of refraction that was found, which is positive as far as it is constant.
fn positive_index(
    values: &mut Textured,
    found: Option<(Param<f32>, Span)>,
    default: f32,
) -> Param<f32> {
    match found {
        Some((Param::Constant(value), span)) if !(value > 0.0) => {
            let message = format!("the index of refraction must be positive, found {value}");
            values.report.error(span, message);
            default.into()
        }
        Some((eta, _)) => eta,
        None => default.into(),
    }
}

/// Number in 0..=1, or the nearest of these, with a note.
fn share(values: &mut Textured, name: &'static str, default: f32) -> Param<f32> {
    limited(values, name, default, 1.0)
}

/// Number in 0..=`most`, or the nearest of these, with a note.
fn limited(values: &mut Textured, name: &'static str, default: f32, most: f32) -> Param<f32> {
    match values.find::<f32>(name) {
        Some((Param::Constant(value), span)) if !(0.0..=most).contains(&value) => {
            let nearest = value.clamp(0.0, most);
            let message = format!("{name:?} is taken as {nearest}, found {value}");
            values.report.note(span, message);
            nearest.into()
        }
        Some((value, _)) => value,
        None => default.into(),
    }
}

fn remap_roughness(values: &mut Textured) -> bool {
    values.lookup.bool("remaproughness", true, values.report)
}

fn roughness(values: &mut Textured, name: &'static str, default: f32) -> Param<f32> {
    optional_roughness(values, name).unwrap_or(default.into())
}

fn optional_roughness(values: &mut Textured, name: &'static str) -> Option<Param<f32>> {
    let (value, span) = values.find(name)?;
    if let Param::Constant(number) = value
        && number < 0.0
    {
        let message = format!("{name:?} must not be negative, found {number}");
        values.report.error(span, message);
        return None;
    }
    Some(value)
}

/// Roughness along u and v, with equal defaults.
fn roughness_along(values: &mut Textured, default: f32) -> [Param<f32>; 2] {
    ["uroughness", "vroughness"].map(|name| roughness(values, name, default))
}

/// Roughness along u and v, each of which defaults to "roughness".
fn roughness_of_all(values: &mut Textured, default: f32) -> [Param<f32>; 2] {
    let all = roughness(values, "roughness", default);
    ["uroughness", "vroughness"]
        .map(|name| optional_roughness(values, name).unwrap_or_else(|| all.clone()))
}

/// Roughness of `uber` along u, which defaults to "roughness", and along v, which defaults to the one along u.
///
/// pbrt-v3 has different defaults for other materials.
fn uber_roughness(values: &mut Textured) -> [Param<f32>; 2] {
    let all = roughness(values, "roughness", 0.1);
    let u = optional_roughness(values, "uroughness").unwrap_or(all);
    let v = optional_roughness(values, "vroughness").unwrap_or_else(|| u.clone());
    [u, v]
}

/// Mixture of two named materials. The bump map of the first tilts both, as in pbrt-v3.
///
/// Mixtures of pbrt-v3 add the lobes of the second material to the tilted surface of the first.
fn mix(values: &mut Textured) -> Material {
    let amount = amount(values);
    let [first, second] =
        ["namedmaterial1", "namedmaterial2"].map(|name| mixed_material(values, name));
    let (Some(first), Some(second)) = (first, second) else {
        return DEFAULT;
    };
    let (first, height) = unbumped(first);
    let (second, _) = unbumped(second);
    let mixture = Material::Mix {
        materials: [first, second],
        amount,
    };
    if !parts::material_fits(&mixture) {
        let most = parts::MAX_PARTS;
        let message = format!("a mixture is made of more than {most} materials");
        values.report.error_once(values.lookup.at, message, None);
        return DEFAULT;
    }
    match height {
        Some(height) => Material::Bumped {
            material: Arc::new(mixture),
            height,
        },
        None => mixture,
    }
}

/// Scale of the first material: a colour, or a number in pbrt-v4.
fn amount(values: &mut Textured) -> Param<Rgb> {
    if !values.report.is_version4 {
        return values.param("amount", 0.5);
    }
    match values.param::<f32>("amount", 0.5) {
        Param::Constant(amount) => Rgb::splat(amount).into(),
        amount => Param::Texture(Arc::new(Texture::Mix {
            ends: [Rgb::ZERO.into(), Rgb::ONE.into()],
            amount,
        })),
    }
}

/// Splits a material into the material without its bump map, and the bump map.
fn unbumped(material: Material) -> (Arc<Material>, Option<Param<f32>>) {
    match material {
        Material::Bumped { material, height } => (material, Some(height)),
        material => (Arc::new(material), None),
    }
}

fn mixed_material(values: &mut Textured, param: &'static str) -> Option<Material> {
    let Some((name, span)) = values.lookup.string(param, values.report) else {
        let at = values.lookup.at;
        let message = format!("{} needs a parameter {param:?}", values.lookup.what());
        let help = format!("add \"string {param}\" with the name of a material");
        values.report.error_help(at, message, help);
        return None;
    };
    let named = &values.state.named_materials;
    match named.get(name).map(|spec| &spec.material) {
        Some(Material::Subsurface { .. }) => {
            let feature = "a mixture with subsurface scattering is";
            values.report.unsupported(span, feature);
            None
        }
        Some(Material::Bumped { material, .. })
            if matches!(**material, Material::Subsurface { .. }) =>
        {
            let feature = "a mixture with subsurface scattering is";
            values.report.unsupported(span, feature);
            None
        }
        Some(Material::None) => {
            let message = "a mixture with material \"none\" is no surface; pbrt-v3 fails here";
            values.report.error(span, message);
            None
        }
        Some(material) => Some(material.clone()),
        None => {
            let mistake = format!("no material is named {name:?} here");
            let help = || suggest::help(name, &named.names());
            let report = &mut values.report;
            report.tolerated(span, mistake, "\"matte\" is taken", help);
            Some(DEFAULT)
        }
    }
}
