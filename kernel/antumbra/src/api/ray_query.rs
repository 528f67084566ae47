//! Queries of one ray with conditions: masks, a primitive that is left out, a function that decides about hits; and
//! visits of all its hits.

use alloc::vec::Vec;
use core::fmt;

use super::bvh::Bvh;
use crate::geometry::masks::{Masks, SceneMasks};
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::brute::Brute;
use crate::trace::condition::Condition;
use crate::trace::visit::Visit;

/// A ray and conditions on what it may hit. Made by [`Bvh::query`]; nothing happens before the last call, which names the
/// query.
///
/// Conditions can be combined. A hit counts if it counts for every one of them: filters of cut-outs first, then masks and the
/// primitive left out, then the [filter](RayQuery::filter).
///
/// ```
/// use antumbra::{Bvh, Geometry, Masks, Ray, Recipe};
///
/// let triangle = |z| vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
/// let panes = [1.0, 2.0, 3.0].map(|z| Geometry::triangles(triangle(z), vec![[0, 1, 2]]));
/// let mut bvh = Bvh::build(&panes, &Recipe::default())?;
/// bvh.set_masks(Masks::new().world(vec![0b01, 0b11, 0b10]));
///
/// let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
/// let first = |mask| bvh.query(&ray).mask(mask).intersect().map(|hit| hit.geom_id);
/// assert_eq!([first(0b01), first(0b10), first(0b100)], [Some(0), Some(1), None]);
/// let far = bvh.query(&ray).mask(0b01).filter(&|hit| hit.t > 1.5).intersect();
/// assert_eq!(far.map(|hit| hit.geom_id), Some(1));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy)]
#[must_use = "a query does nothing until its last call"]
pub struct RayQuery<'a> {
    scene: Scene<'a>,
    ray: Ray,
    mask: Option<u32>,
    excluded: PrimId,
    filter: Option<&'a dyn Fn(&Hit) -> bool>,
    time: Option<f32>,
}

