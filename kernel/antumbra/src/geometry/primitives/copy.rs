//! First stage: geometries are checked and copied, what is unsound is dropped.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;
use core::sync::atomic::{AtomicBool, Ordering};

use super::dropped::{DropReason, Dropped};
use super::kinds::ScalarLists;
use crate::error::Error;
use crate::geometry::cutout::MeshFilter;
use crate::geometry::quad::{half, half_id, kept_halves};
use crate::geometry::sound::{check_indices, check_triangle, corners, is_sound};
use crate::geometry::{Geometry, GeometryId, PrimRef, QuadMesh, TriangleMesh};
use crate::parallel::{chunk_len, fill};

/// Most primitives in one list of geometries.
const MAX_PRIMITIVES: usize = 1 << 29;

/// Most primitives of each kind other than triangles in one list of geometries.
const MAX_SCALARS: usize = 1 << 28;

/// Filter of a triangle whose mesh has none.
pub(super) const NO_FILTER: u32 = u32::MAX;

/// Checked copies of a list of geometries, before filters decide which triangles are partly transparent.
#[derive(Default)]
pub(super) struct Copied {
    pub triangles: Vec<[[f32; 3]; 3]>,
    /// Names of the triangles, as many as `triangles`.
    pub triangle_refs: Vec<PrimRef>,
    /// Per triangle, the index of its filter, or [`NO_FILTER`]. Empty if no mesh of the list has a filter.
    pub filter_of: Vec<u32>,
    /// All other primitives.
    pub scalars: ScalarLists,
    /// Index of the object that the list is; `None` for the world.
    object: Option<u32>,
    /// Primitives that were unsound.
    pub dropped: Vec<Dropped>,
}

