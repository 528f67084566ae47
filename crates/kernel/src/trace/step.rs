//! One node step and one leaf step: everything that traversals are made of.

use antumbra_simd::{Lanes, Simd, Width};

use super::observe::Observer;
use super::setup::RaySetup;
use crate::bvh::Bvh;
use crate::node::{Leaf, Node};
use crate::ray::Hit;

/// A vector as wide as a node.
pub(crate) type NodeLanes<S, const N: usize> = <S as Width<N>>::Lanes;
/// A mask as wide as a node.
pub(crate) type NodeMask<S, const N: usize> = <NodeLanes<S, N> as Lanes<N>>::Mask;

/// Tests the N boxes of a node against the ray up to `tfar`. Returns the lanes hit and the distances at
/// which they are entered. Conservative: see [`super::setup`].
#[inline(always)]
pub(crate) fn node_step<S, const N: usize>(
    simd: S,
    node: &Node<N>,
    ray: &RaySetup,
    tfar: f32,
) -> (NodeMask<S, N>, NodeLanes<S, N>)
where
    S: Simd + Width<N>,
{
    let mut enter = NodeLanes::<S, N>::splat(simd, ray.tnear);
    let mut leave = NodeLanes::<S, N>::splat(simd, tfar);
    for axis in 0..3 {
        let side = usize::from(ray.negative[axis]);
        let near = NodeLanes::<S, N>::load(simd, &node.planes[axis][side]);
        let far = NodeLanes::<S, N>::load(simd, &node.planes[axis][side ^ 1]);
        let rdir = NodeLanes::<S, N>::splat(simd, ray.rdir[axis]);
        let near_offset = NodeLanes::<S, N>::splat(simd, ray.near_offset[axis]);
        let far_offset = NodeLanes::<S, N>::splat(simd, ray.far_offset[axis]);
        enter = near.mul_sub(rdir, near_offset).max(enter);
        leave = far.mul_sub(rdir, far_offset).min(leave);
    }
    (enter.le(leave), enter)
}

/// Tests the primitives of a leaf; whether one of them occludes the ray.
#[inline(always)]
pub(crate) fn leaf_occluded<S: Simd, const N: usize, const WAVE: bool>(
    simd: S,
    bvh: &Bvh<N>,
    leaf: Leaf,
    ray: &RaySetup,
    observer: &mut impl Observer,
) -> bool {
    let (prims, lane) = match leaf {
        Leaf::Triangles(index) => {
            let block = &bvh.triangle_blocks[index];
            let prims = if observer.counts_prims() {
                block.count()
            } else {
                0
            };
            (prims, block.occluded::<S, WAVE>(simd, ray))
        }
        Leaf::Spheres(index) => {
            let block = &bvh.sphere_blocks[index];
            (block.count, block.occluded(ray))
        }
    };
    let leaf = bvh.leaf_index(leaf);
    observer.leaf(leaf, prims);
    if let Some(lane) = lane {
        observer.occluder(leaf, lane);
    }
    lane.is_some()
}

/// Replaces `best` by the leaf's closest hit where that precedes it.
#[inline(always)]
pub(crate) fn leaf_intersect<S: Simd, const N: usize>(
    simd: S,
    bvh: &Bvh<N>,
    leaf: Leaf,
    ray: &RaySetup,
    best: &mut Hit,
) {
    match leaf {
        Leaf::Triangles(index) => bvh.triangle_blocks[index].intersect(simd, ray, best),
        Leaf::Spheres(index) => bvh.sphere_blocks[index].intersect(ray, best),
    }
}
