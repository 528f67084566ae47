//! Directives for participating media, with the parameters and defaults of pbrt-v3.

use antumbra_scene::{DensityGrid, Medium, Rgb};
use glam::{DMat4, DVec3};

use crate::directive::Quoted;
use crate::lookup::Lookup;
use crate::params::{ParamType, Params, Values};
use crate::presets::{self, Coefficients};
use crate::report::Report;
use crate::source::Span;
use crate::{suggest, transform};

/// Supported media.
pub(crate) const SUPPORTED: &[&str] = &["heterogeneous", "homogeneous"];

/// Largest number of cells of a grid along an axis.
const MAX_CELLS: u32 = 1 << 16;

/// Handles `MakeNamedMedium "name" "string type" "kind"`. `None`: a mistake was reported.
pub(crate) fn declare(
    at: Span,
    name: &Quoted,
    params: &Params,
    world_from_medium: &DMat4,
    report: &mut Report,
) -> Option<Medium> {
    let mut lookup = Lookup::new(at, format!("medium {:?}", name.text), params);
    let medium = read(&mut lookup, world_from_medium, report);
    if medium.is_none() {
        lookup.ignore_all();
    }
    lookup.finish(report);
    medium
}

fn read(lookup: &mut Lookup, world_from_medium: &DMat4, report: &mut Report) -> Option<Medium> {
    let (kind, kind_span) = lookup.needed_string("type", report)?;
    let Coefficients {
        absorption,
        scattering,
    } = coefficients(lookup, "sigma_s", report);
    let asymmetry = lookup.float("g", 0.0, report);
    if !(asymmetry > -1.0 && asymmetry < 1.0) {
        let message = format!("\"g\" must be between -1 and 1, found {asymmetry}");
        report.error(lookup.at, message);
        return None;
    }
    let density = match kind {
        "homogeneous" => None,
        "heterogeneous" => Some(grid(lookup, world_from_medium, report)?),
        kind => {
            report.unknown(kind_span, "medium", kind, SUPPORTED);
            return None;
        }
    };
    Some(Medium {
        absorption,
        scattering,
        asymmetry,
        density,
    })
}

/// Absorption "sigma_a" and scattering of the given name, by "preset" where they are not given, times "scale".
pub(crate) fn coefficients(
    lookup: &mut Lookup,
    scattering: &'static str,
    report: &mut Report,
) -> Coefficients {
    let mut found = presets::DEFAULT;
    if let Some((name, span)) = lookup.string("preset", report)
        && !name.is_empty()
    {
        match presets::by_name(name) {
            Some(preset) => found = preset,
            None => report.tolerated(
                span,
                format!("no preset is named {name:?}"),
                "the coefficients of whole milk are taken",
                || suggest::help(name, &presets::names()),
            ),
        }
    }
    let scale = lookup.float_in("scale", 1.0, [0.0, f32::MAX], report);
    let mut color = |name, default: Rgb| lookup.color(name, default, report) * scale;
    Coefficients {
        absorption: color("sigma_a", found.absorption),
        scattering: color(scattering, found.scattering),
    }
}

/// Density on a grid in the box from "p0" to "p1". `None`: a mistake was reported.
fn grid(
    lookup: &mut Lookup,
    world_from_medium: &DMat4,
    report: &mut Report,
) -> Option<DensityGrid> {
    let size = ["nx", "ny", "nz"].map(|name| lookup.integer_in(name, 1, [1, MAX_CELLS], report));
    let p0 = lookup.point("p0", DVec3::ZERO, report);
    let p1 = lookup.point("p1", DVec3::ONE, report);
    let param = lookup.needed("density", &[ParamType::Float], "float", report)?;
    let Values::Floats(values) = &param.values else {
        return None;
    };
    let cells: u64 = size.iter().map(|&count| u64::from(count)).product();
    if values.len() as u64 != cells {
        let [x, y, z] = size;
        let message = format!(
            "{} values of \"density\" for {x} x {y} x {z} cells, which are {cells}",
            values.len()
        );
        report.error(param.list, message);
        return None;
    }
    if let Some(index) = values
        .iter()
        .position(|&value| !(value >= 0.0 && value.is_finite()))
    {
        let place = param.value_span(index, report);
        let message = format!(
            "a density must be finite and not negative, found {}",
            values[index]
        );
        report.error(place, message);
        return None;
    }
    let box_from_grid = DMat4::from_translation(p0) * DMat4::from_scale(p1 - p0);
    let world_from_grid = (*world_from_medium * box_from_grid).as_mat4();
    if !transform::is_invertible(&world_from_grid.as_dmat4()) {
        report.error_help(
            lookup.at,
            "the box of the medium is empty, or the current transformation cannot be inverted",
            "\"p0\" and \"p1\" must differ in every coordinate",
        );
        return None;
    }
    Some(DensityGrid {
        size,
        values: values.as_slice().into(),
        world_from_grid,
    })
}
