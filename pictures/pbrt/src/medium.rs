//! Directives for participating media, with the parameters and defaults of pbrt-v3.

use antumbra_scene::{DensityGrid, Medium, Rgb};
use glam::{DMat4, DVec3};

use crate::lookup::{FLOAT, Lookup, NOT_NEGATIVE};
use crate::presets;
use crate::transform;

/// Supported media.
pub(crate) const SUPPORTED: &[&str] = &["heterogeneous", "homogeneous"];

/// Largest number of cells of a grid along an axis.
const MAX_CELLS: u32 = 1 << 16;

/// Reads a `MakeNamedMedium "name" "string type" "kind"`. `None`: a mistake was reported.
pub(crate) fn read(lookup: &mut Lookup, world_from_medium: &DMat4) -> Option<Medium> {
    let medium = of_type(lookup, world_from_medium);
    if medium.is_none() {
        lookup.ignore_all();
    }
    medium
}

fn of_type(lookup: &mut Lookup, world_from_medium: &DMat4) -> Option<Medium> {
    let (kind, kind_span) = lookup.needed_string("type")?;
    let found = presets::named(lookup, "preset", "preset").unwrap_or(presets::DEFAULT);
    let scale = lookup.float_in("scale", 1.0, NOT_NEGATIVE);
    let mut color = |name, default: Rgb| lookup.color(name, default) * scale;
    let absorption = color("sigma_a", found.absorption);
    let scattering = color("sigma_s", found.scattering);
    let asymmetry = lookup.float("g", 0.0);
    if !(asymmetry > -1.0 && asymmetry < 1.0) {
        return lookup.fail(format!("\"g\" must be between -1 and 1, found {asymmetry}"));
    }
    let density = match kind {
        "homogeneous" => None,
        "heterogeneous" => Some(grid(lookup, world_from_medium)?),
        kind => {
            lookup.report.unknown(kind_span, "medium", kind, SUPPORTED);
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

/// Density on a grid in the box from "p0" to "p1". `None`: a mistake was reported.
fn grid(lookup: &mut Lookup, world_from_medium: &DMat4) -> Option<DensityGrid> {
    let size = ["nx", "ny", "nz"].map(|name| lookup.integer_in(name, 1, [1, MAX_CELLS]));
    let p0 = lookup.point("p0", DVec3::ZERO);
    let p1 = lookup.point("p1", DVec3::ONE);
    let param = lookup.needed("density", FLOAT)?;
    let values = param.values.floats()?;
    let cells: u64 = size.iter().map(|&count| u64::from(count)).product();
    if values.len() as u64 != cells {
        let [x, y, z] = size;
        let message = format!(
            "{} values of \"density\" for {x} x {y} x {z} cells, which are {cells}",
            values.len()
        );
        return lookup.report.fail(param.list, message);
    }
    let is_wrong = |value: &f32| !(*value >= 0.0 && value.is_finite());
    if let Some(index) = values.iter().position(is_wrong) {
        let place = param.value_span(index, lookup.report);
        let found = values[index];
        let message = format!("a density must be finite and not negative, found {found}");
        return lookup.report.fail(place, message);
    }
    let box_from_grid = DMat4::from_translation(p0) * DMat4::from_scale(p1 - p0);
    let world_from_grid = (*world_from_medium * box_from_grid).as_mat4();
    if !transform::is_invertible(&world_from_grid.as_dmat4()) {
        let message =
            "the box of the medium is empty, or the current transformation cannot be inverted";
        return lookup.fail_help(message, "\"p0\" and \"p1\" must differ in every coordinate");
    }
    Some(DensityGrid {
        size,
        values: values.into(),
        world_from_grid,
    })
}
