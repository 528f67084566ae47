//! What is at an index for a ray: boxes, triangles and instances as they are, or as they are at the time of the ray.
//!
//! Traversals and queries see a tree through a view and know nothing of time. [`Still`] takes no room and no instruction.

use core::ops::Deref;

use antumbra_simd::{Lanes, Simd, Width};

use crate::geometry::instance::Placement;
use crate::geometry::instance_ray::Interval;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::TriangleBlock;
use crate::trace::step::{NodeLanes, NodeMask, NodeTest};
use crate::tree::motion::{Motion, planes_at};
use crate::tree::wide::{Tree, WideTree};

/// Runs the same code on the block of a leaf, of whatever kind, as a ray sees it.
macro_rules! on_seen_leaf {
    ($simd:expr, $bvh:expr, $view:expr, $leaf:expr, $block:ident => $body:expr) => {
        if $leaf.kind == $crate::geometry::primitives::PrimKind::Triangle {
            let $block = &*$view.triangles($simd, $bvh, $leaf.index);
            $body
        } else {
            $crate::tree::leaves::on_leaf!($bvh, $leaf, $block => $body)
        }
    };
}
pub(crate) use on_seen_leaf;

/// Runs the same code for a ray that sees a tree as it is, or at a share of its span.
macro_rules! on_view {
    ($share:expr, $view:ident => $body:expr) => {
        match $share {
            None => {
                let $view = $crate::trace::view::Still;
                $body
            }
            Some(share) => {
                let $view = $crate::trace::view::At(share);
                $body
            }
        }
    };
}
pub(crate) use on_view;

/// How one ray sees a tree.
pub(crate) trait View: Copy {
    /// Tests the boxes of a node.
    fn step<S: Simd + Width<N>, const N: usize>(
        self,
        simd: S,
        bvh: &WideTree<'_, N>,
        index: usize,
        test: &NodeTest<S, N>,
        limit: f32,
    ) -> (NodeMask<S, N>, NodeLanes<S, N>);

    /// Prefetches a node.
    fn prefetch<S: Simd, const N: usize>(simd: S, bvh: &WideTree<'_, N>, index: usize);

    /// A block of triangles.
    fn triangles<S: Simd>(
        self,
        simd: S,
        tree: &Tree,
        index: usize,
    ) -> impl Deref<Target = TriangleBlock>;

    /// Makes `object` the ray in the object of instance `index`, unless the ray misses its box.
    fn place<S: Simd>(
        self,
        simd: S,
        tree: &Tree,
        index: usize,
        world: &RaySetup,
        object: &mut RaySetup,
    ) -> Option<Interval>;

    /// The placement of instance `index`, and its transform.
    fn placed(self, tree: &Tree, index: usize) -> Option<(Placement, [[f32; 4]; 3])>;
}

/// How the rays of a list see a tree.
pub(crate) trait Views: Copy {
    type View: View;

    /// How the ray at this place sees it.
    fn of(self, index: usize) -> Self::View;
}

/// All see it in the same way.
impl<V: View> Views for V {
    type View = V;

    #[inline(always)]
    fn of(self, _: usize) -> V {
        self
    }
}

/// The tree as it is. A tree that moves is then at its start.
#[derive(Clone, Copy)]
pub(crate) struct Still;

impl View for Still {
    #[inline(always)]
    fn step<S: Simd + Width<N>, const N: usize>(
        self,
        simd: S,
        bvh: &WideTree<'_, N>,
        index: usize,
        test: &NodeTest<S, N>,
        limit: f32,
    ) -> (NodeMask<S, N>, NodeLanes<S, N>) {
        test.step(simd, &bvh.nodes[index].planes, limit)
    }

    #[inline(always)]
    fn prefetch<S: Simd, const N: usize>(simd: S, bvh: &WideTree<'_, N>, index: usize) {
        // No check: nothing is read.
        simd.prefetch_at(bvh.nodes.as_ptr().wrapping_add(index));
    }

