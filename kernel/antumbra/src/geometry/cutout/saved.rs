//! Filters of a tree in files: names of meshes, micromaps, and the representative triangle of each pattern. The
//! functions are given again.

use super::micromap::MicroMaps;
use super::{Filters, MeshFilter, Representative};
use crate::error::Error;
use crate::geometry::PrimRef;
use crate::geometry::functions::{Functions, GeometryId};
use crate::words::{Sink, Words};

impl Filters {
    pub fn write(&self, sink: &mut Sink<'_>) {
        write_names(sink, self.opacities.iter().map(|filter| filter.mesh));
        sink.word(self.representatives.len() as u32);
        for Representative { filter, id } in &self.representatives {
            sink.words([*filter, id.geom_id, id.prim_id]);
        }
        let parts = self.maps.words();
        sink.word(parts.len() as u32);
        for [opaque, clear] in parts {
            sink.long(opaque);
            sink.long(clear);
        }
    }

    /// Filters as [`Filters::write`] wrote them, with these functions.
    pub fn read(words: &mut Words<'_>, functions: &Functions) -> Result<Self, Error> {
        let meshes = read_names(words)?;
        let opacities = functions.filters_of(&meshes)?;
        let count = words.count()?;
        let representatives = words.list([], count, |words| {
            let [filter, geom_id, prim_id] = words.words()?;
            if filter as usize >= opacities.len() {
                return Err(words.error("a filter is missing"));
            }
            let id = PrimRef { geom_id, prim_id };
            Ok(Representative { filter, id })
        })?;
        let count = words.count()?;
        let parts = words.list([], count, |words| Ok([words.long()?, words.long()?]))?;
        let named = meshes.into_iter().zip(opacities);
        let named = named.map(|(mesh, opacity)| MeshFilter {
            mesh,
            opacity: opacity.clone(),
        });
        Ok(Self {
            opacities: named.collect(),
            representatives,
            maps: MicroMaps::of_words(parts),
        })
    }
}

/// Writes names of geometries. Objects are numbered from 1, 0 is the world itself.
pub(crate) fn write_names(sink: &mut Sink<'_>, names: impl ExactSizeIterator<Item = GeometryId>) {
    sink.word(names.len() as u32);
    for GeometryId { object, geom_id } in names {
        sink.words([object.map_or(0, |object| object.wrapping_add(1)), geom_id]);
    }
}

/// Names as [`write_names`] wrote them.
pub(crate) fn read_names(words: &mut Words<'_>) -> Result<alloc::vec::Vec<GeometryId>, Error> {
    let count = words.count()?;
    words.list([], count, |words| {
        let [object, geom_id] = words.words()?;
        Ok(GeometryId {
            object: object.checked_sub(1),
            geom_id,
        })
    })
}