/// Where the ray is traced.
#[derive(Clone, Copy)]
enum Scene<'a> {
    Tree(&'a Bvh),
    Brute(&'a Brute),
}

impl Bvh {
    /// A query about one ray, with conditions on what it may hit. Queries may run on any number of threads at once.
    pub fn query(&self, ray: &Ray) -> RayQuery<'_> {
        RayQuery::new(Scene::Tree(self), ray)
    }

    /// Gives masks to geometries and instances, for queries that have a [mask](RayQuery::mask). They replace those that were
    /// given before.
    ///
    /// No part of the tree changes. Files do not hold masks, and a [`World`](crate::World) takes its own.
    pub fn set_masks(&mut self, masks: Masks) {
        let masks = SceneMasks::new(masks, self.placed_objects().into_iter());
        self.masks = Some(alloc::sync::Arc::new(masks));
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
        let placed = self.tree.instances.iter();
        placed
            .map(|placed| (placed.placement.inst_id, placed.object))
            .collect()
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
            filter: None,
            time: None,
        }
    }

    /// Counts hits at either end of the interval as well: queries [`Ray::closed`].
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

    /// Leaves out one primitive. For rays that start on a surface: the primitive they start on does not occlude them, however
    /// the origin was rounded.
    ///
    /// Neighbours are not left out: a ray that starts on an edge may be stopped by the triangle on the other side. A sphere
    /// is left out whole, also its far side, and so is a quad. [`PrimId::NONE`] leaves out nothing.
    pub fn except(self, excluded: impl Into<PrimId>) -> Self {
        Self {
            excluded: excluded.into(),
            ..self
        }
    }

    /// Counts only hits for which `filter` returns true. The filter belongs only to this query, and may use all data
    /// that the closure has.
    ///
    /// The filter must decide the same about the same hit: then the answer does not depend on the tree. It is called with
    /// hits that count for all other conditions, in no defined order, and may be called with a hit twice.
    pub fn filter(self, filter: &'a dyn Fn(&Hit) -> bool) -> Self {
        Self {
            filter: Some(filter),
            ..self
        }
    }

    /// Looks at the scene at a time from 0 to 1: see [`Bvh::moving`]. A time outside is clamped, and NaN counts as 0. Changes
    /// nothing where nothing moves.
    pub fn at(self, time: f32) -> Self {
        Self {
            time: Some(time),
            ..self
        }
    }

    /// Whether anything that counts lies in the ray's interval.
    #[must_use]
    pub fn occluded(self) -> bool {
        let condition = self.condition();
        match self.scene {
            Scene::Tree(bvh) => bvh.moment(self.time).occluded_when(&self.ray, &condition),
            Scene::Brute(brute) => brute.at(self.time).occluded_when(&self.ray, &condition),
        }
    }

    /// An occluder of the ray that counts, if there is any: any primitive in the interval, not the closest one. Which primitive
    /// it is depends on the tree; whether there is one does not.
    #[must_use]
    pub fn occluder(self) -> Option<PrimId> {
        let condition = self.condition();
        match self.scene {
            Scene::Tree(bvh) => bvh.moment(self.time).occluder_when(&self.ray, &condition),
            Scene::Brute(_) => self.visit_hits(|_| Visit::Accept).map(PrimId::from),
        }
    }

    /// The closest hit that counts; at equal distances the smallest (inst_id, geom_id, prim_id).
    ///
    /// Costs as much as [`Bvh::intersect`] and the decisions about hits on the way.
    #[must_use]
    pub fn intersect(self) -> Option<Hit> {
        let condition = self.condition();
        match self.scene {
            Scene::Tree(bvh) => bvh.moment(self.time).closest_when(&self.ray, &condition),
            Scene::Brute(_) => self.visit_hits(|_| Visit::Accept),
        }
    }

    /// Calls `visit` with every hit that counts, front to back, until it accepts one or stops. Returns the hit that was
    /// accepted.
    ///
    /// | answer | meaning |
    /// |---|---|
    /// | [`Visit::Accept`] | this is the hit: the visit ends and returns it |
    /// | [`Visit::Reject`] | goes on, as if the primitive was not there |
    /// | [`Visit::Stop`] | the visit ends and returns `None` |
    ///
    /// So the first hit that is accepted is the closest one that counts. Nothing behind the end of the visit is tested.
    ///
    /// Hits come by ascending (t, inst_id, geom_id, prim_id), whatever the tree, and each primitive comes once for
    /// every instance of it. A sphere comes with the nearer of its two points inside the interval. Each triangle of a
    /// quad comes by itself. Filters of cut-outs are called first, as by [`Bvh::intersect`]. They may be called for
    /// hits that `visit` is then not called with.
    ///
    /// May be called from any number of threads at once, and from within `visit`. Memory comes from a pool of the tree.
    ///
    /// ```
    /// use antumbra::{Bvh, Geometry, Ray, Recipe, Visit};
    ///
    /// let triangle = |z| vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
    /// let panes = [1.0, 2.0, 3.0].map(|z| Geometry::triangles(triangle(z), vec![[0, 1, 2]]));
    /// let bvh = Bvh::build(&panes, &Recipe::default())?;
    /// let ray = Ray::between([0.2, 0.2, 0.0], [0.2, 0.2, 4.0]);
    ///
    /// // What is left of the light behind panes of tinted glass; the last one is opaque.
    /// let passes = [0.5, 0.25, 0.0];
    /// let mut light = 1.0;
    /// let occluder = bvh.query(&ray).visit_hits(|hit| {
    ///     light *= passes[hit.geom_id as usize];
    ///     if light == 0.0 { Visit::Accept } else { Visit::Reject }
    /// });
    /// assert_eq!(occluder.map(|hit| hit.geom_id), Some(2));
    /// # Ok::<(), antumbra::Error>(())
    /// ```
    pub fn visit_hits(self, mut visit: impl FnMut(Hit) -> Visit) -> Option<Hit> {
        let condition = self.condition();
        match self.scene {
            Scene::Tree(bvh) => {
                (bvh.moment(self.time)).visit_when(&self.ray, &condition, &mut visit)
            }
            Scene::Brute(brute) => {
                let mut hits = brute.at(self.time).all_hits(&self.ray).into_iter();
                hits.find_map(|hit| match condition.counts(&hit) {
                    true => match visit(hit) {
                        Visit::Accept => Some(Some(hit)),
                        Visit::Reject => None,
                        Visit::Stop => Some(None),
                    },
                    false => None,
                })?
            }
        }
    }

    /// All hits that count, in the order of [`RayQuery::visit_hits`].
    #[must_use]
    pub fn all_hits(self) -> Vec<Hit> {
        let mut hits = Vec::new();
        self.visit_hits(|hit| {
            hits.push(hit);
            Visit::Reject
        });
        hits
    }

    /// Number of hits that count. A sphere counts once.
    #[must_use]
    pub fn count_hits(self) -> usize {
        let mut count = 0;
        self.visit_hits(|_| {
            count += 1;
            Visit::Reject
        });
        count
    }

    fn condition(&self) -> Condition<'a> {
        Condition {
            excluded: self.excluded,
            mask: self.mask,
            masks: match self.scene {
                Scene::Tree(bvh) => bvh.masks.as_deref(),
                Scene::Brute(brute) => brute.masks.as_ref(),
            },
            accept: self.filter,
            after: None,
        }
    }
}

impl fmt::Debug for RayQuery<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RayQuery")
            .field("ray", &self.ray)
            .field("mask", &self.mask)
            .field("excluded", &self.excluded)
            .field("has_filter", &self.filter.is_some())
            .field("time", &self.time)
            .finish_non_exhaustive()
    }
}
