//! One node step and one leaf step: everything that traversals are made of.

use antumbra_simd::{Lanes, Simd, Width};

use crate::geometry::best::Best;
use crate::geometry::ray_setup::{RaySetup, Side};
use crate::tree::node::{Leaf, Node};
use crate::tree::wide::Bvh;

/// A vector as wide as a node.
pub(crate) type NodeLanes<S, const N: usize> = <S as Width<N>>::Lanes;
/// A mask as wide as a node.
pub(crate) type NodeMask<S, const N: usize> = <NodeLanes<S, N> as Lanes<N>>::Mask;

/// What a node step needs of a ray, one copy per lane. A lone ray makes it once and keeps it in registers; in
/// a wave it is made for every step, which costs nothing but the loads.
#[derive(Clone, Copy)]
pub(crate) struct NodeRay<S: Width<N>, const N: usize> {
    rdir: [S::Lanes; 3],
    near_offset: [S::Lanes; 3],
    far_offset: [S::Lanes; 3],
    tnear: S::Lanes,
    /// Which plane of an axis is the near one.
    near: [Side; 4],
}

impl<S: Simd + Width<N>, const N: usize> NodeRay<S, N> {
    #[inline(always)]
    pub fn new(simd: S, ray: &RaySetup) -> Self {
        let [rdir, near_offset, far_offset] = NodeLanes::<S, N>::splat_rows(simd, &ray.slabs);
        Self {
            rdir,
            near_offset,
            far_offset,
            tnear: NodeLanes::<S, N>::splat(simd, ray.tnear),
            near: ray.near,
        }
    }

    /// Tests the N boxes of a node against the ray up to `tfar`. Returns the lanes hit and the distances at
    /// which they are entered. Conservative: see [`crate::geometry::ray_setup`].
    #[inline(always)]
    pub fn step(&self, simd: S, node: &Node<N>, tfar: f32) -> (NodeMask<S, N>, NodeLanes<S, N>) {
        let mut enter = self.tnear;
        let mut leave = NodeLanes::<S, N>::splat(simd, tfar);
        for axis in 0..3 {
            let planes = &node.planes[axis];
            let side = self.near[axis] as usize;
            let near = NodeLanes::<S, N>::load(simd, &planes[side]);
            let far = NodeLanes::<S, N>::load(simd, &planes[side ^ 1]);
            enter = near
                .mul_sub(self.rdir[axis], self.near_offset[axis])
                .max(enter);
            leave = far
                .mul_sub(self.rdir[axis], self.far_offset[axis])
                .min(leave);
        }
        (enter.le(leave), enter)
    }
}

/// Tests the primitives of a leaf: the first lane found that occludes the ray.
#[inline(always)]
pub(crate) fn leaf_occluder<S: Simd, const N: usize, const STREAM: bool>(
    simd: S,
    bvh: &Bvh<N>,
    leaf: Leaf,
    ray: &RaySetup,
) -> Option<usize> {
    match leaf {
        Leaf::Triangles(index) => bvh.triangle_blocks[index].occluded::<S, STREAM>(simd, ray),
        Leaf::Spheres(index) => bvh.sphere_blocks[index].occluded(ray),
        Leaf::Cutouts(index) => {
            bvh.cutout_blocks[index].occluded::<S, STREAM>(simd, ray, &bvh.filters)
        }
    }
}

/// Replaces `best` by the leaf's closest hit where that precedes it, and returns whether it did.
#[inline(always)]
pub(crate) fn leaf_intersect<S: Simd, const N: usize, const STREAM: bool>(
    simd: S,
    bvh: &Bvh<N>,
    leaf: Leaf,
    ray: &RaySetup,
    best: &mut Best,
) -> bool {
    match leaf {
        Leaf::Triangles(index) => {
            bvh.triangle_blocks[index].intersect::<S, STREAM>(simd, ray, best)
        }
        Leaf::Spheres(index) => bvh.sphere_blocks[index].intersect(ray, best),
        Leaf::Cutouts(index) => {
            bvh.cutout_blocks[index].intersect::<S, STREAM>(simd, ray, &bvh.filters, best)
        }
    }
}
