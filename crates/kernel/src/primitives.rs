//! The primitives of a scene, checked once and shared by every builder and by the brute-force oracle.

use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::{Geometry, PrimRef, Sphere};

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
        for (geometry, geom_id) in geometries.iter().zip(0u32..) {
            match geometry {
                Geometry::Triangles(mesh) => {
                    for (indices, prim_id) in mesh.indices.iter().zip(0u32..) {
                        let corner = |index: u32| {
                            mesh.positions.get(index as usize).copied().ok_or(
                                Error::IndexOutOfRange {
                                    geom_id,
                                    prim_id,
                                    index,
                                    vertices: mesh.positions.len(),
                                },
                            )
                        };
                        let [a, b, c] = *indices;
                        primitives.push_triangle(
                            [corner(a)?, corner(b)?, corner(c)?],
                            PrimRef { geom_id, prim_id },
                        );
                    }
                }
                Geometry::Spheres(spheres) => {
                    for (sphere, prim_id) in spheres.iter().zip(0u32..) {
                        primitives.push_sphere(*sphere, PrimRef { geom_id, prim_id });
                    }
                }
            }
        }
        Ok(primitives)
    }

    fn push_triangle(&mut self, corners: [[f32; 3]; 3], id: PrimRef) {
        let [a, b, c] = corners;
        let finite = corners.as_flattened().iter().all(|x| x.is_finite());
        if finite && a != b && b != c && c != a {
            self.triangles.push(corners);
            self.triangle_refs.push(id);
        } else {
            self.dropped += 1;
        }
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
        (0..self.len()).fold(Aabb::EMPTY, |bounds, index| {
            bounds.union(&self.bounds_of(index))
        })
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
