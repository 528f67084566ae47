//! The primitives of a scene, checked once and shared by every builder and by the brute-force oracle.

use core::sync::atomic::{AtomicBool, Ordering};

use crate::aabb::Aabb;
use crate::build::parallel::{chunk_len, for_each, map};
use crate::error::Error;
use crate::geometry::{Geometry, PrimRef, Sphere, TriangleMesh};

/// Checked copies of all primitives that can be hit.
///
/// Dropped and counted are: triangles with a NaN or infinite coordinate, triangles of which two corners
/// coincide, spheres without a positive finite radius and a finite centre. A triangle whose three
/// different corners lie on one line is kept: seen by a ray, rounding makes it a sliver, and a closed
/// mesh may need that sliver to have no gap.
#[derive(Clone, Debug, Default)]
pub struct Primitives {
    pub(crate) triangles: Vec<[[f32; 3]; 3]>,
    pub(crate) triangle_refs: Vec<PrimRef>,
    pub(crate) spheres: Vec<Sphere>,
    pub(crate) sphere_refs: Vec<PrimRef>,
    dropped: usize,
}

/// Leaf references have this many values per primitive kind.
const MAX_PRIMITIVES: usize = 1 << 30;

impl Primitives {
    /// Checks and copies the primitives of `geometries`.
    ///
    /// # Errors
    /// A vertex index out of range; more than 2³⁰ primitives or 2³² - 1 geometries.
    pub fn new(geometries: &[Geometry<'_>]) -> Result<Self, Error> {
        let limit = |what, found, limit| {
            if found > limit {
                Err(Error::TooMany { what, found, limit })
            } else {
                Ok(())
            }
        };
        limit("geometries", geometries.len(), u32::MAX as usize)?;
        let count = geometries
            .iter()
            .map(|geometry| match geometry {
                Geometry::Triangles(mesh) => mesh.indices.len(),
                Geometry::Spheres(spheres) => spheres.len(),
            })
            .sum();
        limit("primitives", count, MAX_PRIMITIVES)?;

        let mut primitives = Self::default();
        primitives.copy_triangles(geometries)?;
        for (geometry, geom_id) in geometries.iter().zip(0u32..) {
            let Geometry::Spheres(spheres) = geometry else {
                continue;
            };
            for (sphere, prim_id) in spheres.iter().zip(0u32..) {
                primitives.push_sphere(*sphere, PrimRef { geom_id, prim_id });
            }
        }
        Ok(primitives)
    }

    /// Copies all triangles, by many threads if there are many; then drops those that are not sound, which
    /// are rare.
    fn copy_triangles(&mut self, geometries: &[Geometry<'_>]) -> Result<(), Error> {
        let meshes = || {
            geometries
                .iter()
                .zip(0u32..)
                .filter_map(|(geometry, geom_id)| match geometry {
                    Geometry::Triangles(mesh) => Some((mesh, geom_id)),
                    Geometry::Spheres(_) => None,
                })
        };
        let count = meshes().map(|(mesh, _)| mesh.indices.len()).sum();
        let id = PrimRef {
            geom_id: 0,
            prim_id: 0,
        };
        self.triangles = vec![[[0.0; 3]; 3]; count];
        self.triangle_refs = vec![id; count];

        let chunk = chunk_len(count);
        let mut jobs = Vec::new();
        let mut triangles = &mut self.triangles[..];
        let mut refs = &mut self.triangle_refs[..];
        for (mesh, geom_id) in meshes() {
            for (indices, chunk_index) in mesh.indices.chunks(chunk).zip(0..) {
                let (triangles_here, others) = triangles.split_at_mut(indices.len());
                triangles = others;
                let (refs_here, others) = refs.split_at_mut(indices.len());
                refs = others;
                jobs.push(Job {
                    mesh,
                    indices,
                    id: PrimRef {
                        geom_id,
                        prim_id: (chunk_index * chunk) as u32,
                    },
                    triangles: triangles_here,
                    refs: refs_here,
                });
            }
        }
        let all_sound = AtomicBool::new(true);
        for_each(jobs, |job| {
            if !job.run() {
                all_sound.store(false, Ordering::Relaxed);
            }
        });
        if all_sound.into_inner() {
            return Ok(());
        }
        for (mesh, geom_id) in meshes() {
            check_indices(mesh, geom_id)?;
        }
        self.drop_unsound_triangles();
        Ok(())
    }

    fn drop_unsound_triangles(&mut self) {
        let mut kept = 0;
        for index in 0..self.triangles.len() {
            let triangle = self.triangles[index];
            if is_sound(triangle.each_ref()) {
                self.triangles[kept] = triangle;
                self.triangle_refs[kept] = self.triangle_refs[index];
                kept += 1;
            }
        }
        self.dropped += self.triangles.len() - kept;
        self.triangles.truncate(kept);
        self.triangle_refs.truncate(kept);
    }

    fn push_sphere(&mut self, sphere: Sphere, id: PrimRef) {
        let bounds = sphere.bounds();
        let finite = bounds.min.iter().chain(&bounds.max).all(|x| x.is_finite());
        if finite && sphere.radius > 0.0 {
            self.spheres.push(sphere);
            self.sphere_refs.push(id);
        } else {
            self.dropped += 1;
        }
    }

    /// How many there are, without the dropped ones.
    pub fn len(&self) -> usize {
        self.triangles.len() + self.spheres.len()
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How many were dropped.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// The smallest box around them all; empty if there are none.
    pub fn bounds(&self) -> Aabb {
        let chunk = chunk_len(self.len());
        map(self.len().div_ceil(chunk), 1, |place| {
            let range = place * chunk..self.len().min((place + 1) * chunk);
            range.fold(Aabb::EMPTY, |bounds, index| {
                bounds.union(&self.bounds_of(index))
            })
        })
        .iter()
        .fold(Aabb::EMPTY, |all, bounds| all.union(bounds))
    }

    /// Bounds of one primitive: triangles come first, spheres after them.
    pub(crate) fn bounds_of(&self, index: usize) -> Aabb {
        match index.checked_sub(self.triangles.len()) {
            None => Aabb::around(&self.triangles[index]),
            Some(index) => self.spheres[index].bounds(),
        }
    }

    /// Whether the primitive of this index is a sphere.
    pub(crate) fn is_sphere(&self, index: usize) -> bool {
        index >= self.triangles.len()
    }
}

/// Triangles of one mesh to be copied.
struct Job<'a> {
    mesh: &'a TriangleMesh<'a>,
    indices: &'a [[u32; 3]],
    /// Of the first of them.
    id: PrimRef,
    triangles: &'a mut [[[f32; 3]; 3]],
    refs: &'a mut [PrimRef],
}

impl Job<'_> {
    /// Copies them. Returns whether all are sound; those with an index out of range are not.
    fn run(self) -> bool {
        let positions = &self.mesh.positions[..];
        let mut all_sound = true;
        let targets = self.triangles.iter_mut().zip(self.refs);
        for ((&[a, b, c], (triangle, id)), prim_id) in
            self.indices.iter().zip(targets).zip(self.id.prim_id..)
        {
            let corner = |index: u32| positions.get(index as usize).unwrap_or(&[f32::NAN; 3]);
            let corners = [corner(a), corner(b), corner(c)];
            *triangle = corners.map(|corner| *corner);
            *id = PrimRef { prim_id, ..self.id };
            all_sound &= is_sound(corners);
        }
        all_sound
    }
}

/// Whether all coordinates are finite and all corners different.
#[inline(always)]
fn is_sound([a, b, c]: [&[f32; 3]; 3]) -> bool {
    is_finite(a) && is_finite(b) && is_finite(c) && a != b && b != c && c != a
}

#[inline(always)]
fn is_finite([x, y, z]: &[f32; 3]) -> bool {
    x.is_finite() && y.is_finite() && z.is_finite()
}

/// Finds the first index out of range.
fn check_indices(mesh: &TriangleMesh<'_>, geom_id: u32) -> Result<(), Error> {
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
