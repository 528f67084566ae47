//! User geometry: primitives of which users give boxes and functions. Bounds and test.
//!
//! Answers must not depend on a tree, whatever the functions return. So every function is called with the whole interval
//! of the ray, never with one cut off at the best hit so far. And what it returns counts only where the ray is in the
//! box that the user gave: distances are clamped into that interval like distances to spheres, see
//! [`crate::geometry::ray_setup`].

use alloc::sync::Arc;
use core::fmt;

use crate::aabb::Aabb;
use crate::geometry::Geometry;
use crate::geometry::nearest::{Near, Place};
use crate::geometry::primitives::dropped::DropReason;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::scalar::{ScalarPrim, ScalarShape, SurfacePoint, interval_in, is_finite_box};
use crate::hash::Random;
use crate::ray::{Hit, Ray};

/// Geometry of your own: boxes, and functions that return where rays hit.
///
/// One value stands for all primitives of a geometry, and the functions receive the number of the primitive. Trees keep
/// the `Arc` that [`Geometry::user`](crate::Geometry::user) was given, and no copy of your data.
///
/// # What holds
/// - Functions must be deterministic: the same primitive and ray have the same answer in every call, on any thread. Then
///   answers are the same bits for every tree and for [`Brute`](crate::Brute).
/// - Rays come in the space of the geometry: inside an instance they are in the space of the object. `t` means the same
///   there. The interval is always the whole one of the query.
/// - A function is called only where the ray's interval overlaps the box of the primitive. The order of calls is not
///   defined.
/// - A hit counts if `tnear < t < tfar`. Any other is ignored, also one whose `t` is NaN.
/// - The ray must be in the box at `t`. A distance outside of it is moved to the nearer end of the part of the ray that is
///   inside, so boxes must be large enough.
/// - `u` and `v` are handed on as they are.
/// - A panic in a function ends the query, and leaves the tree as it was.
///
/// ```
/// use std::sync::Arc;
/// use antumbra::shapes::{UserGeometry, UserHit};
/// use antumbra::{Aabb, Bvh, Geometry, Ray, Recipe};
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
    /// Box around a primitive. Called once when the geometry is checked, and again in a refit. A primitive is dropped if
    /// its box has a NaN or infinite number, or is empty. A flat box is fine.
    fn bounds(&self, prim_id: u32) -> Aabb;

    /// Hit of a ray on a primitive: the closest one in the interval of the ray, if there are several.
    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit>;

    /// Whether a primitive occludes a ray. Must agree with [`UserGeometry::intersect`], and may be faster.
    fn occluded(&self, prim_id: u32, ray: &Ray) -> bool {
        let hit = self.intersect(prim_id, ray);
        hit.is_some_and(|hit| ray.tnear < hit.t && hit.t < ray.tfar)
    }

    /// Nearest point of a primitive to a point, both in the world.
    ///
    /// `world_from_object` is the transform of the instance that the primitive is in, in rows as for
    /// [`Instance`](crate::Instance), and the identity if it is in the world itself. A transform may stretch space, so the
    /// nearest point in the object may be another one.
    ///
    /// [`Bvh::closest`](crate::Bvh::closest) and its relatives compute the distance from this point. `None`, and a point that is
    /// not finite, mean that the primitive has none. A point outside of the box of the primitive is moved into the box.
    ///
    /// # Panics
    /// Unless implemented: geometry that is near must not be left out silently. Queries about points then
    /// panic when they come to a primitive, rays never.
    ///
    /// ```
    /// # use std::sync::Arc;
    /// # use antumbra::shapes::{UserGeometry, UserHit};
    /// # use antumbra::{Aabb, Bvh, Geometry, Ray, Recipe};
    /// /// A point of no size, which no ray hits.
    /// #[derive(Debug)]
    /// struct Dot([f32; 3]);
    ///
    /// impl UserGeometry for Dot {
    ///     fn bounds(&self, _: u32) -> Aabb {
    ///         Aabb::new(self.0, self.0)
    ///     }
    ///     fn intersect(&self, _: u32, _: &Ray) -> Option<UserHit> {
    ///         None
    ///     }
    ///     fn closest_point(&self, _: u32, _: [f64; 3], to_world: &[[f64; 4]; 3]) -> Option<[f64; 3]> {
    ///         let [x, y, z] = self.0.map(f64::from);
    ///         Some(to_world.map(|[a, b, c, d]| a * x + b * y + c * z + d))
    ///     }
    /// }
    ///
    /// let bvh = Bvh::build(&[Geometry::user(1, Arc::new(Dot([0.0, 3.0, 4.0])))], &Recipe::default())?;
    /// assert_eq!(bvh.closest([0.0; 3], 9.0).map(|near| near.distance), Some(5.0));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    fn closest_point(
        &self,
        _prim_id: u32,
        _point: [f64; 3],
        _world_from_object: &[[f64; 4]; 3],
    ) -> Option<[f64; 3]> {
        panic!(
            "queries about points need `UserGeometry::closest_point`, which `{}` does not implement",
            core::any::type_name::<Self>()
        );
    }

    /// Geometric normal at a hit, of any length, in the space of the ray. [`Bvh::normal`](crate::Bvh::normal) calls this
    /// function, and returns `None` for these primitives if this does.
    fn normal(&self, _prim_id: u32, _ray: &Ray, _hit: &UserHit) -> Option<[f32; 3]> {
        None
    }
}

/// Transform of an object that no instance places.
const IDENTITY: [[f64; 4]; 3] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
];

/// A hit on user geometry.
///
/// ```
/// use antumbra::shapes::UserHit;
///
/// let hit = UserHit::new(2.5, 0.1, 0.9);
/// assert_eq!(hit.t, 2.5);
/// ```
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
    /// None for a primitive that nothing hits.
    shape: Option<Arc<dyn UserGeometry>>,
    bounds: Aabb,
}

