//! Rays on their way into an instance and out again.
//!
//! The argument why no tree can change the answers is in [`crate::geometry::ray_setup`].

use antumbra_simd::{Lanes, Simd, Width};

use crate::geometry::instance::Placement;
use crate::geometry::ray_setup::{RaySetup, max};
use crate::geometry::slab_test::plane_distances;
use crate::ray::Ray;

/// The instance interval: the distances at which a ray enters and leaves the box of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    pub enter: f32,
    pub leave: f32,
}

impl Interval {
    /// The interval in the world itself.
    pub const WORLD: Self = Self {
        enter: f32::NEG_INFINITY,
        leave: f32::INFINITY,
    };

    /// The interval in the box of an instance or a sphere, widened; `None` unless it shares a point with the interval of
    /// the ray, which is open. No fused operations: the same bits on every level.
    #[inline(always)]
    pub fn of<S: Simd>(simd: S, world: &RaySetup, [low, high]: &[[f32; 4]; 2]) -> Option<Self> {
        type Vector<S> = <S as Width<4>>::Lanes;
        if !world.culls() {
            return Some(Self::WORLD);
        }
        let rdir = Vector::<S>::load(simd, &world.slabs[0]);
        let planes = [Vector::<S>::load(simd, low), Vector::<S>::load(simd, high)];
        let [enter, leave] = plane_distances(planes, rdir, world.prim_offsets(simd));
        let (mut near, mut far) = ([0.0; 4], [0.0; 4]);
        enter.store(&mut near);
        leave.store(&mut far);
        let enter = max(max(near[0], near[1]), near[2]);
        let leave = -max(max(-far[0], -far[1]), -far[2]);
        let meets = (enter <= leave) & (enter < world.tfar) & (world.tnear < leave);
        meets.then_some(Self { enter, leave })
    }

    /// The distance clamped into the interval; a zero becomes positive.
    #[inline(always)]
    pub fn clamp(&self, t: f32) -> f32 {
        let t = if t < self.enter { self.enter } else { t };
        let t = if t > self.leave { self.leave } else { t };
        t + 0.0
    }
}

impl Placement {
    /// Makes `object` the setup of the ray in the object, and returns the interval of the ray in the box; `None` if it
    /// misses the box, or if the object brings it out of the range of `f32`; then `object` is not to be traced.
    ///
    /// Distances keep their meaning, because the direction keeps its length. The same bits on every level.
    #[inline(always)]
    pub fn enter<S: Simd>(
        &self,
        simd: S,
        world: &RaySetup,
        object: &mut RaySetup,
    ) -> Option<Interval> {
        type Vector<S> = <S as Width<4>>::Lanes;
        let interval = Interval::of(simd, world, &self.planes)?;
        let [x, y, z, moved] = &self.object_from_world;
        let x = Vector::<S>::load(simd, x);
        let y = Vector::<S>::load(simd, y);
        let z = Vector::<S>::load(simd, z);
        let moved = Vector::<S>::load(simd, moved);
        let [ox, oy, oz] = world.org;
        let [dx, dy, dz] = world.dir;
        let org = (x * Vector::<S>::splat(simd, ox) + y * Vector::<S>::splat(simd, oy))
            + (z * Vector::<S>::splat(simd, oz) + moved);
        let dir = (x * Vector::<S>::splat(simd, dx) + y * Vector::<S>::splat(simd, dy))
            + z * Vector::<S>::splat(simd, dz);
        let (mut org_lanes, mut dir_lanes) = ([0.0; 4], [0.0; 4]);
        org.store(&mut org_lanes);
        dir.store(&mut dir_lanes);
        let [ox, oy, oz, _] = org_lanes;
        let [dx, dy, dz, _] = dir_lanes;
        let ray = Ray {
            org: [ox, oy, oz],
            tnear: world.tnear,
            dir: [dx, dy, dz],
            tfar: world.tfar,
        };
        let may_hit = object.set(simd, &ray, self.reach);
        object.inst_id = self.inst_id;
        may_hit.then_some(interval)
    }
}
