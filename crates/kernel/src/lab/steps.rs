//! Single steps of a traversal, many at once, for benches: **not part of the stable interface**.
//!
//! A traversal consists of three kinds of steps: a ray is set up, a node is tested, a leaf is tested. [`Steps`]
//! writes down which nodes and leaves some rays visit and then repeats the steps of one kind for all of them,
//! so that the cost of one step is the cost of the call divided by their number. They are the steps of a ray
//! stream: the ray comes from memory, and leaves are tested without hurry.
//!
//! The steps do not depend on each other, and every call repeats the same ones, which teaches the CPU its
//! branches: what is measured is their throughput, not how long a lone ray waits for one.

use alloc::vec;
use alloc::vec::Vec;

use antumbra_simd::{Dispatch, Simd, Width, WithSimd};

use crate::api::bvh::Bvh;
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::slab_test::hits_box;
use crate::ray::{Hit, Ray};
use crate::trace::memory::{Memory, Stored};
use crate::trace::pick::Children;
use crate::trace::query::{Closest, Occlusion, StreamQuery};
use crate::trace::stack::{Stack, stack_size};
use crate::trace::step::NodeTest;
use crate::tree::any::on_tree;
use crate::tree::node::{Child, ChildKind};
use crate::tree::wide::WideTree;

/// The stacks of successive steps begin at so many different places in turn: whether a push crosses a cache
/// line costs time, and must not depend on where the memory happens to lie.
const PLACES: usize = 16;

/// A ray, by its index, at a node or leaf.
#[derive(Clone, Copy, Debug)]
struct Visit {
    ray: u32,
    child: Child,
}

/// Some rays, and every node and leaf of a tree that they meet.
#[derive(Debug)]
pub struct Steps<'a> {
    bvh: &'a Bvh,
    rays: Vec<Ray>,
    /// As long as `rays`.
    setups: Vec<RaySetup>,
    at_nodes: Vec<Visit>,
    at_leaves: Vec<Visit>,
    memory: Memory,
    /// Answers of the leaf steps, as many as `at_leaves`.
    occluded: Vec<bool>,
    hits: Vec<Option<Hit>>,
}

impl<'a> Steps<'a> {
    /// Follows `rays` to their ends, whatever they hit on the way. Rays that cannot hit anything are left out
    /// (see [`Ray`]). The steps are the same for every instruction set.
    pub fn new(bvh: &'a Bvh, rays: &[Ray]) -> Self {
        let reach = on_tree!(&bvh.tree, tree => tree.reach);
        let mut steps = Self {
            bvh,
            rays: Vec::new(),
            setups: Vec::new(),
            at_nodes: Vec::new(),
            at_leaves: Vec::new(),
            memory: Memory::default(),
            occluded: Vec::new(),
            hits: Vec::new(),
        };
        for ray in rays {
            if let Some(setup) = RaySetup::new(ray, reach) {
                on_tree!(&bvh.tree, tree => steps.follow(tree, &setup));
                steps.rays.push(*ray);
                steps.setups.push(setup);
            }
        }
        steps.occluded = vec![false; steps.leaves()];
        steps.hits = vec![None; steps.leaves()];
        steps
    }

    /// Adds the visits of the next ray.
    fn follow<const N: usize>(&mut self, tree: &WideTree<N>, setup: &RaySetup) {
        let ray = self.rays.len() as u32;
        let mut pending = vec![Child::ROOT];
        while let Some(child) = pending.pop() {
            let visit = Visit { ray, child };
            match child.kind() {
                ChildKind::Leaf(_) => self.at_leaves.push(visit),
                // Steps into instances are not among those measured.
                ChildKind::Instance(_) => {}
                ChildKind::Inner(index) => {
                    self.at_nodes.push(visit);
                    let node = &tree.nodes[index];
                    let node = node.any();
                    for slot in (0..node.len()).rev() {
                        if hits_box(setup, &node.bounds(slot)) {
                            pending.push(node.child(slot));
                        }
                    }
                }
            }
        }
    }

    /// Number of rays that [`Steps::set_up`] sets up.
    pub fn rays(&self) -> usize {
        self.rays.len()
    }

    /// Number of nodes that the node steps test, each for one ray.
    pub fn nodes(&self) -> usize {
        self.at_nodes.len()
    }

    /// Number of leaves that the leaf steps test, each for one ray.
    pub fn leaves(&self) -> usize {
        self.at_leaves.len()
    }

    /// Sets up every ray. Returns how many can hit something: all of them.
    pub fn set_up(&mut self) -> usize {
        let (rays, setups) = (&self.rays[..], &mut self.setups[..]);
        on_tree!(&self.bvh.tree, bvh => self.bvh.isa().dispatch(SetUp { bvh, rays, setups }))
    }

    /// Node steps of an occlusion query: the test, and the push in the order of slots. Returns how many
    /// children were pushed: as many as there are visits below the root, give or take boxes that are touched.
    pub fn nodes_occluded(&mut self) -> usize {
        self.nodes_of::<Occlusion>()
    }

