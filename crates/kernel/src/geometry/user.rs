//! User geometry: primitives of which users give boxes and functions. Bounds, leaf block, test.
//!
//! Answers must not depend on a tree, whatever the functions return. So every function is asked with the whole interval of
//! the ray, never with one cut off at the best hit so far. And what it returns counts only where the ray is in the box that
//! the user gave: distances are clamped into that interval as those of spheres, see [`crate::geometry::ray_setup`].

use alloc::sync::Arc;
use core::fmt;

use antumbra_simd::Scalar;

use crate::aabb::Aabb;
use crate::geometry::best::Best;
use crate::geometry::instance_ray::Interval;
use crate::geometry::primitives::dropped::DropReason;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::{BLOCK, PrimRef};
use crate::ray::{Hit, INVALID_ID, Ray};

/// Geometry of your own: boxes, and functions that tell where rays hit.
///
/// One value stands for all primitives of a geometry, and the functions are told which one is asked about. Trees keep the
/// `Arc` that [`Geometry::user`](crate::Geometry::user) was given, and no copy of your data.
///
/// # What holds
/// - Functions must be deterministic: the same primitive and ray have the same answer, whenever and on whatever thread they
///   are asked. Then answers are the same bits for every tree, and those of [`Brute`](crate::Brute).
/// - Rays come in the space of the geometry: inside an instance they are in the space of the object. `t` means the same
///   there. The interval is always the whole one of the query.
/// - A function is called only where the ray's interval meets the box of the primitive. The order of calls is not defined.
/// - A hit counts if `tnear < t < tfar`. Any other, and one whose `t` is NaN, is as good as none.
/// - The ray must be in the box at `t`. A distance outside of it is moved to the nearer end of the part of the ray that is
///   inside, so boxes must be large enough.
/// - `u` and `v` are handed on as they are.
/// - A panic in a function ends the query, and leaves the tree as it was.
///
/// ```
/// use std::sync::Arc;
/// use antumbra::{Aabb, Bvh, Geometry, Ray, Recipe, UserGeometry, UserHit};
///
/// /// Discs at several heights that face up.
/// #[derive(Debug)]
/// struct Discs(Vec<f32>);
///
/// impl UserGeometry for Discs {
///     fn bounds(&self, prim_id: u32) -> Aabb {
///         let z = self.0[prim_id as usize];
///         Aabb::new([-1.0, -1.0, z], [1.0, 1.0, z])
///     }
///     fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
///         let t = (self.0[prim_id as usize] - ray.org[2]) / ray.dir[2];
///         let [u, v, _] = ray.at(t);
///         (u * u + v * v <= 1.0).then_some(UserHit::new(t, u, v))
///     }
/// }
///
/// let discs = Geometry::user(2, Arc::new(Discs(vec![1.0, 2.0])));
/// let bvh = Bvh::build(&[discs], &Recipe::default())?;
/// let up = |x| Ray::new([x, 0.0, 0.0], [0.0, 0.0, 1.0]);
/// assert_eq!(bvh.intersect(&up(0.5)).map(|hit| (hit.t, hit.u)), Some((1.0, 0.5)));
/// assert!(!bvh.occluded(&up(1.5)));
/// # Ok::<(), antumbra::Error>(())
/// ```
pub trait UserGeometry: fmt::Debug + Send + Sync {
    /// Box around a primitive. Asked once when the geometry is checked, and again in a refit. A primitive is dropped if
    /// its box has a NaN or infinite number, or is empty. A flat box is fine.
    fn bounds(&self, prim_id: u32) -> Aabb;

    /// Hit of a ray on a primitive: the closest one in the interval of the ray, if there are several.
    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit>;

    /// Whether a primitive occludes a ray. Must tell what [`UserGeometry::intersect`] tells, and may be faster.
    fn occluded(&self, prim_id: u32, ray: &Ray) -> bool {
        let hit = self.intersect(prim_id, ray);
        hit.is_some_and(|hit| ray.tnear < hit.t && hit.t < ray.tfar)
    }

    /// Geometric normal at a hit, of any length, in the space of the ray. [`Bvh::normal`](crate::Bvh::normal) asks, and has
    /// none for these primitives if this is `None`.
    fn normal(&self, _prim_id: u32, _ray: &Ray, _hit: &UserHit) -> Option<[f32; 3]> {
        None
    }
}

/// A hit on user geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct UserHit {
    /// Distance along the ray in multiples of its direction.
    pub t: f32,
    /// Any number, for [`Hit::u`](crate::Hit::u).
    pub u: f32,
    /// Any number, for [`Hit::v`](crate::Hit::v).
    pub v: f32,
}

