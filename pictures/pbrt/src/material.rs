//! Directives for materials, with the parameters and defaults of pbrt-v3.
//!
//! - `disney`: many lobes with artistic parameters
//! - `hair`: hair
//! - `read`: parameters by the list of a material's fields
//! - `subsurface`: bodies in which light is scattered
//! - `version4`: materials of pbrt-v4

mod disney;
mod hair;
mod read;
mod subsurface;
pub(crate) mod version4;

use std::sync::Arc;

use antumbra_scene::material::{Bumped, Fourier, Limit, Matte, Mix, NormalMapped};
use antumbra_scene::{Material, Param, Rgb, Texture};

use crate::directive::Quoted;
use crate::lookup::Lookup;
use crate::params::Params;
use crate::report::Report;
use crate::source::Span;
use crate::state::{MaterialSpec, State};
use crate::texture::Textured;
use crate::{named_spectra, parts, spectrum, suggest};
use read::NAMES;

/// Default material of pbrt.
pub(crate) const DEFAULT: Material = Material::Matte(Matte {
    kd: Param::Constant(Rgb::splat(0.5)),
    sigma: Param::Constant(0.0),
});

/// Supported materials besides [`Material::READ`]. An empty name means `none`.
const OTHERS: &[&str] = &["fourier", "kdsubsurface", "mix", "none", "subsurface"];

/// Parameters of supported materials besides those that [`Names`] finds.
const PARAMETERS: &[&str] = &[
    "amount",
    "bumpmap",
    "difftrans",
    "eumelanin",
    "flatness",
    "g",
    "mfp",
    "namedmaterial1",
    "namedmaterial2",
    "pheomelanin",
    "scale",
    "scatterdistance",
    "sigma_a",
    "sigma_s",
    "thin",
];

/// Names of all supported materials.
pub(crate) fn supported() -> Vec<&'static str> {
    let mut names = [Material::READ, OTHERS].concat();
    names.sort_unstable();
    names
}

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
    let overrides = (PARAMETERS.iter().chain(&*NAMES)).any(|name| lookup.has(name));
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
        "disney" => disney::disney(&mut values),
        "hair" => hair::hair(&mut values),
        "subsurface" => subsurface::coefficients(&mut values),
        "kdsubsurface" => subsurface::diffuse(&mut values),
        "fourier" => match fourier(&mut values) {
            Some(material) => material,
            None => DEFAULT,
        },
        "mix" => return mix(&mut values),
        other => match Material::read(other, &mut values) {
            Some(material) => material,
            None => match version4::build(other, &mut values) {
                Some(material) => material,
                None => unknown(other, kind.span, &mut values),
            },
        },
    };
    if let Some((height @ Param::Texture(_), _)) = values.find("bumpmap") {
        return Material::Bumped(Bumped {
            material: Arc::new(material),
            height,
        });
    }
    // A constant height does not tilt normals.
    match values.report.is_version4.then(|| values.find("normalmap")) {
        Some(Some((normal, _))) => Material::NormalMapped(NormalMapped {
            material: Arc::new(material),
            normal,
            scale: 1.0,
        }),
        _ => material,
    }
}

/// Matte in the place of an unknown material, as in pbrt-v3.
fn unknown(other: &str, at: Span, values: &mut Textured) -> Material {
    let mistake = format!("unknown material {other:?}");
    let mut known = supported();
    if values.report.is_version4 {
        known.extend(version4::SUPPORTED);
    }
    let help = || suggest::help(other, &known);
    values
        .report
        .tolerated(at, mistake, "\"matte\" is taken", help);
    let matte = Matte::read(values).into();
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
        Ok(table) => Some(Fourier { table }.into()),
        Err(problem) => {
            let message = format!("cannot read table {name:?}: {problem}");
            let help = "paths start at the folder of the main scene file";
            report.error_help(span, message, help);
            None
        }
    }
}

fn remap_roughness(values: &mut Textured) -> bool {
    values.lookup.bool("remaproughness", true, values.report)
}

fn optional_roughness(values: &mut Textured, name: &'static str) -> Option<Param<f32>> {
    values.limited(name, Limit::Rough)
}

/// Roughness along u and v, smooth by default.
fn roughness_along(values: &mut Textured) -> [Param<f32>; 2] {
    ["uroughness", "vroughness"].map(|name| optional_roughness(values, name).unwrap_or(0.0.into()))
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
    let mixture = Material::Mix(Mix {
        materials: [first, second],
        amount,
    });
    if !parts::material_fits(&mixture) {
        let most = parts::MAX_PARTS;
        let message = format!("a mixture is made of more than {most} materials");
        values.report.error_once(values.lookup.at, message, None);
        return DEFAULT;
    }
    match height {
        Some(height) => Material::Bumped(Bumped {
            material: Arc::new(mixture),
            height,
        }),
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
        Material::Bumped(Bumped { material, height }) => (material, Some(height)),
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
        Some(Material::Subsurface(_)) => {
            let feature = "a mixture with subsurface scattering is";
            values.report.unsupported(span, feature);
            None
        }
        Some(Material::Bumped(Bumped { material, .. }))
            if matches!(**material, Material::Subsurface(_)) =>
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
