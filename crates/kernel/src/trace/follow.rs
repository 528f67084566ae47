//! Rays through a whole wide tree without ever stopping: what [`RayLog`] keeps of them.

use antumbra_simd::{Mask, Simd, Width};

use crate::geometry::instance_ray::Stay;
use crate::geometry::ray_setup::RaySetup;
use crate::hash;
use crate::learn::ray_log::{RayLog, Visit};
use crate::ray::Ray;
use crate::trace::observe::Nothing;
use crate::trace::pick::{InOrder, Pick};
use crate::trace::query::Query;
use crate::trace::stack::Stack;
use crate::trace::step::{NodeLanes, NodeMask, leaf_occluded};
use crate::tree::node::{Child, Leaf, Node};
use crate::tree::wide::Bvh;

/// The widest node.
const WIDEST: usize = 16;

/// Writes down what rays meet. Only for rays one by one: it keeps the path of the one that is on its way.
pub(crate) struct Follow<'a> {
    log: &'a mut RayLog,
    /// A hash of the ray.
    key: u64,
    /// The nodes on the way from the root to where the ray is.
    path: Vec<Step>,
    /// The instance that it has just gone into, as the slot of a visit.
    entered: Option<(usize, usize)>,
}

/// A node on the path.
struct Step {
    /// Where its visit stands in the log.
    visit: usize,
    /// From which slot of which visit the ray came.
    parent: Option<(usize, usize)>,
    /// Slots that were hit and have not been come to.
    rest: u32,
    /// The [`Child`] in each slot.
    children: [u32; WIDEST],
}

impl<'a> Follow<'a> {
    pub fn new(log: &'a mut RayLog) -> Self {
        Self {
            log,
            key: 0,
            path: Vec::new(),
            entered: None,
        }
    }

    /// The slot in which the ray comes to a child. Those before it are done with; instances among them have
    /// not let it in.
    fn come_to(&mut self, child: Child) -> Option<(usize, usize)> {
        while let Some(step) = self.path.last_mut() {
            while step.rest != 0 {
                let slot = step.rest.trailing_zeros() as usize;
                step.rest &= step.rest - 1;
                if step.children[slot] == child.0 {
                    return Some((step.visit, slot));
                }
            }
            self.leave();
        }
        None
    }

    /// Completes the last visit of the path.
    fn leave(&mut self) {
        let Some(step) = self.path.pop() else { return };
        let len = self.log.visits().len() - step.visit;
        let visit = self.log.visit_mut(step.visit);
        visit.len = len as u32;
        if visit.occluding != 0
            && let Some((parent, slot)) = step.parent
        {
            self.log.visit_mut(parent).occluding |= 1 << slot;
        }
    }

    /// Completes the ray before the next one begins or the log is used.
    pub fn end_ray(&mut self) {
        while !self.path.is_empty() {
            self.leave();
        }
        self.log.end_ray(self.key);
    }
}

impl Drop for Follow<'_> {
    fn drop(&mut self) {
        self.end_ray();
    }
}

impl Query for Follow<'_> {
    type Item = u32;
    /// Whether there is anything.
    type State = bool;
    type Answer = bool;

    const IDLE: bool = false;

    fn begin(&mut self, _: usize, ray: &Ray) -> bool {
        self.end_ray();
        self.key = hash::of_ray(0, ray);
        false
    }

    fn finish(occluded: &bool) -> bool {
        *occluded
    }

    fn miss() -> bool {
        false
    }

    #[inline(always)]
    fn limit(_: &bool, ray: &RaySetup) -> f32 {
        ray.tfar
    }

    #[inline(always)]
    fn push<S: Simd + Width<N>, const N: usize>(
        &mut self,
        stack: &mut Stack<'_, u32>,
        index: usize,
        node: &Node<N>,
        ray: &RaySetup,
        mask: NodeMask<S, N>,
        entry: NodeLanes<S, N>,
    ) {
        let parent = match self.entered.take() {
            Some(parent) => Some(parent),
            None => self.come_to(Child::inner(index)),
        };
        if let Some((parent, slot)) = parent {
            self.log.visit_mut(parent).followed |= 1 << slot;
        }
        // Slots stand in descending lanes.
        let hit = mask.bits().reverse_bits() >> (u32::BITS - N as u32);
        let visit = self.log.push(Visit {
            node: index as u32,
            len: 0,
            hit: hit as u16,
            occluding: 0,
            followed: 0,
            octant: ray.octant() as u8,
        });
        let mut children = [Child::EMPTY.0; WIDEST];
        for (slot, child) in children.iter_mut().enumerate().take(N) {
            *child = node.child(slot).0;
        }
        self.path.push(Step {
            visit,
            parent,
            rest: hit,
            children,
        });
        InOrder.push::<N, NodeLanes<S, N>>(stack, index, node, ray, mask, entry);
    }

    #[inline(always)]
    fn leaf<S: Simd, const N: usize, const WAVE: bool>(
        &mut self,
        occluded: &mut bool,
        _: &mut Stack<'_, u32>,
        simd: S,
        bvh: &Bvh<N>,
        leaf: Leaf,
        ray: &RaySetup,
    ) {
        let place = self.come_to(Child::leaf(leaf));
        if leaf_occluded::<S, N, WAVE>(simd, bvh, leaf, ray, &mut Nothing) {
            *occluded = true;
            if let Some((visit, slot)) = place {
                self.log.visit_mut(visit).occluding |= 1 << slot;
            }
        }
    }

    fn enter<const N: usize>(&mut self, _: &mut bool, _: &Bvh<N>, index: usize, _: Stay) {
        self.entered = self.come_to(Child::instance(index));
    }

    fn exit(&mut self, _: &mut bool) {}
}
