//! Height fields: a mesh over the unit square.

use antumbra_scene::TriangleMesh;
use glam::DVec3;

use crate::lookup::{FLOAT, INTEGER, Lookup};
use crate::shape::grid;

/// Most heights along a side, so that vertices can be numbered by 32 bits.
const MAX_SIDE: u32 = 1 << 16;

/// Reads a `heightfield`. Its mesh has no normals, as in pbrt-v3. `None`: a mistake was reported.
pub(super) fn heightfield(lookup: &mut Lookup) -> Option<TriangleMesh> {
    let errors_before = lookup.report.error_count();
    let [nu, nv] = ["nu", "nv"].map(|name| {
        lookup.needed(name, INTEGER);
        lookup.integer_in(name, 2, [2, MAX_SIDE])
    });
    let heights = lookup.needed("Pz", FLOAT)?;
    let values = heights.values.floats()?;
    lookup.report.clean_since(errors_before)?;
    let wanted = u64::from(nu) * u64::from(nv);
    if values.len() as u64 != wanted {
        let found = values.len();
        let message = format!("\"Pz\" has {found} values, but nu x nv is {nu} x {nv} = {wanted}");
        return lookup.report.fail(heights.list, message);
    }
    if let Some(index) = values.iter().position(|z| !z.is_finite()) {
        let span = heights.value_span(index, lookup.report);
        let message = format!("\"Pz\" must be finite, found {}", values[index]);
        return lookup.report.fail(span, message);
    }
    let mut mesh = grid::mesh([nu - 1, nv - 1], |u, v| (DVec3::new(u, v, 0.0), DVec3::Z));
    mesh.normals.clear();
    for (position, z) in mesh.positions.iter_mut().zip(values) {
        position[2] = *z;
    }
    Some(mesh)
}
