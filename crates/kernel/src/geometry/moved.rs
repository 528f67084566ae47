//! Geometry whose vertices moved, for a tree that keeps its shape.
//!
//! A refit must answer like a tree built anew. So the same primitives must be sound before and after, which is checked
//! before anything is changed.

use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::cutout::CutoutBlock;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::quad::{half, kept_halves, quad_of};
use crate::geometry::sound::{check_indices, check_sphere, corners, is_sound};
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::user::{UserBlock, UserPrim};
use crate::geometry::{Geometry, PrimRef, Sphere};
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
        for geometry in geometries {
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
    fn triangle(&self, id: PrimRef) -> Option<[[f32; 3]; 3]> {
        let corners = match (
            self.geometries.get(id.geom_id as usize)?,
            quad_of(id.prim_id),
        ) {
            (Geometry::Triangles(mesh), None) => {
                corners(&mesh.positions, mesh.indices.get(id.prim_id as usize)?)
            }
            (Geometry::Quads(mesh), Some((quad, which))) => {
                let corners = corners(&mesh.positions, mesh.indices.get(quad as usize)?);
                let is_kept = || kept_halves(&corners).is_ok_and(|kept| kept[which]);
                return (self.all_sound || is_kept()).then(|| half(corners, which));
            }
            _ => return None,
        };
        (self.all_sound || is_sound(&corners)).then_some(corners)
    }

    /// A sphere; `None` unless it is there and sound.
    fn sphere(&self, id: PrimRef) -> Option<Sphere> {
        let Geometry::Spheres(spheres) = self.geometries.get(id.geom_id as usize)? else {
            return None;
        };
        let sphere = spheres.get(id.prim_id as usize)?;
        check_sphere(sphere).is_ok().then_some(*sphere)
    }

    /// A primitive of user geometry; `None` if it is not there or its box is not sound.
    fn user(&self, id: PrimRef) -> Option<UserPrim> {
        match self.geometries.get(id.geom_id as usize)? {
            Geometry::User { count, shape } if id.prim_id < *count => {
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
            ids.into_iter().find(|id| B::prim(self, *id).is_none())
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
            usize::from(is_sound(&corners(&mesh.positions, &mesh.indices[index])))
        }),
        Geometry::Quads(mesh) => sum(mesh.indices.len(), |index| {
            let corners = corners(&mesh.positions, &mesh.indices[index]);
            let kept = kept_halves(&corners).unwrap_or_default();
            kept.into_iter().filter(|kept| *kept).count()
        }),
        Geometry::Spheres(spheres) => sum(spheres.len(), |index| {
            usize::from(check_sphere(&spheres[index]).is_ok())
        }),
        Geometry::User { count, shape } => sum(*count as usize, |index| {
            usize::from(UserPrim::new(shape, index as u32).is_ok())
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

/// Leaf blocks that take the shapes of their primitives from elsewhere.
pub(crate) trait Refill: LeafBlock {
    /// Shape of a primitive.
    type Prim;

    /// A primitive; `None` unless it is there and sound.
    fn prim(moved: &Moved<'_>, id: PrimRef) -> Option<Self::Prim>;

    /// Writes a primitive into an occupied lane and returns the box around the primitive.
    fn put(&mut self, lane: usize, prim: Self::Prim, id: PrimRef) -> Aabb;

    /// Has nothing hit the primitive in a lane.
    fn remove(&mut self, _lane: usize) {}

    /// Writes all primitives again, in the same lanes, and returns the box around them. They have been checked. One that
    /// is sound no more, which only happens to user geometry, is hit by nothing.
    fn refill(&mut self, moved: &Moved<'_>) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for lane in 0..self.count() {
            let id = self.id(lane);
            match Self::prim(moved, id) {
                Some(prim) => bounds = bounds.union(&self.put(lane, prim, id)),
                None => self.remove(lane),
            }
        }
        bounds
    }
}

impl Refill for TriangleBlock {
    type Prim = [[f32; 3]; 3];

    #[inline(always)]
    fn prim(moved: &Moved<'_>, id: PrimRef) -> Option<Self::Prim> {
        moved.triangle(id)
    }

    #[inline(always)]
    fn put(&mut self, lane: usize, corners: Self::Prim, id: PrimRef) -> Aabb {
        self.set(lane, &corners, id);
        Aabb::around(&corners)
    }
}

impl Refill for CutoutBlock {
    type Prim = [[f32; 3]; 3];

    #[inline(always)]
    fn prim(moved: &Moved<'_>, id: PrimRef) -> Option<Self::Prim> {
        moved.triangle(id)
    }

    fn put(&mut self, lane: usize, corners: Self::Prim, id: PrimRef) -> Aabb {
        self.triangles.put(lane, corners, id)
    }
}

impl Refill for SphereBlock {
    type Prim = Sphere;

    fn prim(moved: &Moved<'_>, id: PrimRef) -> Option<Sphere> {
        moved.sphere(id)
    }

    fn put(&mut self, lane: usize, sphere: Sphere, _: PrimRef) -> Aabb {
        self.spheres[lane] = sphere;
        sphere.bounds()
    }
}

impl Refill for UserBlock {
    type Prim = UserPrim;

    fn prim(moved: &Moved<'_>, id: PrimRef) -> Option<UserPrim> {
        moved.user(id)
    }

    fn put(&mut self, lane: usize, prim: UserPrim, _: PrimRef) -> Aabb {
        let bounds = prim.bounds;
        self.prims[lane] = Some(prim);
        bounds
    }

    fn remove(&mut self, lane: usize) {
        if let Some(prim) = &mut self.prims[lane] {
            prim.bounds = Aabb::EMPTY;
        }
    }
}