    /// Node steps of a closest-hit query that has found nothing yet: pushed nearest first.
    pub fn nodes_intersect(&mut self) -> usize {
        self.nodes_of::<Closest>()
    }

    /// Leaf steps of an occlusion query. Returns how many leaves occlude their rays.
    pub fn leaves_occluded(&mut self) -> usize {
        let (rays, setups, visits) = (&self.rays[..], &self.setups[..], &self.at_leaves[..]);
        let answers = &mut self.occluded[..];
        on_tree!(&self.bvh.tree, bvh => {
            let items = stacks(&mut self.memory, bvh);
            let steps = LeafSteps::<Occlusion, _> { bvh, items, rays, setups, visits, answers };
            self.bvh.isa().dispatch(steps);
        });
        self.occluded.iter().filter(|occluded| **occluded).count()
    }

    /// Leaf steps of a closest-hit query that has found nothing yet. Returns how many leaves are hit: as many
    /// as occlude.
    pub fn leaves_intersect(&mut self) -> usize {
        let (rays, setups, visits) = (&self.rays[..], &self.setups[..], &self.at_leaves[..]);
        let answers = &mut self.hits[..];
        on_tree!(&self.bvh.tree, bvh => {
            let items = stacks(&mut self.memory, bvh);
            let steps = LeafSteps::<Closest, _> { bvh, items, rays, setups, visits, answers };
            self.bvh.isa().dispatch(steps);
        });
        self.hits.iter().flatten().count()
    }

    fn nodes_of<Q: StreamQuery<Item: Stored>>(&mut self) -> usize {
        let (rays, setups, visits) = (&self.rays[..], &self.setups[..], &self.at_nodes[..]);
        on_tree!(&self.bvh.tree, bvh => {
            let items = stacks(&mut self.memory, bvh);
            self.bvh.isa().dispatch(NodeSteps::<Q, _> { bvh, items, rays, setups, visits })
        })
    }
}

/// Room for a stack at each of the [`PLACES`].
fn stacks<'a, T: Stored, const N: usize>(memory: &'a mut Memory, bvh: &WideTree<N>) -> &'a mut [T] {
    T::at_least(memory, stack_size(N, bvh.depth) + PLACES)
}

struct SetUp<'a, const N: usize> {
    bvh: &'a WideTree<'a, N>,
    rays: &'a [Ray],
    setups: &'a mut [RaySetup],
}

impl<const N: usize> WithSimd<N> for SetUp<'_, N> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> usize {
        let mut usable = 0;
        for (ray, setup) in self.rays.iter().zip(self.setups) {
            usable += usize::from(setup.set(simd, ray, self.bvh.reach));
        }
        usable
    }
}

struct NodeSteps<'a, Q: StreamQuery, const N: usize> {
    bvh: &'a WideTree<'a, N>,
    items: &'a mut [Q::Item],
    rays: &'a [Ray],
    setups: &'a [RaySetup],
    visits: &'a [Visit],
}

impl<Q: StreamQuery, const N: usize> WithSimd<N> for NodeSteps<'_, Q, N> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) -> usize {
        let mut pushed = 0;
        for (place, &Visit { ray, child }) in self.visits.iter().enumerate() {
            let (ray, index) = (ray as usize, child.0 as usize);
            let state = Q::begin(&self.rays[ray]);
            let setup = &self.setups[ray];
            let node = &self.bvh.nodes[index];
            let limit = Q::limit(&state, setup);
            let (mask, entry) = NodeTest::<S, N>::new(simd, setup).step(simd, &node.planes, limit);
            let mut stack = Stack::new(self.items, place % PLACES);
            let empty = stack.top();
            Q::Item::push(&mut stack, node, mask, entry);
            pushed += (stack.top() - empty) as usize;
        }
        pushed
    }
}

struct LeafSteps<'a, Q: StreamQuery, const N: usize> {
    bvh: &'a WideTree<'a, N>,
    items: &'a mut [Q::Item],
    rays: &'a [Ray],
    setups: &'a [RaySetup],
    visits: &'a [Visit],
    /// As long as `visits`.
    answers: &'a mut [Q::Answer],
}

impl<Q: StreamQuery, const N: usize> WithSimd<N> for LeafSteps<'_, Q, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        for (place, (visit, answer)) in self.visits.iter().zip(self.answers).enumerate() {
            let (ray, child) = (visit.ray as usize, visit.child);
            let ChildKind::Leaf(leaf) = child.kind() else {
                continue;
            };
            let mut state = Q::begin(&self.rays[ray]);
            let mut stack = Stack::new(self.items, place % PLACES);
            let setup = &self.setups[ray];
            let left =
                Q::leaf_in_stream(&mut state, &mut stack, simd, self.bvh, leaf, setup, false);
            if left != 0 {
                Q::confirm(&mut state, &mut stack, simd, self.bvh, (leaf, left), setup);
            }
            *answer = Q::finish(&state);
        }
    }
}
