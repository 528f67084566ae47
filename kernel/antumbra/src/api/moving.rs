//! Trees of scenes that move, and the moment at which a ray looks at them.

use alloc::vec::Vec;
use core::cell::Cell;

use antumbra_simd::scratch::Bits;

use super::bvh::Bvh;
use crate::error::Error;
use crate::geometry::motion::locate;
use crate::geometry::primitives::Primitives;
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::engine::{Each, Table};
use crate::trace::memory::Stored;
use crate::trace::query::{Located, Occluder, Query};
use crate::trace::ray_batch::{RayBatch, Report};
use crate::trace::visit::{Ahead, Visit};

/// Scenes that move while rays are traced: see [`Geometry::moving`](crate::Geometry::moving) and
/// [`Instance::moving`](crate::Instance::moving).
///
/// Times go from 0, the first key, to 1, the last one. Times outside are clamped, and NaN counts as 0. Queries have a time by
/// [`RayQuery::at`](crate::RayQuery::at) and [`Batch::at`](crate::Batch::at). All others answer at time 0, queries about points
/// included. An answer at a time equals the answer of [`Brute`](crate::Brute) over [`Primitives::at`] that time, for every
/// recipe, width and level, for single rays and in batches.
///
/// Two exceptions are known, both from the clamping of distances into boxes. In an object squeezed by a factor of thousands,
/// the distance of a hit at a grazing angle may differ, because the box around a moving instance is larger than needed.
/// Distances of user geometry may differ that are not inside its own box.
///
/// Each span between two keys has a tree of its own, which is built and learned in the middle of the span. Boxes move along: a
/// node tests where its boxes are at the time of the ray. Objects are stored once for every span.
///
/// A tree that moves is neither saved to a file nor refitted, and keeps the child order that it learned when it was built.
impl Bvh {
    /// Makes trees of one's own move, one for each span: tree `i` is one over [`Primitives::middle`] of span `i`, however it
    /// was built. [`Bvh::build`] and [`Bvh::learn`] do all of it.
    ///
    /// # Errors
    /// [`Error::OtherTrees`] if there are not as many trees as spans; [`Error::PrimitiveIsGone`] if a triangle of a moving
    /// mesh is not where it is in the middle of the span, as in a tree of another scene or span. Other primitives are not
    /// compared.
    pub fn moving(primitives: &Primitives, trees: Vec<Self>) -> Result<Self, Error> {
        let spans = (primitives.motion.as_ref()).map_or(&[][..], |motion| motion.spans());
        let (expected, found) = (spans.len(), trees.len());
        let mut moving = Vec::with_capacity(found);
        for (mut bvh, keys) in trees.into_iter().zip(spans) {
            bvh.tree.set_motion(keys)?;
            // Where everything is at time 0, if this is the first span.
            for placed in &mut bvh.tree.instances {
                let inst_id = placed.placement.inst_id;
                let start = (primitives.instances)
                    .binary_search_by_key(&inst_id, |start| start.placement.inst_id);
                if let (Ok(start), true) = (start, moving.is_empty()) {
                    let start = &primitives.instances[start];
                    placed.placement = start.placement;
                    placed.world_from_object = start.world_from_object;
                }
            }
            moving.push(bvh);
        }
        let mut moving = moving.into_iter();
        match moving.next() {
            Some(first) if expected == found => Ok(Self {
                later: moving.collect(),
                ..first
            }),
            _ => Err(Error::OtherTrees { expected, found }),
        }
    }

    /// Whether anything moves while rays are traced.
    pub(crate) fn moves(&self) -> bool {
        self.tree.motion.is_some()
    }

    /// The trees of all spans.
    pub(super) fn spans(&self) -> impl Iterator<Item = &Self> {
        core::iter::once(self).chain(&self.later)
    }

    /// The tree at a time, or as it is.
    pub(super) fn moment(&self, time: Option<f32>) -> Moment<'_> {
        let Some(time) = time.filter(|_| self.moves()) else {
            return Moment {
                bvh: self,
                share: None,
            };
        };
        let (span, share) = locate(time, 1 + self.later.len());
        Moment {
            bvh: span.checked_sub(1).map_or(self, |later| &self.later[later]),
            share: Some(share),
        }
    }
}

/// A tree, and the share of its span at which a ray looks, if it moves: queries of one ray.
#[derive(Clone, Copy)]
pub(super) struct Moment<'a> {
    pub bvh: &'a Bvh,
    pub share: Option<f32>,
}

impl Moment<'_> {
    /// A query of one ray under a condition.
    fn one<Q: Query<Item: Stored + Bits>>(
        self,
        ray: &Ray,
        condition: &Condition<'_>,
        report: Report<'_>,
    ) -> Q::Answer
    where
        dyn Table: Each<Q>,
    {
        let batch = RayBatch::new(core::slice::from_ref(ray), 0).when(condition);
        let batch = batch.at(self.share.as_ref().map(core::slice::from_ref));
        self.bvh.one::<Q>(ray, Some(&batch.reporting(report)))
    }

    /// Whether anything that satisfies a condition occludes a ray.
    pub fn occluded_when(self, ray: &Ray, condition: &Condition<'_>) -> bool {
        match self.share.is_none() && condition.is_none() {
            true => self.bvh.occluded(ray),
            false => self.one::<Occluder>(ray, condition, Report::Nothing),
        }
    }

    /// The first occluder found that satisfies a condition.
    pub fn occluder_when(self, ray: &Ray, condition: &Condition<'_>) -> Option<PrimId> {
        let found = Cell::new(None);
        let report = |_: usize, occluder| found.set(Some(occluder));
        self.one::<Occluder>(ray, condition, Report::Occluder(&report));
        found.get()
    }

    /// The closest hit that satisfies a condition.
    pub fn closest_when(self, ray: &Ray, condition: &Condition<'_>) -> Option<Hit> {
        match self.share.is_none() && condition.is_none() {
            true => self.bvh.intersect(ray),
            false => self.one::<Located<true>>(ray, condition, Report::Nothing),
        }
    }

    /// Calls `visit` with the hits that satisfy a condition, front to back.
    pub fn visit_when(
        self,
        ray: &Ray,
        condition: &Condition<'_>,
        visit: &mut dyn FnMut(Hit) -> Visit,
    ) -> Option<Hit> {
        (self.bvh.pool).with(|memory| self.visit_ahead(&mut memory.ahead, ray, condition, visit))
    }

    /// [`Moment::visit_when`] in the memory given.
    pub fn visit_ahead(
        self,
        ahead: &mut Ahead,
        ray: &Ray,
        condition: &Condition<'_>,
        visit: &mut dyn FnMut(Hit) -> Visit,
    ) -> Option<Hit> {
        let visit = &mut |hit: Hit| match condition.counts(&hit) {
            true => visit(hit),
            false => Visit::Reject,
        };
        let table = self.bvh.engine.0;
        table.visit(&self.bvh.tree, self.share, ahead, (ray, condition), visit)
    }
}
