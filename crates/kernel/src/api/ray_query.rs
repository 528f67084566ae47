//! Questions about one ray with conditions: masks, a primitive that is left out, a function that decides about hits.

use alloc::vec::Vec;
use core::cell::RefCell;

use super::bvh::Bvh;
use crate::geometry::masks::{Masks, SceneMasks};
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::brute::Brute;
use crate::trace::condition::Condition;
use crate::trace::conditional::Conditional;
use crate::trace::visit::{Visit, Visiting};
use crate::tree::any::on_tree;
use antumbra_simd::Dispatch;

/// A ray and conditions on what it may hit. Made by [`Bvh::query`]; nothing happens before the last call, which asks.
///
/// Conditions can be combined. A hit counts if it counts for every one of them: filters of cut-outs first, then masks and the
/// primitive left out, then the function given to the last call.
///
/// ```
/// use antumbra::{Bvh, Geometry, Masks, Ray, Recipe};
///
/// let triangle = |z| vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
/// let panes = [1.0, 2.0, 3.0].map(|z| Geometry::triangles(triangle(z), vec![[0, 1, 2]]));
/// let mut bvh = Bvh::build(&panes, &Recipe::default())?;
/// let mut masks = Masks::default();
/// masks.world = vec![0b01, 0b11, 0b10];
/// bvh.set_masks(masks);
///
/// let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
/// let first = |mask| bvh.query(&ray).mask(mask).intersect().map(|hit| hit.geom_id);
/// assert_eq!([first(0b01), first(0b10), first(0b100)], [Some(0), Some(1), None]);
/// let far = bvh.query(&ray).mask(0b01).intersect_if(|hit| hit.t > 1.5);
/// assert_eq!(far.map(|hit| hit.geom_id), Some(1));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[must_use = "a query does nothing until it is asked"]
pub struct RayQuery<'a> {
    scene: Scene<'a>,
    ray: Ray,
    mask: Option<u32>,
    excluded: PrimId,
}

/// Where it is asked.
#[derive(Clone, Copy, Debug)]
enum Scene<'a> {
    Tree(&'a Bvh),
    Brute(&'a Brute),
}

impl Bvh {
    /// A question about a ray with conditions on what it may hit. May be asked from any number of threads at once.
    pub fn query(&self, ray: &Ray) -> RayQuery<'_> {
        RayQuery::new(Scene::Tree(self), ray)
    }

    /// Whether anything that `accept` accepts lies in the ray's interval: a filter of this query, with the ray and all data
    /// that the closure has.
    ///
    /// `accept` hears of hits in no defined order until it accepts one, and may hear of a hit twice. It must tell the same of
    /// the same hit: then the answer does not depend on the tree. It hears of the hits that [`Bvh::visit_hits`] tells of, but
    /// cut-outs count as in occlusion queries.
    ///
    /// Short for `bvh.query(ray).occluded_if(accept)`.
    pub fn occluded_if(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> bool {
        self.query(ray).occluded_if(accept)
    }

    /// The closest hit that `accept` accepts. `accept` hears of hits front to back, as [`Bvh::visit_hits`] tells of them, and may
    /// hear of the first one twice. It must tell the same of the same hit.
    ///
    /// Costs as much as [`Bvh::intersect`] if the closest hit is accepted, and a visit of the hits on top if not.
    ///
    /// Short for `bvh.query(ray).intersect_if(accept)`.
    pub fn intersect_if(&self, ray: &Ray, accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        self.query(ray).intersect_if(accept)
    }

    /// Gives masks to geometries and instances, for queries that have a [mask](RayQuery::mask). They replace those that were
    /// given before.
    ///
    /// No part of the tree changes. Files do not hold masks, and a [`World`](crate::World) takes its own.
    pub fn set_masks(&mut self, masks: Masks) {
        let masks = SceneMasks::new(masks, self.placed_objects().into_iter());
        self.masks = Some(alloc::sync::Arc::new(masks));
    }

    /// The masks that were given last.
    pub fn masks(&self) -> Option<&Masks> {
        self.masks.as_ref().map(|masks| &masks.masks)
    }

    /// Instances are others: masks go by their numbers.
    pub(super) fn renew_masks(&mut self) {
        if self.masks.is_some() {
            let placed = self.placed_objects();
            if let Some(masks) = &mut self.masks {
                alloc::sync::Arc::make_mut(masks).place(placed.into_iter());
            }
        }
    }

    /// Number and object of every instance.
    fn placed_objects(&self) -> Vec<(u32, u32)> {
        on_tree!(&self.tree, tree => {
            let placed = tree.instances.iter();
            placed.map(|placed| (placed.placement.inst_id, placed.object)).collect()
        })
    }

    /// Whether anything that meets a condition occludes a ray.
    pub(super) fn occluded_when(&self, ray: &Ray, condition: &Condition<'_>) -> bool {
        if condition.is_none() {
            return self.occluded(ray);
        }
        self.with_stack(|stack: &mut [u32]| {
            on_tree!(&self.tree, bvh => {
                self.isa().dispatch(Conditional { bvh, stack, ray, condition })
            })
        })
    }

    /// The closest hit that meets a condition, given the closest one of all.
    pub(super) fn closest_when(
        &self,
        ray: &Ray,
        condition: &Condition<'_>,
        closest: Option<Hit>,
    ) -> Option<Hit> {
        if closest.is_none_or(|hit| condition.counts(&hit)) {
            return closest;
        }
        self.visit_when(ray, condition, &mut |_| Visit::Accept)
    }

    /// Tells of the hits that meet a condition.
    pub(super) fn visit_when(
        &self,
        ray: &Ray,
        condition: &Condition<'_>,
        visit: &mut dyn FnMut(Hit) -> Visit,
    ) -> Option<Hit> {
        let visit = &mut |hit: Hit| match condition.counts(&hit) {
            true => visit(hit),
            false => Visit::Reject,
        };
        self.pool.with(|memory| {
            let ahead = &mut memory.ahead;
            let condition = Some(condition);
            on_tree!(&self.tree, bvh => {
                self.isa().dispatch(Visiting { bvh, ahead, ray, condition, visit })
            })
        })
    }
}

impl Brute {
    /// [`Bvh::query`].
    pub fn query(&self, ray: &Ray) -> RayQuery<'_> {
        RayQuery::new(Scene::Brute(self), ray)
    }

    /// [`Bvh::set_masks`].
    pub fn set_masks(&mut self, masks: Masks) {
        let placed = self.primitives().instances.iter();
        let objects = placed.map(|placed| (placed.placement.inst_id, placed.object));
        let masks = SceneMasks::new(masks, objects);
        self.masks = Some(masks);
    }
}