impl Copied {
    /// Copies all geometries, and adds the filters of their meshes to `opacities`.
    pub fn new(
        geometries: &[Geometry<'_>],
        object: Option<u32>,
        opacities: &mut Vec<MeshFilter>,
    ) -> Result<Self, Error> {
        check_counts(geometries)?;
        let mut copied = Self {
            object,
            ..Self::default()
        };
        copied.copy_triangles(geometries);
        for (geometry, geom_id) in geometries.iter().zip(0u32..) {
            match geometry {
                Geometry::Triangles(_) => {}
                Geometry::Quads(mesh) => copied.copy_quads(mesh, geom_id),
                _ => {
                    for (id, reason) in copied.scalars.add(geometry, geom_id) {
                        copied.drop_primitive(id, reason);
                    }
                }
            }
        }
        if !copied.dropped.is_empty() {
            check_indices(geometries)?;
        }
        copied.note_filters(geometries, opacities);
        Ok(copied)
    }

    /// Copies all triangles, by many threads if there are many. Then drops unsound ones, which are rare.
    fn copy_triangles(&mut self, geometries: &[Geometry<'_>]) {
        let meshes: Vec<_> = meshes(geometries).collect();
        let count = meshes.iter().map(|(mesh, _)| mesh.indices.len()).sum();
        let chunk = chunk_len(count);
        let all_sound = AtomicBool::new(true);
        self.triangles = fill(count, chunk, |range, slots| {
            let mut sound = true;
            for (mesh, _, here) in pieces(&meshes, range) {
                for indices in &mesh.indices[here] {
                    let corners = corners(&mesh.positions, indices);
                    sound &= is_sound(&corners);
                    slots.push(corners);
                }
            }
            if !sound {
                all_sound.store(false, Ordering::Relaxed);
            }
        });
        self.triangle_refs = fill(count, chunk, |range, slots| {
            for (_, geom_id, here) in pieces(&meshes, range) {
                for index in here {
                    let prim_id = index as u32;
                    slots.push(PrimRef { geom_id, prim_id });
                }
            }
        });
        if !all_sound.into_inner() {
            self.drop_unsound_triangles(geometries);
        }
    }

    /// Triangles that move stay if they are sound at some time.
    fn drop_unsound_triangles(&mut self, geometries: &[Geometry<'_>]) {
        let is_ever_sound = |id: PrimRef| match &geometries[id.geom_id as usize] {
            Geometry::Triangles(mesh) => mesh.is_ever_sound(id.prim_id),
            _ => false,
        };
        let mut kept = 0;
        for index in 0..self.triangles.len() {
            let (triangle, id) = (self.triangles[index], self.triangle_refs[index]);
            match check_triangle(&triangle) {
                Err(reason) if reason != DropReason::CornersCoincide || !is_ever_sound(id) => {
                    self.drop_primitive(id, reason);
                }
                _ => {
                    self.triangles[kept] = triangle;
                    self.triangle_refs[kept] = id;
                    kept += 1;
                }
            }
        }
        self.triangles.truncate(kept);
        self.triangle_refs.truncate(kept);
    }

    fn drop_primitive(&mut self, PrimRef { geom_id, prim_id }: PrimRef, reason: DropReason) {
        self.dropped.push(Dropped::Primitive {
            object: self.object,
            geom_id,
            prim_id,
            reason,
        });
    }

    /// Copies the halves of quads behind the triangles.
    fn copy_quads(&mut self, mesh: &QuadMesh<'_>, geom_id: u32) {
        self.triangles.reserve(2 * mesh.indices.len());
        self.triangle_refs.reserve(2 * mesh.indices.len());
        for (indices, quad) in mesh.indices.iter().zip(0u32..) {
            let corners = corners(&mesh.positions, indices);
            match kept_halves(&corners) {
                Ok(kept) => {
                    for which in (0..2).filter(|which| kept[*which]) {
                        let prim_id = half_id(quad, which);
                        self.triangles.push(half(corners, which));
                        self.triangle_refs.push(PrimRef { geom_id, prim_id });
                    }
                }
                Err(reason) => {
                    let prim_id = quad;
                    self.drop_primitive(PrimRef { geom_id, prim_id }, reason);
                }
            }
        }
    }

    /// Notes the filter of every triangle, if any mesh has one.
    fn note_filters(&mut self, geometries: &[Geometry<'_>], opacities: &mut Vec<MeshFilter>) {
        let before = opacities.len();
        let mut filter_of_mesh = vec![NO_FILTER; geometries.len()];
        for (mesh, geom_id) in meshes(geometries) {
            if let Some(filter) = &mesh.opacity {
                filter_of_mesh[geom_id as usize] = opacities.len() as u32;
                opacities.push(MeshFilter {
                    mesh: GeometryId {
                        object: self.object,
                        geom_id,
                    },
                    opacity: Arc::clone(filter),
                });
            }
        }
        if opacities.len() > before {
            let refs = self.triangle_refs.iter();
            self.filter_of = refs.map(|id| filter_of_mesh[id.geom_id as usize]).collect();
        }
    }
}

/// The triangle meshes among geometries, with their `geom_id`.
fn meshes<'a, 'g>(
    geometries: &'a [Geometry<'g>],
) -> impl Iterator<Item = (&'a TriangleMesh<'g>, u32)> {
    let numbered = geometries.iter().zip(0u32..);
    numbered.filter_map(|(geometry, geom_id)| match geometry {
        Geometry::Triangles(mesh) => Some((mesh, geom_id)),
        _ => None,
    })
}

/// Parts of meshes that are in a range of all their triangles.
fn pieces<'a, 'g>(
    meshes: &'a [(&'a TriangleMesh<'g>, u32)],
    range: Range<usize>,
) -> impl Iterator<Item = (&'a TriangleMesh<'g>, u32, Range<usize>)> {
    let mut end = 0;
    meshes.iter().filter_map(move |(mesh, geom_id)| {
        let first = end;
        end += mesh.indices.len();
        let here = range.start.max(first)..range.end.min(end);
        (!here.is_empty()).then(|| (*mesh, *geom_id, here.start - first..here.end - first))
    })
}

/// Bytes that a build takes for each primitive, as measured on triangles, and some more.
const BUILD_BYTES: usize = 160;

/// Fails if there is more than ids and leaf references can name, or than there is memory for.
fn check_counts(geometries: &[Geometry<'_>]) -> Result<(), Error> {
    limit("geometries", geometries.len(), u32::MAX as usize)?;
    let all = geometries.iter().map(Geometry::count).sum();
    limit("primitives", all, MAX_PRIMITIVES)?;
    Error::if_no_memory("primitives", all, BUILD_BYTES)?;
    for (name, count) in ScalarLists::counts(geometries) {
        limit(name, count, MAX_SCALARS)?;
    }
    Ok(())
}

/// Fails if `found` is more than `limit`.
pub(super) fn limit(what: &'static str, found: usize, limit: usize) -> Result<(), Error> {
    if found > limit {
        Err(Error::TooMany { what, found, limit })
    } else {
        Ok(())
    }
}