impl UserPrim {
    /// Queries the box of a primitive.
    fn new(shape: &Arc<dyn UserGeometry>, prim_id: u32) -> Result<Self, DropReason> {
        let bounds = shape.bounds(prim_id);
        if !is_finite_box(&bounds) {
            return Err(DropReason::NotFinite);
        }
        if bounds.is_empty() {
            return Err(DropReason::EmptyBounds);
        }
        Ok(Self {
            shape: Some(Arc::clone(shape)),
            bounds,
        })
    }

    /// A primitive from a file: one without a shape is hit by nothing.
    pub fn saved(shape: Option<Arc<dyn UserGeometry>>, bounds: Aabb) -> Option<Self> {
        if shape.is_none() {
            return Some(Self::NOTHING);
        }
        let is_sound = is_finite_box(&bounds) && !bounds.is_empty();
        is_sound.then_some(Self { shape, bounds })
    }

    /// Whether anything can hit the primitive.
    pub fn has_shape(&self) -> bool {
        self.shape.is_some()
    }

    /// Areas of the sides of the box, one of each pair.
    fn sides(&self) -> [f64; 3] {
        let Aabb { min, max } = self.bounds;
        let [x, y, z] = core::array::from_fn(|axis| f64::from(max[axis]) - f64::from(min[axis]));
        [y * z, z * x, x * y]
    }
}

impl ScalarShape for UserPrim {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn hit(&self, prim_id: u32, ray: &RaySetup, limit: f32) -> Option<[f32; 3]> {
        let interval = interval_in(&self.bounds, ray)?;
        // No hit is reported before the ray is in the box.
        if interval.enter > limit {
            return None;
        }
        let UserHit { t, u, v } = self.shape.as_ref()?.intersect(prim_id, ray)?;
        // Both intervals share a point, so the clamped distance is in the ray's interval if this is.
        (ray.tnear < t && t < ray.tfar).then(|| [interval.clamp(t), u, v])
    }

    fn occludes(&self, prim_id: u32, ray: &RaySetup) -> bool {
        let occluded = |shape: &Arc<dyn UserGeometry>| shape.occluded(prim_id, ray);
        interval_in(&self.bounds, ray).is_some() && self.shape.as_ref().is_some_and(occluded)
    }

    fn normal(&self, ray: &Ray, hit: &Hit) -> Option<[f64; 3]> {
        let Hit {
            t, u, v, prim_id, ..
        } = *hit;
        let shape = self.shape.as_ref()?;
        let normal = shape.normal(prim_id, ray, &UserHit { t, u, v })?;
        Some(normal.map(f64::from))
    }

    fn near(&self, prim_id: u32, place: &Place<'_>) -> Option<Near> {
        let shape = self.shape.as_ref()?;
        let world_from_object = place.affine.map_or(IDENTITY, |affine| affine.rows);
        let mut position = shape.closest_point(prim_id, place.point, &world_from_object)?;
        if !position.iter().all(|x| x.is_finite()) {
            return None;
        }
        // Nothing is nearer than the box, or trees would disagree.
        let Aabb { min, max } = self.bounds;
        let into_box = |at: [f64; 3]| -> [f64; 3] {
            core::array::from_fn(|axis| at[axis].clamp(min[axis].into(), max[axis].into()))
        };
        match place.affine {
            None => position = into_box(position),
            Some(affine) => {
                let inside = affine.inverse()?.point(position);
                let moved = into_box(inside);
                if moved != inside {
                    position = affine.point(moved);
                }
            }
        }
        Some(place.near(position, [0.0; 2]))
    }

    /// Area of the box, which stands for what is in it.
    fn area(&self) -> f64 {
        2.0 * self.sides().iter().sum::<f64>()
    }

    /// A point anywhere on the box.
    fn surface_point(&self, random: &mut Random) -> SurfacePoint {
        let (bounds, sides) = (&self.bounds, self.sides());
        let mut place = random.unit() * sides.iter().sum::<f64>();
        let mut axis = 0;
        while axis < 2 && place >= sides[axis] {
            place -= sides[axis];
            axis += 1;
        }
        let is_high = random.bits() & 1 == 1;
        let mut position: [f64; 3] = core::array::from_fn(|axis| {
            let [low, high] = [bounds.min[axis], bounds.max[axis]].map(f64::from);
            low + random.unit() * (high - low)
        });
        let mut normal = [0.0; 3];
        let (side, sign) = match is_high {
            true => (bounds.max, 1.0),
            false => (bounds.min, -1.0),
        };
        position[axis] = side[axis].into();
        normal[axis] = sign;
        SurfacePoint { position, normal }
    }
}

impl ScalarPrim for UserPrim {
    const NAME: &'static str = "primitives of user geometry";
    const NOTHING: Self = Self {
        shape: None,
        bounds: Aabb::EMPTY,
    };
    const NUMBERS: usize = 0;

    fn count(geometry: &Geometry<'_>) -> usize {
        match geometry {
            Geometry::User { count, .. } => *count as usize,
            _ => 0,
        }
    }

    fn of(geometry: &Geometry<'_>, prim_id: u32) -> Option<Result<Self, DropReason>> {
        match geometry {
            Geometry::User { count, shape } if prim_id < *count => Some(Self::new(shape, prim_id)),
            _ => None,
        }
    }

    fn numbers(&self) -> [f32; 8] {
        [0.0; 8]
    }

    /// Never called: no file has numbers of one.
    fn from_numbers(_: [f32; 8]) -> Result<Self, DropReason> {
        Ok(Self::NOTHING)
    }
}
