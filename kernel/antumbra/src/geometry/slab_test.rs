//! The slab test: in which interval a ray is inside a box. Vectors hold a box per lane, or a ray, or an axis.
//!
//! | | boxes | may be fused | decides |
//! |---|---|---|---|
//! | [`NodeSlabs`] | of nodes | yes | what is visited |
//! | [`plane_distances`] | of instances and spheres | no | at which `t` a hit lies |
//!
//! The margins of both, and why they are enough, are explained in [`crate::geometry::ray_setup`].

use antumbra_simd::{Lanes, Mask, Scalar, Simd, Width};

use crate::aabb::Aabb;
use crate::geometry::ray_setup::RaySetup;

/// A vector of one lane, for code that has one ray and one box.
pub(crate) type One = <Scalar as Width<1>>::Lanes;

/// The lane of a vector of one.
#[inline(always)]
pub(crate) fn value(lanes: One) -> f32 {
    let mut value = [0.0];
    lanes.store(&mut value);
    value[0]
}

/// `org * rdir`, widened by `margin` (a length) so that near planes come nearer, and so that far planes go farther.
/// `steepness` is the magnitude of `rdir`.
#[inline(always)]
pub(crate) fn widened_offsets<const L: usize, V: Lanes<L>>(
    org: V,
    [rdir, steepness]: [V; 2],
    margin: V,
) -> [V; 2] {
    let offset = org * rdir;
    let widening = margin * steepness;
    [offset + widening, offset - widening]
}

/// Planes of node boxes become distances with these: of one ray, or of several that are tested as one.
#[derive(Clone, Copy)]
pub(crate) struct NodeSlabs<V> {
    /// Reciprocal direction for near planes.
    pub near_rdir: [V; 3],
    pub near_offset: [V; 3],
    /// Reciprocal direction for far planes.
    pub far_rdir: [V; 3],
    pub far_offset: [V; 3],
    pub tnear: V,
}

impl<V> NodeSlabs<V> {
    /// The slabs of one ray, in all lanes.
    #[inline(always)]
    pub fn of_ray<S, const L: usize>(simd: S, ray: &RaySetup) -> Self
    where
        S: Simd + Width<L, Lanes = V>,
        V: Lanes<L, Token = S>,
    {
        let [rdir, near_offset, far_offset] = V::splat_rows(simd, &ray.slabs);
        Self {
            near_rdir: rdir,
            near_offset,
            far_rdir: rdir,
            far_offset,
            tnear: V::splat(simd, ray.tnear),
        }
    }

    /// Tests boxes, given as near planes and far planes, up to `tfar`. Returns the lanes hit and the distances at which
    /// their boxes are entered. No box that matters is missed.
    #[inline(always)]
    pub fn test<const L: usize>(&self, near: [V; 3], far: [V; 3], tfar: V) -> (V::Mask, V)
    where
        V: Lanes<L>,
    {
        let (mut enter, mut leave) = (self.tnear, tfar);
        for axis in 0..3 {
            enter = near[axis]
                .mul_sub(self.near_rdir[axis], self.near_offset[axis])
                .max(enter);
            leave = far[axis]
                .mul_sub(self.far_rdir[axis], self.far_offset[axis])
                .min(leave);
        }
        (enter.le(leave), enter)
    }
}

/// The test of node boxes for one box, in plain scalar code.
#[inline(always)]
pub(crate) fn hits_box(ray: &RaySetup, bounds: &Aabb) -> bool {
    let one = |x| One::splat(Scalar, x);
    let [mut near, mut far] = [bounds.min.map(one), bounds.max.map(one)];
    for axis in 0..3 {
        if ray.negative(axis) {
            core::mem::swap(&mut near[axis], &mut far[axis]);
        }
    }
    let slabs = NodeSlabs::of_ray(Scalar, ray);
    slabs.test::<1>(near, far, one(ray.tfar)).0.any()
}

/// Distances at which the near and the far plane of an axis are passed. Which plane is the near one follows from the sign
/// of the direction, and so does which product is the smaller one.
#[inline(always)]
pub(crate) fn plane_distances<const L: usize, V: Lanes<L>>(
    [low, high]: [V; 2],
    rdir: V,
    [near_offset, far_offset]: [V; 2],
) -> [V; 2] {
    let (low, high) = (low * rdir, high * rdir);
    [low.min(high) - near_offset, low.max(high) - far_offset]
}
