//! One node step and one leaf step: everything that traversals are made of.

use antumbra_simd::{Lanes, Scalar, Simd, Width};

use crate::geometry::best::Best;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;
use crate::geometry::ray_setup::{RaySetup, Side};
use crate::geometry::slab_test::NodeSlabs;
use crate::trace::view::{View, on_seen_leaf};
use crate::tree::leaves::on_leaf;
use crate::tree::node::Leaf;
use crate::tree::wide::WideTree;

/// A vector as wide as a node.
pub(crate) type NodeLanes<S, const N: usize> = <S as Width<N>>::Lanes;
/// A mask as wide as a node.
pub(crate) type NodeMask<S, const N: usize> = <NodeLanes<S, N> as Lanes<N>>::Mask;

/// The test of all boxes of a node, made ready for a ray or for a frustum around several. A ray makes it for every step,
/// which costs nothing but the loads; packets make it once.
#[derive(Clone, Copy)]
pub(crate) struct NodeTest<S: Width<N>, const N: usize> {
    pub slabs: NodeSlabs<S::Lanes>,
    /// Near plane of each axis.
    pub near: [Side; 4],
}

impl<S: Simd + Width<N>, const N: usize> NodeTest<S, N> {
    #[inline(always)]
    pub fn new(simd: S, ray: &RaySetup) -> Self {
        Self {
            slabs: NodeSlabs::of_ray(simd, ray),
            near: ray.near,
        }
    }

    /// Tests N boxes given as planes, `[axis][side][lane]`, up to `tfar`. Returns the lanes hit and the distances at
    /// which their boxes are entered. Conservative: see [`crate::geometry::ray_setup`].
    #[inline(always)]
    pub fn step(
        &self,
        simd: S,
        planes: &[[[f32; N]; 2]; 3],
        tfar: f32,
    ) -> (NodeMask<S, N>, NodeLanes<S, N>) {
        self.step_at(simd, tfar, |axis, side| {
            // A side is 0 or 1, but that is not known here: spares six checks.
            NodeLanes::<S, N>::load(simd, &planes[axis][side & 1])
        })
    }

    /// [`NodeTest::step`] for boxes of which `at` gives the planes, by axis and side.
    #[inline(always)]
    pub fn step_at(
        &self,
        simd: S,
        tfar: f32,
        at: impl Fn(usize, usize) -> NodeLanes<S, N>,
    ) -> (NodeMask<S, N>, NodeLanes<S, N>) {
        let [x, y, z] = [self.near[0], self.near[1], self.near[2]].map(|side| side as usize);
        let near = [at(0, x), at(1, y), at(2, z)];
        let far = [at(0, x ^ 1), at(1, y ^ 1), at(2, z ^ 1)];
        let tfar = NodeLanes::<S, N>::splat(simd, tfar);
        self.slabs.test::<N>(near, far, tfar)
    }
}

/// Tests the primitives of a leaf: the first lane found that occludes the ray.
#[inline(always)]
pub(crate) fn leaf_occluder<S: Simd, V: View, const N: usize>(
    simd: S,
    bvh: &WideTree<N>,
    view: V,
    leaf: Leaf,
    ray: &RaySetup,
) -> Option<usize> {
    let Leaf { kind, index } = leaf;
    match kind {
        PrimKind::Triangle => {
            view.triangles(simd, bvh, index)
                .occluded::<S>(simd, ray, &bvh.filters)
        }
        PrimKind::Cutout => bvh.blocks.cutouts[index].occluded::<S>(simd, ray, &bvh.filters),
        PrimKind::Curve => bvh.blocks.curves[index].occluded::<S>(simd, ray, &bvh.filters),
        _ => scalar_occluder(bvh, leaf, ray),
    }
}

/// [`leaf_occluder`] without vectors. Away from the loops, which need their registers for triangles: 2 % of the
/// instructions of occlusion in batches (AVX2).
#[cold]
#[inline(never)]
pub(crate) fn scalar_occluder<const N: usize>(
    bvh: &WideTree<N>,
    leaf: Leaf,
    ray: &RaySetup,
) -> Option<usize> {
    on_leaf!(bvh, leaf, block => block.occluded::<Scalar>(Scalar, ray, &bvh.filters))
}

/// Replaces `best` by the leaf's closest hit where that precedes it, and returns whether it did.
#[inline(always)]
pub(crate) fn leaf_intersect<S: Simd, V: View, const N: usize>(
    simd: S,
    bvh: &WideTree<N>,
    view: V,
    leaf: Leaf,
    ray: &RaySetup,
    best: &mut Best,
) -> bool {
    on_seen_leaf!(simd, bvh, view, leaf, block => block.intersect(simd, ray, &bvh.filters, best))
}
