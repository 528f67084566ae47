//! Geometry whose vertices moved, for a tree that keeps its shape.
//!
//! A refit must answer like a tree built anew. So the same primitives must be sound before and after, which is checked
//! before anything is changed.

use core::sync::atomic::{AtomicBool, Ordering};

use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::cutout::CutoutBlock;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::copy::{check_indices, is_sound, is_sound_sphere, quad_corners};
use crate::geometry::quad::{half, kept_halves, quad_of};
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::user::{UserBlock, UserPrim};
use crate::geometry::{Geometry, PrimRef, Sphere, TriangleMesh};
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
    /// A vertex index out of range; another number of sound primitives.
    pub fn new(geometries: &'a [Geometry<'a>], kept: usize) -> Result<Self, Error> {
        let (mut sound, mut all) = (0, 0);
        for (geometry, geom_id) in geometries.iter().zip(0u32..) {
            match geometry {
                Geometry::Triangles(mesh) => {
                    sound += sound_triangles(mesh, geom_id)?;
                    all += mesh.indices.len();
                }
                Geometry::Quads(mesh) => {
                    for (indices, quad) in mesh.indices.iter().zip(0u32..) {
                        let corners = quad_corners(mesh, indices, (geom_id, quad))?;
                        let kept = kept_halves(&corners).unwrap_or_default();
                        sound += kept.into_iter().filter(|kept| *kept).count();
                    }
                    all += 2 * mesh.indices.len();
                }
                Geometry::Spheres(spheres) => {
                    sound += spheres
                        .iter()
                        .filter(|sphere| is_sound_sphere(sphere))
                        .count();
                    all += spheres.len();
                }
                Geometry::User { count, shape } => {
                    let is_sound = |prim_id: &u32| UserPrim::new(shape, *prim_id).is_ok();
                    sound += (0..*count).filter(is_sound).count();
                    all += *count as usize;
                }
            }
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

    /// The corners of a triangle, which is there.
    #[inline(always)]
    fn triangle(&self, id: PrimRef) -> [[f32; 3]; 3] {
        match &self.geometries[id.geom_id as usize] {
            Geometry::Triangles(mesh) => corners(mesh, &mesh.indices[id.prim_id as usize]),
            Geometry::Quads(mesh) => {
                let (quad, which) = quad_of(id.prim_id).expect("checked before");
                let indices = half(mesh.indices[quad as usize], which);
                indices.map(|index| mesh.positions[index as usize])
            }
            _ => unreachable!("checked before"),
        }
    }

    /// A sphere, which is there.
    fn sphere(&self, id: PrimRef) -> Sphere {
        match &self.geometries[id.geom_id as usize] {
            Geometry::Spheres(spheres) => spheres[id.prim_id as usize],
            _ => unreachable!("checked before"),
        }
    }

    /// Whether there is such a triangle, and it is sound.
    fn has_triangle(&self, id: PrimRef) -> bool {
        match (
            self.geometries.get(id.geom_id as usize),
            quad_of(id.prim_id),
        ) {
            (Some(Geometry::Triangles(mesh)), None) => {
                let indices = mesh.indices.get(id.prim_id as usize);
                indices.is_some_and(|indices| {
                    self.all_sound || is_sound(corners(mesh, indices).each_ref())
                })
            }
            (Some(Geometry::Quads(mesh)), Some((quad, which))) => {
                mesh.indices.get(quad as usize).is_some_and(|indices| {
                    // In range: all were looked at before.
                    let corners = indices.map(|index| mesh.positions[index as usize]);
                    kept_halves(&corners).is_ok_and(|kept| kept[which])
                })
            }
            _ => false,
        }
    }

    /// Whether there is such a sphere, and it is sound.
    fn has_sphere(&self, id: PrimRef) -> bool {
        let Some(Geometry::Spheres(spheres)) = self.geometries.get(id.geom_id as usize) else {
            return false;
        };
        spheres
            .get(id.prim_id as usize)
            .is_some_and(is_sound_sphere)
    }

    /// A primitive of user geometry; `None` if it is not there or its box is not sound.
    fn user(&self, id: PrimRef) -> Option<UserPrim> {
        match self.geometries.get(id.geom_id as usize) {
            Some(Geometry::User { count, shape }) if id.prim_id < *count => {
                UserPrim::new(shape, id.prim_id).ok()
            }
            _ => None,
        }
    }

    /// Fails unless all primitives of these blocks are there and sound.
    ///
    /// # Errors
    /// The first primitive that is not.
    pub fn check<B: Refill>(&self, blocks: &[B]) -> Result<(), Error> {
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

/// The corners of a triangle whose indices are in range.
#[inline(always)]
fn corners(mesh: &TriangleMesh<'_>, indices: &[u32; 3]) -> [[f32; 3]; 3] {
    indices.map(|index| mesh.positions[index as usize])
}

/// How many triangles of a mesh are sound.
fn sound_triangles(mesh: &TriangleMesh<'_>, geom_id: u32) -> Result<usize, Error> {
    let (positions, indices) = (&*mesh.positions, &*mesh.indices);
    let in_range = AtomicBool::new(true);
    let chunk = chunk_len(indices.len());
    let sound = map(indices.len().div_ceil(chunk), 1, |index| {
        let indices = &indices[index * chunk..indices.len().min((index + 1) * chunk)];
        let is_kept = |[a, b, c]: &&[u32; 3]| {
            let corner = |index: &u32| positions.get(*index as usize);
            match (corner(a), corner(b), corner(c)) {
                (Some(a), Some(b), Some(c)) => is_sound([a, b, c]),
                _ => {
                    in_range.store(false, Ordering::Relaxed);
                    false
                }
            }
        };
        indices.iter().filter(is_kept).count()
    });
    if !in_range.into_inner() {
        check_indices(mesh, geom_id)?;
    }
    Ok(sound.iter().sum())
}

/// Leaf blocks that take the shapes of their primitives from elsewhere.
pub(crate) trait Refill: LeafBlock {
    /// Whether there is such a primitive, and it is sound.
    fn is_there(moved: &Moved<'_>, id: PrimRef) -> bool;

    /// Writes all primitives anew, in the same lanes, and returns the box around them. They are there.
    fn refill(&mut self, moved: &Moved<'_>) -> Aabb;
}

impl Refill for TriangleBlock {
    fn is_there(moved: &Moved<'_>, id: PrimRef) -> bool {
        moved.has_triangle(id)
    }

    fn refill(&mut self, moved: &Moved<'_>) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for lane in 0..self.count() {
            let id = LeafBlock::id(self, lane);
            let corners = moved.triangle(id);
            self.set(lane, &corners, id);
            bounds = bounds.union(&Aabb::around(&corners));
        }
        bounds
    }
}

impl Refill for CutoutBlock {
    fn is_there(moved: &Moved<'_>, id: PrimRef) -> bool {
        moved.has_triangle(id)
    }

    fn refill(&mut self, moved: &Moved<'_>) -> Aabb {
        self.triangles.refill(moved)
    }
}

impl Refill for SphereBlock {
    fn is_there(moved: &Moved<'_>, id: PrimRef) -> bool {
        moved.has_sphere(id)
    }

    fn refill(&mut self, moved: &Moved<'_>) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for (sphere, id) in self.spheres.iter_mut().zip(&self.refs).take(self.count) {
            *sphere = moved.sphere(*id);
            bounds = bounds.union(&sphere.bounds());
        }
        bounds
    }
}

impl Refill for UserBlock {
    fn is_there(moved: &Moved<'_>, id: PrimRef) -> bool {
        moved.user(id).is_some()
    }

    /// Boxes are asked for anew. One that is sound no more, although it was when it was checked, becomes empty: nothing
    /// hits it.
    fn refill(&mut self, moved: &Moved<'_>) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for (prim, id) in self.prims.iter_mut().flatten().zip(self.refs) {
            match moved.user(id) {
                Some(new) => *prim = new,
                None => prim.bounds = Aabb::EMPTY,
            }
            bounds = bounds.union(&prim.bounds);
        }
        bounds
    }
}
