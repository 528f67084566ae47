//! Textures: constant ones are values, the others are known by name until something uses them.

use antumbra_scene::Rgb;

use crate::directive::Quoted;
use crate::lookup::{COLOR, Lookup, one_float, one_string};
use crate::params::{Param, ParamType, Params};
use crate::report::Report;
use crate::source::Span;
use crate::state::{Scoped, State};
use crate::{spectrum, suggest};

/// A texture that was defined.
#[derive(Clone, Debug)]
pub(crate) enum Texture {
    Float(f32),
    Color(Rgb),
    /// Of a class that pbrt-v3 has; using it is an error.
    Unsupported(String),
}

const CLASSES: &[&str] = &[
    "bilerp",
    "checkerboard",
    "constant",
    "dots",
    "fbm",
    "imagemap",
    "marble",
    "mix",
    "ptex",
    "scale",
    "uv",
    "windy",
    "wrinkled",
];

/// Handles `Texture "name" "type" "class"`.
pub(crate) fn define(
    state: &mut State,
    at: Span,
    name: Quoted,
    value_type: &Quoted,
    class: &Quoted,
    params: &Params,
    report: &mut Report,
) {
    if !CLASSES.contains(&class.text.as_str()) {
        report.error_help(
            class.span,
            format!("unknown texture class {:?}", class.text),
            suggest::help(&class.text, CLASSES),
        );
    }
    let mut lookup = Lookup::new(at, format!("texture {:?}", class.text), params);
    let is_constant = class.text == "constant";
    let unsupported = Texture::Unsupported(class.text.clone());
    match value_type.text.as_str() {
        "float" => {
            let texture = if is_constant {
                Texture::Float(lookup.float("value", 1.0, report))
            } else {
                unsupported
            };
            state.float_textures.define(name.text, texture);
        }
        "color" | "spectrum" => {
            let texture = if is_constant {
                Texture::Color(lookup.color("value", Rgb::ONE, report))
            } else {
                unsupported
            };
            state.color_textures.define(name.text, texture);
        }
        unknown => report.error_help(
            value_type.span,
            format!("unknown texture type {unknown:?}"),
            "known: float, color, spectrum",
        ),
    }
    if !is_constant {
        lookup.ignore_all();
    }
    lookup.finish(report);
}

/// A colour parameter that may be the name of a texture.
pub(crate) fn color(
    lookup: &mut Lookup,
    name: &'static str,
    default: Rgb,
    textures: &Scoped<Texture>,
    report: &mut Report,
) -> Rgb {
    const TYPES: &[ParamType] = &[
        ParamType::Rgb,
        ParamType::Xyz,
        ParamType::Spectrum,
        ParamType::Blackbody,
        ParamType::Texture,
    ];
    debug_assert_eq!(TYPES[..4], *COLOR);
    let value = match lookup.find(name, TYPES) {
        Some(param) if param.param_type == ParamType::Texture => {
            match resolve(param, textures, "color", report) {
                Some(Texture::Color(value)) => Some(*value),
                _ => None,
            }
        }
        Some(param) => spectrum::read(param, report),
        None => None,
    };
    value.unwrap_or(default)
}

/// A number that may be the name of a texture, with the place of its value.
pub(crate) fn float(
    lookup: &mut Lookup,
    name: &'static str,
    textures: &Scoped<Texture>,
    report: &mut Report,
) -> Option<(f32, Span)> {
    let param = lookup.find(name, &[ParamType::Float, ParamType::Texture])?;
    let value = if param.param_type == ParamType::Texture {
        match resolve(param, textures, "float", report)? {
            Texture::Float(value) => *value,
            _ => return None,
        }
    } else {
        one_float(param, report)?
    };
    Some((value, param.value))
}

/// Finds the texture a parameter names; one that is unknown or unsupported is reported.
fn resolve<'t>(
    param: &Param,
    textures: &'t Scoped<Texture>,
    value_type: &str,
    report: &mut Report,
) -> Option<&'t Texture> {
    let name = one_string(param, report)?;
    match textures.get(name) {
        Some(Texture::Unsupported(class)) => {
            report.unsupported(param.value, format!("textures of class {class:?} are"));
            None
        }
        None => {
            report.error_help(
                param.value,
                format!("no {value_type} texture is named {name:?} here"),
                suggest::help(name, &textures.names()),
            );
            None
        }
        found => found,
    }
}
