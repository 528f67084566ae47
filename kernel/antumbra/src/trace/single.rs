//! One ray after another, each to its end.

use antumbra_simd::{Simd, Width, WithSimd, fresh};

use crate::geometry::primitives::PrimKind;
use crate::geometry::ray_setup::RaySetup;
use crate::ray::Ray;
use crate::trace::judge::Owner;
use crate::trace::pick::Children;
use crate::trace::query::Query;
use crate::trace::ray_batch::RayBatch;
use crate::trace::stack::{Item, Stack};
use crate::trace::step::{NodeTest, leaf_step};
use crate::trace::view::{View, Views};
use crate::tree::node::{Child, ChildKind, Leaf};
use crate::tree::wide::WideTree;

/// Answers `rays` one by one; `answers` is as long.
pub(crate) struct Single<'a, Q: Query, V, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    pub views: V,
    /// The rays with their conditions, for [conditional](Query::CONDITIONAL) queries.
    pub batch: Option<&'a RayBatch<'a>>,
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
                let batch = self.batch.filter(|_| Q::CONDITIONAL);
                let (seen, owner) = ((self.bvh, self.views.of(index)), Owner { batch, index });
                let state = Q::begin(ray);
                let state = traverse::<S, Q, _, N>(simd, seen, setups, stack, state, owner);
                if let Some(batch) = batch {
                    Q::report(&state, batch, index);
                }
                Q::finish(&state)
            } else {
                Q::miss()
            };
        }
    }
}

/// Visits the nodes and leaves that the query wants, until it is done or nothing is left. The ray is given as
/// made ready for the world, and memory for it as made ready for the object of an instance.
#[inline(always)]
fn traverse<S: Simd + Width<N>, Q: Query, V: View, const N: usize>(
    simd: S,
    (bvh, view): (&WideTree<N>, V),
    (world, object): (&RaySetup, &mut Option<RaySetup>),
    mut stack: Stack<'_, Q::Item>,
    mut state: Q::State,
    owner: Owner<'_>,
) -> Q::State {
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
                    let seen = (bvh.tree, view);
                    let changed = leaf_step::<S, Q, V>(&mut state, simd, seen, leaf, ray, owner);
                    Q::prune(&mut state, &mut stack, simd, next, changed);
                    stack.pop().child()
                }
                ChildKind::Instance(_) if next == Child::DONE => return state,
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
        let inst_id = placed.placement.inst_id;
        let enters = !Q::CONDITIONAL || owner.enters(inst_id);
        let entered = match enters {
            true => view.place(simd, bvh, passage, world, object),
            false => None,
        };
        next = match entered {
            Some(interval) => {
                Q::enter(&mut state, inst_id, passage, interval);
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
