//! First stage: geometries are checked and copied, what is unsound is dropped.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::sync::atomic::{AtomicBool, Ordering};

use super::dropped::{DropReason, Dropped};
use crate::error::Error;
use crate::geometry::quad::{half, half_id, kept_halves};
use crate::geometry::user::UserPrim;
use crate::geometry::{Geometry, Opacity, PrimRef, QuadMesh, Sphere, TriangleMesh};
use crate::parallel::{chunk_len, for_each};

/// Primitives of one list of geometries.
const MAX_PRIMITIVES: usize = 1 << 29;

/// Primitives of user geometry of one list of geometries.
const MAX_USERS: usize = 1 << 28;

/// Spheres of one list of geometries.
const MAX_SPHERES: usize = 1 << 28;

/// Filter of a triangle whose mesh has none.
pub(super) const NO_FILTER: u32 = u32::MAX;

/// Checked copies of a list of geometries. Nobody knows yet which triangles are partly transparent.
#[derive(Default)]
pub(super) struct Copied {
    pub triangles: Vec<[[f32; 3]; 3]>,
    /// As many as `triangles`.
    pub triangle_refs: Vec<PrimRef>,
    /// Per triangle, the index of its filter, or [`NO_FILTER`]. Empty if no mesh of the list has a filter.
    pub filter_of: Vec<u32>,
    pub spheres: Vec<Sphere>,
    /// As many as `spheres`.
    pub sphere_refs: Vec<PrimRef>,
    pub users: Vec<UserPrim>,
    /// As many as `users`.
    pub user_refs: Vec<PrimRef>,
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
        opacities: &mut Vec<Arc<dyn Opacity>>,
    ) -> Result<Self, Error> {
        check_counts(geometries)?;
        let mut copied = Self {
            object,
            ..Self::default()
        };
        copied.copy_triangles(geometries)?;
        copied.copy_quads(geometries)?;
        copied.copy_spheres(geometries);
        copied.copy_users(geometries);
        copied.note_filters(geometries, opacities);
        Ok(copied)
    }

    /// Copies all triangles, by many threads if there are many; then drops those that are not sound, which
    /// are rare.
    fn copy_triangles(&mut self, geometries: &[Geometry<'_>]) -> Result<(), Error> {
        let count = meshes(geometries).map(|(mesh, _)| mesh.indices.len()).sum();
        let id = PrimRef {
            geom_id: 0,
            prim_id: 0,
        };
        self.triangles = vec![[[0.0; 3]; 3]; count];
        self.triangle_refs = vec![id; count];

        let all_sound = AtomicBool::new(true);
        for_each(self.jobs(geometries), |job| {
            if !job.run() {
                all_sound.store(false, Ordering::Relaxed);
            }
        });
        if all_sound.into_inner() {
            return Ok(());
        }
        for (mesh, geom_id) in meshes(geometries) {
            check_indices(mesh, geom_id)?;
        }
        self.drop_unsound_triangles();
        Ok(())
    }

    /// Divides the triangles of all meshes among threads, each with its place in the copy.
    fn jobs<'a>(&'a mut self, geometries: &'a [Geometry<'_>]) -> Vec<Job<'a>> {
        let chunk = chunk_len(self.triangles.len());
        let mut jobs = Vec::new();
        let mut triangles = &mut self.triangles[..];
        let mut refs = &mut self.triangle_refs[..];
        for (mesh, geom_id) in meshes(geometries) {
            for (indices, chunk_index) in mesh.indices.chunks(chunk).zip(0..) {
                let (triangles_here, others) = triangles.split_at_mut(indices.len());
                triangles = others;
                let (refs_here, others) = refs.split_at_mut(indices.len());
                refs = others;
                jobs.push(Job {
                    positions: &mesh.positions,
                    indices,
                    first: PrimRef {
                        geom_id,
                        prim_id: (chunk_index * chunk) as u32,
                    },
                    triangles: triangles_here,
                    refs: refs_here,
                });
            }
        }
        jobs
    }

    fn drop_unsound_triangles(&mut self) {
        let mut kept = 0;
        for index in 0..self.triangles.len() {
            let triangle = self.triangles[index];
            if is_sound(triangle.each_ref()) {
                self.triangles[kept] = triangle;
                self.triangle_refs[kept] = self.triangle_refs[index];
                kept += 1;
            } else {
                let reason = if triangle.iter().all(is_finite) {
                    DropReason::CornersCoincide
                } else {
                    DropReason::NotFinite
                };
                self.drop_primitive(self.triangle_refs[index], reason);
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

    /// Copies the halves of all quads behind the triangles.
    fn copy_quads(&mut self, geometries: &[Geometry<'_>]) -> Result<(), Error> {
        for (geometry, geom_id) in geometries.iter().zip(0u32..) {
            let Geometry::Quads(mesh) = geometry else {
                continue;
            };
            self.triangles.reserve(2 * mesh.indices.len());
            self.triangle_refs.reserve(2 * mesh.indices.len());
            for (indices, quad) in mesh.indices.iter().zip(0u32..) {
                let corners = quad_corners(mesh, indices, (geom_id, quad))?;
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
        Ok(())
    }

    fn copy_spheres(&mut self, geometries: &[Geometry<'_>]) {
        for (geometry, geom_id) in geometries.iter().zip(0u32..) {
            let Geometry::Spheres(spheres) = geometry else {
                continue;
            };
            for (sphere, prim_id) in spheres.iter().zip(0u32..) {
                let id = PrimRef { geom_id, prim_id };
                if is_sound_sphere(sphere) {
                    self.spheres.push(*sphere);
                    self.sphere_refs.push(id);
                } else if is_finite_sphere(sphere) {
                    self.drop_primitive(id, DropReason::NoRadius);
                } else {
                    self.drop_primitive(id, DropReason::NotFinite);
                }
            }
        }
    }

    fn copy_users(&mut self, geometries: &[Geometry<'_>]) {
        for (geometry, geom_id) in geometries.iter().zip(0u32..) {
            let Geometry::User { count, shape } = geometry else {
                continue;
            };
            for prim_id in 0..*count {
                let id = PrimRef { geom_id, prim_id };
                match UserPrim::new(shape, prim_id) {
                    Ok(prim) => {
                        self.users.push(prim);
                        self.user_refs.push(id);
                    }
                    Err(reason) => self.drop_primitive(id, reason),
                }
            }
        }
    }

    /// Notes the filter of every triangle, if any mesh has one.
    fn note_filters(&mut self, geometries: &[Geometry<'_>], opacities: &mut Vec<Arc<dyn Opacity>>) {
        let before = opacities.len();
        let mut filter_of_mesh = vec![NO_FILTER; geometries.len()];
        for (mesh, geom_id) in meshes(geometries) {
            if let Some(filter) = &mesh.opacity {
                filter_of_mesh[geom_id as usize] = opacities.len() as u32;
                opacities.push(Arc::clone(filter));
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

/// Fails if there is more than ids and leaf references can name.
fn check_counts(geometries: &[Geometry<'_>]) -> Result<(), Error> {
    limit("geometries", geometries.len(), u32::MAX as usize)?;
    let (mut triangles, mut spheres, mut users) = (0, 0, 0);
    for geometry in geometries {
        match geometry {
            Geometry::Triangles(mesh) => triangles += mesh.indices.len(),
            Geometry::Quads(mesh) => triangles += 2 * mesh.indices.len(),
            Geometry::Spheres(list) => spheres += list.len(),
            Geometry::User { count, .. } => users += *count as usize,
        }
    }
    limit("primitives", triangles + spheres + users, MAX_PRIMITIVES)?;
    limit("primitives of user geometry", users, MAX_USERS)?;
    limit("spheres", spheres, MAX_SPHERES)
}

/// Fails if `found` is more than `limit`.
pub(super) fn limit(what: &'static str, found: usize, limit: usize) -> Result<(), Error> {
    if found > limit {
        Err(Error::TooMany { what, found, limit })
    } else {
        Ok(())
    }
}

/// Triangles of one mesh to be copied, and where.
struct Job<'a> {
    positions: &'a [[f32; 3]],
    indices: &'a [[u32; 3]],
    /// Name of the first triangle.
    first: PrimRef,
    triangles: &'a mut [[[f32; 3]; 3]],
    refs: &'a mut [PrimRef],
}

impl Job<'_> {
    /// Copies the triangles. Returns whether all are sound; those with an index out of range are not.
    fn run(self) -> bool {
        let positions = self.positions;
        let mut all_sound = true;
        let targets = self.triangles.iter_mut().zip(self.refs);
        for ((&[a, b, c], (triangle, id)), prim_id) in
            self.indices.iter().zip(targets).zip(self.first.prim_id..)
        {
            let corner = |index: u32| positions.get(index as usize).unwrap_or(&[f32::NAN; 3]);
            let corners = [corner(a), corner(b), corner(c)];
            *triangle = corners.map(|corner| *corner);
            *id = PrimRef {
                prim_id,
                ..self.first
            };
            all_sound &= is_sound(corners);
        }
        all_sound
    }
}

/// Whether a sphere can be kept.
pub(in crate::geometry) fn is_sound_sphere(sphere: &Sphere) -> bool {
    is_finite_sphere(sphere) && sphere.radius > 0.0
}

fn is_finite_sphere(sphere: &Sphere) -> bool {
    let bounds = sphere.bounds();
    bounds.min.iter().chain(&bounds.max).all(|x| x.is_finite())
}

/// Whether all coordinates are finite and all corners different.
#[inline(always)]
pub(in crate::geometry) fn is_sound([a, b, c]: [&[f32; 3]; 3]) -> bool {
    is_finite(a) && is_finite(b) && is_finite(c) && a != b && b != c && c != a
}

#[inline(always)]
pub(in crate::geometry) fn is_finite([x, y, z]: &[f32; 3]) -> bool {
    x.is_finite() && y.is_finite() && z.is_finite()
}

/// Fails at the first index out of range.
pub(in crate::geometry) fn check_indices(
    mesh: &TriangleMesh<'_>,
    geom_id: u32,
) -> Result<(), Error> {
    let vertices = mesh.positions.len();
    for (indices, prim_id) in mesh.indices.iter().zip(0u32..) {
        for &index in indices {
            if index as usize >= vertices {
                return Err(Error::IndexOutOfRange {
                    geom_id,
                    prim_id,
                    index,
                    vertices,
                });
            }
        }
    }
    Ok(())
}

/// The corners of a quad, one of these geometry and number.
///
/// # Errors
/// An index out of range.
pub(in crate::geometry) fn quad_corners(
    mesh: &QuadMesh<'_>,
    indices: &[u32; 4],
    (geom_id, prim_id): (u32, u32),
) -> Result<[[f32; 3]; 4], Error> {
    let vertices = mesh.positions.len();
    let mut corners = [[0.0; 3]; 4];
    for (corner, &index) in corners.iter_mut().zip(indices) {
        let position = mesh.positions.get(index as usize);
        *corner = *position.ok_or(Error::QuadIndexOutOfRange {
            geom_id,
            prim_id,
            index,
            vertices,
        })?;
    }
    Ok(corners)
}
