//! Occlusion of a ray by anything but one primitive: the one it starts on.

use antumbra_simd::{Simd, Width, WithSimd};

use crate::geometry::BLOCK;
use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::quad::told_id;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::{TriangleBlock, VectorHits};
use crate::prim_id::PrimId;
use crate::ray::Ray;
use crate::trace::query::{Occlusion, Query};
use crate::trace::single::traverse;
use crate::trace::stack::Stack;
use crate::trace::step::{NodeLanes, NodeMask};
use crate::tree::node::{Child, Leaf, Node};
use crate::tree::wide::WideTree;

/// Whether anything but a primitive occludes a ray.
pub(crate) struct Except<'a, const N: usize> {
    pub bvh: &'a WideTree<N>,
    /// Memory of a stack for this tree.
    pub stack: &'a mut [u32],
    pub ray: &'a Ray,
    pub excluded: PrimId,
}

impl<const N: usize> WithSimd<N> for Except<'_, N> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> bool {
        let mut setup = RaySetup::IDLE;
        let mut object = RaySetup::IDLE;
        setup.set(simd, self.ray, self.bvh.reach) && {
            let stack = Stack::new(self.stack, 0);
            let state = Known {
                excluded: self.excluded,
                occluded: false,
            };
            let setups = (&setup, &mut object);
            traverse::<S, N, OcclusionExcept>(simd, self.bvh, setups, stack, state)
        }
    }
}

/// [`Occlusion`] by anything but one primitive.
struct OcclusionExcept;

/// Knowledge of a ray on its way.
#[derive(Clone, Copy)]
struct Known {
    excluded: PrimId,
    occluded: bool,
}

impl Known {
    /// Whether the primitive of a lane is the excluded one, in the space of this ray.
    #[inline(always)]
    fn excludes(&self, ray: &RaySetup, geom_id: u32, prim_id: u32) -> bool {
        let inst_id = ray.inst_id;
        let prim_id = told_id(prim_id);
        self.excluded
            == PrimId {
                inst_id,
                geom_id,
                prim_id,
            }
    }

    /// The lanes of a block that hold the excluded primitive, as bits.
    #[inline(always)]
    fn lanes(&self, ray: &RaySetup, block: &TriangleBlock) -> u32 {
        let mut lanes = 0;
        for lane in 0..BLOCK {
            let is_it = self.excludes(ray, block.geom_ids[lane], block.prim_ids[lane]);
            lanes |= u32::from(is_it) << lane;
        }
        lanes
    }

    /// Whether a leaf has an occluder.
    #[inline(always)]
    fn leaf<S: Simd, const N: usize>(
        &self,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) -> bool {
        match leaf {
            Leaf::Triangles(index) => {
                let block = &bvh.triangle_blocks[index];
                let lanes = block.occluders::<S, false>(simd, ray);
                lanes != 0 && lanes & !self.lanes(ray, block) != 0
            }
            Leaf::Spheres(index) => {
                let block = &bvh.sphere_blocks[index];
                (0..block.count).any(|lane| {
                    let id = block.refs[lane];
                    !self.excludes(ray, id.geom_id, id.prim_id) && block.hit(lane, ray).is_some()
                })
            }
            Leaf::Users(index) => {
                let mut prims = bvh.user_blocks[index].prims();
                prims.any(|(prim, id)| {
                    !self.excludes(ray, id.geom_id, id.prim_id) && prim.occludes(id, ray)
                })
            }
            Leaf::Cutouts(index) => {
                let block = &bvh.cutout_blocks[index];
                let left_out = self.lanes(ray, &block.triangles);
                block.occluded_but(simd, ray, &bvh.filters, left_out)
            }
        }
    }
}

impl Query for OcclusionExcept {
    type Item = u32;
    type State = Known;
    type Answer = bool;

    const IDLE: Known = Known {
        excluded: PrimId::NONE,
        occluded: false,
    };

    #[inline(always)]
    fn finish(known: &Known) -> bool {
        known.occluded
    }

    #[inline(always)]
    fn push<S: Simd + Width<N>, const N: usize>(
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) {
        Occlusion::push::<S, N>(stack, node, mask, entry);
    }

    #[inline(always)]
    fn push_pop<S: Simd + Width<N>, const N: usize>(
        stack: &mut Stack<'_, u32>,
        node: &Node<N>,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) -> Child {
        Occlusion::push_pop::<S, N>(stack, node, mask, entry)
    }

    #[inline(always)]
    fn leaf<S: Simd, const N: usize, const STREAM: bool>(
        known: &mut Known,
        stack: &mut Stack<'_, u32>,
        simd: S,
        bvh: &WideTree<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        known.occluded = known.leaf::<S, N>(simd, bvh, leaf, ray);
        stack.clear_if(known.occluded);
    }

    #[inline(always)]
    fn cutout_hits<S: Simd>(
        _: &Known,
        simd: S,
        block: &CutoutBlock,
        ray: &RaySetup,
    ) -> VectorHits<S> {
        Occlusion::cutout_hits(&false, simd, block, ray)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        known: &mut Known,
        stack: &mut Stack<'_, u32>,
        simd: S,
        hit: &CutoutHit<'_>,
        ray: &RaySetup,
        filters: &Filters,
    ) {
        let (triangles, lane) = (&hit.block.triangles, hit.lane);
        if !known.excludes(ray, triangles.geom_ids[lane], triangles.prim_ids[lane]) {
            Occlusion::settle(&mut known.occluded, stack, simd, hit, ray, filters);
        }
    }
}
