//! Second stage: filters decide which triangles are opaque, clear or partly transparent.

use alloc::sync::Arc;
use alloc::vec::Vec;

use super::copy::{Copied, NO_FILTER};
use super::identity::Identity;
use super::{OwnCutout, Primitives};
use crate::geometry::cutout::micromap::{Known, MicroMaps};
use crate::geometry::cutout::{Filters, MeshFilter, Representative};

/// Classifies the triangles of several lists, which have these filters. All go together, because triangles of different
/// lists may have the same pattern.
pub(super) fn classified(
    lists: Vec<Copied>,
    opacities: Vec<MeshFilter>,
) -> impl Iterator<Item = Primitives> {
    let asked: Vec<_> = lists.iter().flat_map(with_filters).collect();
    let (maps, known, mixed) = MicroMaps::new(asked.len(), |index| {
        let Representative { filter, id } = asked[index];
        (&*opacities[filter as usize].opacity, id.prim_id)
    });
    let representatives = mixed.into_iter().map(|index| asked[index]).collect();
    let filters = Arc::new(Filters {
        opacities,
        representatives,
        maps,
    });
    let mut known = known.into_iter();
    let lists = lists.into_iter();
    lists.map(move |list| separated(list, &mut known, &filters))
}

/// The triangles of a list that have a filter.
fn with_filters(list: &Copied) -> impl Iterator<Item = Representative> {
    let filters = list.filter_of.iter().zip(&list.triangle_refs);
    let asked = filters.filter(|&(&filter, _)| filter != NO_FILTER);
    asked.map(|(&filter, &id)| Representative { filter, id })
}

/// Moves the partly transparent triangles of a list behind the opaque ones and leaves out the clear ones. Takes what is
/// known of each triangle that has a filter.
fn separated(
    list: Copied,
    known: &mut impl Iterator<Item = Known>,
    filters: &Arc<Filters>,
) -> Primitives {
    let Copied {
        mut triangles,
        mut triangle_refs,
        filter_of,
        scalars,
        dropped,
        ..
    } = list;
    let (mut mixed, mut mixed_refs, mut cutouts) = (Vec::new(), Vec::new(), Vec::new());
    let mut transparent = 0;
    if !filter_of.is_empty() {
        let mut kept = 0;
        for (index, filter) in filter_of.into_iter().enumerate() {
            let (triangle, id) = (triangles[index], triangle_refs[index]);
            let known = if filter == NO_FILTER {
                Known::Opaque
            } else {
                known.next().expect("one for each")
            };
            match known {
                Known::Opaque => {
                    triangles[kept] = triangle;
                    triangle_refs[kept] = id;
                    kept += 1;
                }
                Known::Clear => transparent += 1,
                Known::Mixed(known) => {
                    mixed.push(triangle);
                    mixed_refs.push(id);
                    cutouts.push(OwnCutout { filter, known });
                }
            }
        }
        triangles.truncate(kept);
        triangle_refs.truncate(kept);
    }
    triangles.append(&mut mixed);
    triangle_refs.append(&mut mixed_refs);
    Primitives {
        triangles,
        triangle_refs,
        cutouts,
        filters: Arc::clone(filters),
        scalars,
        dropped,
        transparent,
        objects: Vec::new(),
        instances: Vec::new(),
        identity: Identity::default(),
        motion: None,
    }
}
