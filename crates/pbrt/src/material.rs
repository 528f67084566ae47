//! Materials: parameters and defaults of pbrt-v3.

use antumbra_scene::{Material, Param, Rgb};

use crate::directive::Quoted;
use crate::lookup::Lookup;
use crate::params::{ParamType, Params};
use crate::report::Report;
use crate::source::Span;
use crate::state::State;
use crate::{suggest, texture};

/// A material as it was declared, kept so that a shape can override parameters of it.
#[derive(Clone, Debug)]
pub(crate) struct MaterialSpec {
    pub kind: Quoted,
    pub params: Params,
    pub material: Material,
}

/// pbrt's material where a scene names none.
pub(crate) const DEFAULT: Material = Material::Matte {
    kd: Param::Constant(Rgb::splat(0.5)),
    sigma: Param::Constant(0.0),
};

/// Every parameter of the materials that are there: what a shape may override.
const OVERRIDABLE: &[&str] = &[
    "Kd",
    "Kr",
    "Ks",
    "Kt",
    "bumpmap",
    "eta",
    "index",
    "remaproughness",
    "roughness",
    "sigma",
    "uroughness",
    "vroughness",
];

const SUPPORTED: &[&str] = &["glass", "matte", "mirror", "plastic"];

const UNSUPPORTED: &[&str] = &[
    "disney",
    "fourier",
    "hair",
    "kdsubsurface",
    "metal",
    "mix",
    "none",
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

/// The material of a shape: the current one, with what the shape's own parameters change of it.
pub(crate) fn of_shape<'a>(
    current: Option<&'a MaterialSpec>,
    lookup: &mut Lookup<'a>,
    state: &State,
    report: &mut Report,
) -> Material {
    let overrides = OVERRIDABLE.iter().any(|name| lookup.has(name));
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

/// Reads the parameters of a kind of material. Mistakes are reported and stand for the default.
fn build(kind: &Quoted, lookup: &mut Lookup, state: &State, report: &mut Report) -> Material {
    let colors = &state.color_textures;
    let floats = &state.float_textures;
    let color = |lookup: &mut Lookup, name, default, report: &mut Report| {
        texture::color(lookup, name, Rgb::splat(default), colors, report)
    };
    let float = |lookup: &mut Lookup, name, report: &mut Report| {
        texture::float(lookup, name, floats, report)
    };
    let at_least_0 =
        |found: Option<(f32, Span)>, name: &str, default, report: &mut Report| match found {
            Some((value, span)) if value < 0.0 => {
                report.error(
                    span,
                    format!("{name:?} must not be negative, found {value}"),
                );
                default
            }
            Some((value, _)) => value,
            None => default,
        };
    let roughness = |lookup: &mut Lookup, name, default, report: &mut Report| {
        let found = float(lookup, name, report);
        at_least_0(found, name, default, report)
    };
    let material = match kind.text.as_str() {
        "matte" => Material::Matte {
            kd: color(lookup, "Kd", 0.5, report).into(),
            sigma: match float(lookup, "sigma", report) {
                Some((value, _)) if (0.0..=90.0).contains(&value) => value,
                Some((value, span)) => {
                    let clamped = value.clamp(0.0, 90.0);
                    report.note(
                        span,
                        format!("sigma {value} is taken as {clamped}, as pbrt does"),
                    );
                    clamped
                }
                None => 0.0,
            }
            .into(),
        },
        "plastic" => Material::Plastic {
            kd: color(lookup, "Kd", 0.25, report).into(),
            ks: color(lookup, "Ks", 0.25, report).into(),
            roughness: roughness(lookup, "roughness", 0.1, report).into(),
            remap_roughness: lookup.bool("remaproughness", true, report),
        },
        "mirror" => Material::Mirror {
            kr: color(lookup, "Kr", 0.9, report).into(),
        },
        "glass" => {
            let kr = color(lookup, "Kr", 1.0, report).into();
            let kt = color(lookup, "Kt", 1.0, report).into();
            // "eta" comes first where both names are given, as in pbrt.
            let index = float(lookup, "index", report);
            let eta = float(lookup, "eta", report).or(index);
            if let Some((value, span)) = eta.filter(|(value, _)| *value <= 0.0) {
                report.error(
                    span,
                    format!("the index of refraction must be positive, found {value}"),
                );
            }
            Material::Glass {
                kr,
                kt,
                eta: eta.map_or(1.5, |(value, _)| value).into(),
                roughness: [
                    roughness(lookup, "uroughness", 0.0, report).into(),
                    roughness(lookup, "vroughness", 0.0, report).into(),
                ],
                remap_roughness: lookup.bool("remaproughness", true, report),
            }
        }
        other => {
            report_unknown(other, kind.span, report);
            lookup.ignore_all();
            return DEFAULT;
        }
    };
    lookup.unsupported("bumpmap", &[ParamType::Texture, ParamType::Float], report);
    material
}

fn report_unknown(name: &str, span: Span, report: &mut Report) {
    if name.is_empty() || UNSUPPORTED.contains(&name) {
        report.unsupported(span, format!("material {name:?} is"));
        return;
    }
    report.error_help(
        span,
        format!("unknown material {name:?}"),
        suggest::help(name, SUPPORTED),
    );
}