impl<'a> RayQuery<'a> {
    fn new(scene: Scene<'a>, ray: &Ray) -> Self {
        Self {
            scene,
            ray: *ray,
            mask: None,
            excluded: PrimId::NONE,
        }
    }

    /// Counts hits at either end of the interval as well: asks about [`Ray::closed`].
    pub fn closed(self) -> Self {
        Self {
            ray: self.ray.closed(),
            ..self
        }
    }

    /// Sees only geometries and instances whose [masks](Masks) have a bit in common with `mask`. Without a call of this one,
    /// the ray sees everything, also where a mask is 0.
    pub fn mask(self, mask: u32) -> Self {
        Self {
            mask: Some(mask),
            ..self
        }
    }

    /// Leaves out one primitive, as [`Bvh::occluded_except`].
    pub fn except(self, excluded: PrimId) -> Self {
        Self { excluded, ..self }
    }

    /// Whether anything that counts lies in the ray's interval.
    pub fn occluded(self) -> bool {
        self.occluded_when(&self.condition(None))
    }

    /// The closest hit that counts.
    pub fn intersect(self) -> Option<Hit> {
        self.intersect_when(&self.condition(None))
    }

    /// [`Bvh::occluded_if`] among what counts.
    pub fn occluded_if(self, accept: impl FnMut(&Hit) -> bool) -> bool {
        let accept = RefCell::new(accept);
        self.occluded_when(&self.condition(Some(&|hit| (accept.borrow_mut())(hit))))
    }

    /// [`Bvh::intersect_if`] among what counts.
    pub fn intersect_if(self, accept: impl FnMut(&Hit) -> bool) -> Option<Hit> {
        let accept = RefCell::new(accept);
        self.intersect_when(&self.condition(Some(&|hit| (accept.borrow_mut())(hit))))
    }

    /// [`Bvh::visit_hits`] of what counts.
    pub fn visit_hits(self, mut visit: impl FnMut(Hit) -> Visit) -> Option<Hit> {
        let condition = self.condition(None);
        match self.scene {
            Scene::Tree(bvh) => bvh.visit_when(&self.ray, &condition, &mut visit),
            Scene::Brute(brute) => {
                brute.visit_hits(&self.ray, |hit| match condition.counts(&hit) {
                    true => visit(hit),
                    false => Visit::Reject,
                })
            }
        }
    }

    /// All hits that count, in the order of [`Bvh::visit_hits`].
    pub fn all_hits(self) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.visit_hits(|hit| {
            hits.push(hit);
            Visit::Reject
        });
        hits
    }

    /// Number of hits that count.
    pub fn count_hits(self) -> usize {
        let mut count = 0;
        self.visit_hits(|_| {
            count += 1;
            Visit::Reject
        });
        count
    }

    fn condition<'c>(&self, accept: Option<&'c dyn Fn(&Hit) -> bool>) -> Condition<'c>
    where
        'a: 'c,
    {
        Condition {
            excluded: self.excluded,
            mask: self.mask,
            masks: match self.scene {
                Scene::Tree(bvh) => bvh.masks.as_deref(),
                Scene::Brute(brute) => brute.masks.as_ref(),
            },
            accept,
        }
    }

    fn occluded_when(&self, condition: &Condition<'_>) -> bool {
        match self.scene {
            Scene::Tree(bvh) => bvh.occluded_when(&self.ray, condition),
            Scene::Brute(brute) => brute.occluded_when(&self.ray, condition),
        }
    }

    fn intersect_when(&self, condition: &Condition<'_>) -> Option<Hit> {
        match self.scene {
            Scene::Tree(bvh) => {
                let closest = bvh.intersect(&self.ray);
                bvh.closest_when(&self.ray, condition, closest)
            }
            Scene::Brute(brute) => {
                brute.visit_hits(&self.ray, |hit| match condition.counts(&hit) {
                    true => Visit::Accept,
                    false => Visit::Reject,
                })
            }
        }
    }
}
