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
    let mut values = Textured {
        lookup: Lookup::new("material", at, &kind, &params, report),
        state,
    };
    let material = build(&kind, &mut values);
    values.lookup.finish();
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
    let mut values = Textured {
        lookup: Lookup::new("named material", at, name, &params, report),
        state,
    };
    let kind = match values.string("type") {
        Some((text, span)) => Quoted {
            text: text.to_owned(),
            span,
        },
        None => {
            if !values.has("type") {
                let message = format!("{} has no type", values.what());
                let help = "add \"string type\" \"matte\" or another material";
                values.report.error_help(name.span, message, help);
            }
            values.ignore_all();
            matte(name.span)
        }
    };
    let material = build(&kind, &mut values);
    values.lookup.finish();
    MaterialSpec {
        kind,
        params,
        material,
    }
}

/// Kind of the default material, where a file names none.
fn matte(span: Span) -> Quoted {
    Quoted {
        text: "matte".into(),
        span,
    }
}

/// Material of a shape: the current one, with overrides from the shape's own parameters.
pub(crate) fn of_shape<'a>(
    current: Option<&'a MaterialSpec>,
    values: &mut Textured<'a>,
) -> Material {
    let overrides = (PARAMETERS.iter().chain(&*NAMES)).any(|name| values.has(name));
    match current {
        Some(spec) if !overrides => spec.material.clone(),
        None if !overrides => DEFAULT,
        Some(spec) => {
            values.fall_back_on(&spec.params);
            build(&spec.kind, values)
        }
        None => build(&matte(values.at), values),
    }
}

/// Reads the parameters of a material. Mistakes are reported and replaced by defaults.
fn build(kind: &Quoted, values: &mut Textured) -> Material {
    let material = match kind.text.as_str() {
        "" | "none" => return Material::None,
        "disney" => disney::disney(values),
        "hair" => hair::hair(values),
        "subsurface" => subsurface::coefficients(values),
        "kdsubsurface" => subsurface::diffuse(values),
        "fourier" => fourier(values).unwrap_or(DEFAULT),
        "mix" => return mix(values),
        other => Material::read(other, values)
            .or_else(|| version4::build(other, values))
            .unwrap_or_else(|| unknown(other, kind.span, values)),
    };
    if let Some((height @ Param::Texture(_), _)) = values.textured("bumpmap") {
        return Material::Bumped(Bumped {
            material: Arc::new(material),
            height,
        });
    }
    // A constant height does not tilt normals.
    if values.is_version4()
        && let Some((normal, _)) = values.textured("normalmap")
    {
        return Material::NormalMapped(NormalMapped {
            material: Arc::new(material),
            normal,
            scale: 1.0,
        });
    }
    material
}

/// Matte in the place of an unknown material, as in pbrt-v3.
fn unknown(other: &str, at: Span, values: &mut Textured) -> Material {
    let mistake = format!("unknown material {other:?}");
    let mut known = supported();
    if values.is_version4() {
        known.extend(version4::SUPPORTED);
    }
    let help = || suggest::help(other, &known);
    (values.report).tolerated(at, mistake, "\"matte\" is taken", help);
    let matte = Matte::read(values).into();
    values.ignore_all();
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
fn fourier(lookup: &mut Lookup) -> Option<Material> {
    let (name, span) = lookup.needed_string("bsdffile")?;
    let Report {
        tables, sources, ..
    } = &mut *lookup.report;
    match tables.read(name, sources) {
        Ok(table) => Some(Fourier { table }.into()),
        Err(problem) => {
            let message = format!("cannot read table {name:?}: {problem}");
            let help = "paths start at the folder of the main scene file";
            lookup.report.fail_help(span, message, help)
        }
    }
}

fn remap_roughness(lookup: &mut Lookup) -> bool {
    lookup.bool("remaproughness", true)
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
        let at = values.at;
        values.report.error_once(at, message, None);
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
    if !values.is_version4() {
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
    let Some((name, span)) = values.string(param) else {
        let message = format!("{} needs a parameter {param:?}", values.what());
        let help = format!("add \"string {param}\" with the name of a material");
        return values.fail_help(message, &help);
    };
    let named = &values.state.named_materials;
    match named.get(name).map(|spec| &spec.material) {
        Some(material) if is_subsurface(material) => {
            (values.report).unsupported(span, "a mixture with subsurface scattering is");
            None
        }
        Some(Material::None) => {
            let message = "a mixture with material \"none\" is no surface; pbrt-v3 fails here";
            values.report.fail(span, message)
        }
        Some(material) => Some(material.clone()),
        None => {
            let mistake = format!("no material is named {name:?} here");
            let help = || suggest::help(name, &named.names());
            (values.report).tolerated(span, mistake, "\"matte\" is taken", help);
            Some(DEFAULT)
        }
    }
}

/// Whether a material scatters light below its surface, with or without a bump map.
fn is_subsurface(material: &Material) -> bool {
    match material {
        Material::Subsurface(_) => true,
        Material::Bumped(Bumped { material, .. }) => matches!(**material, Material::Subsurface(_)),
        _ => false,
    }
}