impl UserHit {
    /// A hit at `t`, in multiples of the ray's direction, with two numbers of the user's choice.
    #[must_use]
    pub const fn new(t: f32, u: f32, v: f32) -> Self {
        Self { t, u, v }
    }
}

/// A primitive of user geometry.
#[derive(Clone, Debug)]
pub(crate) struct UserPrim {
    pub shape: Arc<dyn UserGeometry>,
    pub bounds: Aabb,
}

impl UserPrim {
    /// Asks for the box of a primitive.
    pub fn new(shape: &Arc<dyn UserGeometry>, prim_id: u32) -> Result<Self, DropReason> {
        let bounds = shape.bounds(prim_id);
        let mut sides = bounds.min.iter().chain(&bounds.max);
        if !sides.all(|x| x.is_finite()) {
            return Err(DropReason::NotFinite);
        }
        if bounds.is_empty() {
            return Err(DropReason::EmptyBounds);
        }
        Ok(Self {
            shape: Arc::clone(shape),
            bounds,
        })
    }

    /// The part of the ray in the box.
    fn interval(&self, ray: &RaySetup) -> Option<Interval> {
        let planes = [self.bounds.min, self.bounds.max].map(|[x, y, z]| [x, y, z, 0.0]);
        Interval::of(Scalar, ray, &planes)
    }

    /// The hit of a ray that is in the box in this interval.
    fn hit_in(&self, interval: &Interval, id: PrimRef, ray: &RaySetup) -> Option<Hit> {
        let UserHit { t, u, v } = self.shape.intersect(id.prim_id, ray)?;
        // Both intervals meet, so the clamped distance is in the ray's interval if this is.
        (ray.tnear < t && t < ray.tfar).then(|| Hit {
            t: interval.clamp(t),
            u,
            v,
            prim_id: id.prim_id,
            geom_id: id.geom_id,
            inst_id: INVALID_ID,
        })
    }

    pub fn hit(&self, id: PrimRef, ray: &RaySetup) -> Option<Hit> {
        self.hit_in(&self.interval(ray)?, id, ray)
    }

    pub fn occludes(&self, id: PrimRef, ray: &RaySetup) -> bool {
        self.interval(ray).is_some() && self.shape.occluded(id.prim_id, ray)
    }
}

/// Up to [`BLOCK`] primitives of user geometry. The first `count` lanes have one.
#[derive(Clone, Debug)]
pub(crate) struct UserBlock {
    pub count: usize,
    pub prims: [Option<UserPrim>; BLOCK],
    pub refs: [PrimRef; BLOCK],
}

impl UserBlock {
    pub const EMPTY: Self = Self {
        count: 0,
        prims: [const { None }; BLOCK],
        refs: [PrimRef {
            geom_id: u32::MAX,
            prim_id: u32::MAX,
        }; BLOCK],
    };

    pub fn push(&mut self, prim: UserPrim, id: PrimRef) {
        self.prims[self.count] = Some(prim);
        self.refs[self.count] = id;
        self.count += 1;
    }

    /// The primitives with their names.
    pub fn prims(&self) -> impl Iterator<Item = (&UserPrim, PrimRef)> {
        let prims = self.prims.iter().zip(self.refs);
        prims.filter_map(|(prim, id)| Some((prim.as_ref()?, id)))
    }

    /// The first lane whose primitive occludes the ray.
    #[cold]
    pub fn occluded(&self, ray: &RaySetup) -> Option<usize> {
        self.prims().position(|(prim, id)| prim.occludes(id, ray))
    }

    /// Replaces `best` by the block's closest hit where that precedes it, and returns whether it did.
    #[cold]
    pub fn intersect(&self, ray: &RaySetup, best: &mut Best) -> bool {
        let mut improved = false;
        for (prim, id) in self.prims() {
            // No hit is reported before the ray is in the box.
            if let Some(interval) = prim.interval(ray)
                && interval.enter <= best.limit
                && let Some(hit) = prim.hit_in(&interval, id, ray)
            {
                improved |= best.offer(hit);
            }
        }
        improved
    }

    /// Puts the primitive of lane `lanes[i]` into lane `i`.
    pub fn permute(&mut self, lanes: &[u8; BLOCK]) {
        let mut old = core::mem::replace(self, Self::EMPTY);
        self.count = old.count;
        for (lane, &from) in lanes.iter().enumerate() {
            self.prims[lane] = old.prims[from as usize].take();
            self.refs[lane] = old.refs[from as usize];
        }
    }
}