    #[inline(always)]
    fn triangles<S: Simd>(
        self,
        _: S,
        tree: &Tree,
        index: usize,
    ) -> impl Deref<Target = TriangleBlock> {
        &tree.blocks.triangles[index]
    }

    #[inline(always)]
    fn place<S: Simd>(
        self,
        simd: S,
        tree: &Tree,
        index: usize,
        world: &RaySetup,
        object: &mut RaySetup,
    ) -> Option<Interval> {
        tree.instances[index].placement.enter(simd, world, object)
    }

    fn placed(self, tree: &Tree, index: usize) -> Option<(Placement, [[f32; 4]; 3])> {
        let placed = &tree.instances[index];
        Some((placed.placement, placed.world_from_object))
    }
}

/// The tree at a share of its span, see [`crate::tree::motion`].
#[derive(Clone, Copy)]
pub(crate) struct At(pub f32);

/// A tree seen by each ray at its own share of the span.
#[derive(Clone, Copy)]
pub(crate) struct Shares<'a>(pub &'a [f32]);

impl Views for Shares<'_> {
    type View = At;

    #[inline(always)]
    fn of(self, index: usize) -> At {
        At(self.0[index])
    }
}

/// A block where it lies, or where it has moved to.
#[expect(
    clippy::large_enum_variant,
    reason = "it lies on the stack while a leaf is tested, and a box would need memory"
)]
enum Block<'a> {
    Here(&'a TriangleBlock),
    Moved(TriangleBlock),
}

impl Deref for Block<'_> {
    type Target = TriangleBlock;

    #[inline(always)]
    fn deref(&self) -> &TriangleBlock {
        match self {
            Self::Here(block) => block,
            Self::Moved(block) => block,
        }
    }
}

#[inline(always)]
fn motion(bvh: &Tree) -> Option<&Motion> {
    bvh.motion.as_deref()
}

impl View for At {
    #[inline(always)]
    fn step<S: Simd + Width<N>, const N: usize>(
        self,
        simd: S,
        bvh: &WideTree<'_, N>,
        index: usize,
        test: &NodeTest<S, N>,
        limit: f32,
    ) -> (NodeMask<S, N>, NodeLanes<S, N>) {
        let node = &bvh.nodes[index];
        let Some(moves) = bvh.moves.get(index) else {
            return test.step(simd, &node.planes, limit);
        };
        let share = NodeLanes::<S, N>::splat(simd, self.0);
        test.step_at(simd, limit, |axis, side| {
            planes_at(simd, [node, moves], (axis, side), share)
        })
    }

    #[inline(always)]
    fn prefetch<S: Simd, const N: usize>(simd: S, bvh: &WideTree<'_, N>, index: usize) {
        Still::prefetch(simd, bvh, index);
        simd.prefetch_at(bvh.moves.as_ptr().wrapping_add(index));
    }

    #[inline(always)]
    fn triangles<S: Simd>(
        self,
        simd: S,
        tree: &Tree,
        index: usize,
    ) -> impl Deref<Target = TriangleBlock> {
        let block = &tree.blocks.triangles[index];
        match motion(tree).and_then(|motion| motion.blocks.get(index)) {
            Some(end) => Block::Moved(block.between(simd, end, self.0)),
            None => Block::Here(block),
        }
    }

    #[inline(always)]
    fn place<S: Simd>(
        self,
        simd: S,
        tree: &Tree,
        index: usize,
        world: &RaySetup,
        object: &mut RaySetup,
    ) -> Option<Interval> {
        match &motion(tree)?.placements[index] {
            None => Still.place(simd, tree, index, world, object),
            Some(placement) => {
                let planes = placement.planes(self.0);
                // The box first: a transform takes as long as many nodes.
                Interval::of(simd, world, &planes)?;
                let (placement, _) = placement.at(self.0, planes)?;
                placement.enter(simd, world, object)
            }
        }
    }

    fn placed(self, tree: &Tree, index: usize) -> Option<(Placement, [[f32; 4]; 3])> {
        match &motion(tree)?.placements[index] {
            None => Still.placed(tree, index),
            Some(placement) => placement.at(self.0, placement.planes(self.0)),
        }
    }
}
