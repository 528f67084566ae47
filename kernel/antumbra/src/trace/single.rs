//! One ray after another, each to its end.

use antumbra_simd::{Simd, Width, WithSimd, fresh};

use crate::geometry::primitives::PrimKind;
use crate::geometry::ray_setup::RaySetup;
use crate::ray::Ray;
use crate::trace::pick::Children;
use crate::trace::query::Query;
use crate::trace::stack::{Item, Stack};
use crate::trace::step::NodeTest;
use crate::trace::view::{View, Views};
use crate::tree::node::{Child, ChildKind, Leaf};
use crate::tree::wide::WideTree;

/// Answers `rays` one by one; `answers` is as long.
pub(crate) struct Single<'a, Q: Query, V, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    pub views: V,
    /// Memory of a stack for this tree.
    pub stack: &'a mut [Q::Item],
    pub rays: &'a [Ray],
    pub answers: &'a mut [Q::Answer],
}

impl<Q: Query, V: Views, const N: usize> WithSimd<N> for Single<'_, Q, V, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let mut setup = RaySetup::IDLE;
        // Made when an instance is entered: most calls are of one ray that enters none.
        let mut object_setup = None;
        for (index, (ray, answer)) in self.rays.iter().zip(self.answers).enumerate() {
            // Made in place: a copy would wait for the narrow stores it was made by.
            *answer = if setup.set(simd, ray, self.bvh.reach) {
                let stack = Stack::new(self.stack, 0);
                let setups = (&setup, &mut object_setup);
                let view = self.views.of(index);
                traverse::<S, N, Q, _>(simd, self.bvh, view, setups, stack, Q::begin(ray))
            } else {
                Q::miss()
            };
        }
    }
}

/// Visits the nodes and leaves that the query wants, until it is done or nothing is left. The ray is given as
/// made ready for the world, and memory for it as made ready for the object of an instance.
#[inline(always)]
pub(super) fn traverse<S: Simd + Width<N>, const N: usize, Q: Query, V: View>(
    simd: S,
    bvh: &WideTree<N>,
    view: V,
    (world, object): (&RaySetup, &mut Option<RaySetup>),
    mut stack: Stack<'_, Q::Item>,
    mut state: Q::State,
) -> Q::Answer {
    let mut ray = world;
    let mut next = Child::ROOT;
    // Once for every tree that the ray comes to, and for the world again and again between them.
    loop {
        let passage = loop {
            next = match next.kind() {
                ChildKind::Inner(index) => {
                    let node = &bvh.nodes[index];
                    let limit = Q::limit(&state, ray);
                    // Computed again for every node: kept, its vectors would be spilled around every leaf.
                    let test = NodeTest::<S, N>::new(simd, fresh(ray));
                    let (mask, entry) = view.step(simd, bvh, index, &test, limit);
                    let next = Q::Item::push_pop(&mut stack, node, mask, entry);
                    // What comes after it is likely to be visited too: 5 % on sponza.
                    if let Some(item) = stack.peek() {
                        prefetch_leaf(simd, bvh, item.child());
                    }
                    next
                }
                ChildKind::Leaf(leaf) => {
                    Q::leaf(&mut state, &mut stack, simd, bvh, view, leaf, ray);
                    stack.pop().child()
                }
                ChildKind::Instance(_) if next == Child::DONE => return Q::finish(&state),
                ChildKind::Instance(index) => break index,
            };
        };
        // Unless it is in an object from here on.
        ray = world;
        if next == Child::EXIT {
            Q::exit(&mut state);
            next = stack.pop().child();
            continue;
        }
        let placed = &bvh.instances[passage];
        let object = object.get_or_insert(RaySetup::IDLE);
        let entered = match Q::enters(&state, placed.placement.inst_id) {
            true => view.place(simd, bvh, passage, world, object),
            false => None,
        };
        next = match entered {
            Some(interval) => {
                Q::enter(&mut state, bvh, passage, interval);
                stack.push(Q::Item::unordered(Child::EXIT));
                ray = &*object;
                Child(placed.root)
            }
            None => stack.pop().child(),
        };
    }
}

/// Prefetches a leaf of triangles or cut-outs, and nothing else. (Streams, which know that a child is a leaf, have
/// [`crate::trace::leaf_places`].)
#[inline(always)]
pub(super) fn prefetch_leaf<S: Simd, const N: usize>(simd: S, bvh: &WideTree<N>, child: Child) {
    let ChildKind::Leaf(Leaf { kind, index }) = child.kind() else {
        return;
    };
    let blocks = &bvh.blocks;
    if kind == PrimKind::Triangle
        && let Some(block) = blocks.triangles.get(index)
    {
        simd.prefetch(&block.corners);
    } else if kind == PrimKind::Cutout
        && let Some(block) = blocks.cutouts.get(index)
    {
        simd.prefetch(&block.triangles.corners);
        simd.prefetch(&block.maps);
    }
}
