//! Geometry whose vertices moved, for a tree that keeps its shape.
//!
//! A refit must answer like a tree built from scratch. So the same primitives must be sound before and after, which is
//! checked before anything is changed.

use crate::error::Error;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::kinds::ScalarLists;
use crate::geometry::quad::{half, kept_halves, quad_of};
use crate::geometry::scalar::ScalarPrim;
use crate::geometry::sound::{check_indices, corners, is_sound};
use crate::geometry::{Geometry, PrimRef};
use crate::parallel::{chunk_len, map};

/// Geometries with other vertices than a tree was built over.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moved<'a> {
    geometries: &'a [Geometry<'a>],
    all_sound: bool,
}

impl<'a> Moved<'a> {
    /// Checks geometries that are to have `kept` sound primitives.
    ///
    /// # Errors
    /// A vertex index out of range; another number of sound primitives; geometry that moves while rays are traced.
    pub fn new(geometries: &'a [Geometry<'a>], kept: usize) -> Result<Self, Error> {
        let (mut sound, mut all) = (0, 0);
        for geometry in geometries {
            geometry.stands_still("a refit cannot make geometry move while rays are traced")?;
            sound += count_sound(geometry);
            all += geometry.count();
        }
        if sound != all {
            check_indices(geometries)?;
        }
        if sound != kept {
            return Err(Error::OtherPrimitives {
                expected: kept,
                found: sound,
            });
        }
        Ok(Self {
            geometries,
            all_sound: sound == all,
        })
    }

    /// The corners of a triangle; `None` unless it is there and sound.
    #[inline(always)]
    pub fn triangle(&self, id: PrimRef) -> Option<[[f32; 3]; 3]> {
        let geometry = self.geometries.get(id.geom_id as usize)?;
        // Vertices are behind closures: where all is sound, whoever only wants to know what is there reads none.
        match (geometry, quad_of(id.prim_id)) {
            (Geometry::Triangles(mesh), None) => {
                let indices = mesh.indices.get(id.prim_id as usize)?;
                let corners = || corners(&mesh.positions, indices);
                (self.all_sound || is_sound(&corners())).then(corners)
            }
            (Geometry::Quads(mesh), Some((quad, which))) => {
                let indices = mesh.indices.get(quad as usize)?;
                let corners = || corners(&mesh.positions, indices);
                let is_kept = || kept_halves(&corners()).is_ok_and(|kept| kept[which]);
                (self.all_sound || is_kept()).then(|| half(corners(), which))
            }
            _ => None,
        }
    }

    /// A primitive that is no triangle; `None` unless it is there and sound.
    pub fn scalar<P: ScalarPrim>(&self, id: PrimRef) -> Option<P> {
        let geometry = self.geometries.get(id.geom_id as usize)?;
        P::of(geometry, id.prim_id)?.ok()
    }

    /// Fails unless all primitives of these blocks are there and sound.
    ///
    /// # Errors
    /// The first primitive that is not.
    pub fn check<B: LeafBlock>(&self, blocks: &[B]) -> Result<(), Error> {
        let chunk = chunk_len(blocks.len());
        let chunks = map(blocks.len().div_ceil(chunk), 1, |index| {
            let blocks = &blocks[index * chunk..blocks.len().min((index + 1) * chunk)];
            let ids = blocks
                .iter()
                .flat_map(|block| (0..block.count()).map(|lane| block.id(lane)));
            ids.into_iter().find(|id| !B::is_there(self, *id))
        });
        match chunks.into_iter().flatten().next() {
            Some(id) => {
                let PrimRef { geom_id, prim_id } = id.told();
                Err(Error::PrimitiveIsGone { geom_id, prim_id })
            }
            None => Ok(()),
        }
    }
}

/// How many primitives of a geometry are sound.
fn count_sound(geometry: &Geometry<'_>) -> usize {
    match geometry {
        Geometry::Triangles(mesh) => sum(mesh.indices.len(), |index| {
            let [a, b, c] = mesh.indices[index].map(|index| mesh.positions.get(index as usize));
            let corners = a.zip(b).zip(c);
            usize::from(corners.is_some_and(|((a, b), c)| is_sound(&[*a, *b, *c])))
        }),
        Geometry::Quads(mesh) => sum(mesh.indices.len(), |index| {
            let corners = corners(&mesh.positions, &mesh.indices[index]);
            let kept = kept_halves(&corners).unwrap_or_default();
            kept.into_iter().filter(|kept| *kept).count()
        }),
        _ => sum(geometry.count(), |index| {
            usize::from(ScalarLists::is_sound(geometry, index as u32))
        }),
    }
}

/// The sum of `f` over all numbers below `count`.
fn sum(count: usize, f: impl Fn(usize) -> usize + Sync + Send) -> usize {
    let chunk = chunk_len(count);
    let sums = map(count.div_ceil(chunk), 1, |place| {
        let range = place * chunk..count.min((place + 1) * chunk);
        range.map(&f).sum::<usize>()
    });
    sums.into_iter().sum()
}
