//! Conditions that a query puts on hits: what is left out, and what counts.

use crate::geometry::masks::SceneMasks;
use crate::prim_id::PrimId;
use crate::ray::Hit;

/// Conditions of a query on a hit beside its place in the interval. Ids are as users know them.
#[derive(Clone, Copy)]
pub(crate) struct Condition<'a> {
    /// A primitive that is left out, or [`PrimId::NONE`].
    pub excluded: PrimId,
    /// Mask of the ray, if it has one.
    pub mask: Option<u32>,
    /// Masks of the scene; all bits everywhere if there are none.
    pub masks: Option<&'a SceneMasks>,
    /// Decision about a hit that counts for all that is above.
    pub accept: Option<&'a dyn Fn(&Hit) -> bool>,
    /// A hit, with ids as in the tree, behind which hits count: see [`Condition::is_behind`].
    pub after: Option<Hit>,
}

/// Conditions that the rays of a batch put on hits.
#[derive(Clone, Copy)]
pub(crate) struct Conditions<'a> {
    /// A primitive that is left out, or [`PrimId::NONE`], for each ray.
    pub except: Option<&'a [PrimId]>,
    pub mask: Option<RayMasks<'a>>,
    /// Masks of the scene.
    pub masks: Option<&'a SceneMasks>,
    pub filter: Option<Filter<'a>>,
}

/// Masks of the rays of a batch.
#[derive(Clone, Copy, Debug)]
pub(crate) enum RayMasks<'a> {
    Same(u32),
    Each(&'a [u32]),
}

/// Decision about a hit of a ray, given by its place in the batch.
pub(crate) type Filter<'a> = &'a (dyn Fn(usize, &Hit) -> bool + Sync);

impl Conditions<'_> {
    /// Whether every hit of every ray counts.
    pub fn are_none(&self) -> bool {
        self.except.is_none()
            && self.filter.is_none()
            && match self.mask {
                None => true,
                Some(RayMasks::Same(mask)) => mask != 0 && self.masks.is_none(),
                Some(RayMasks::Each(_)) => false,
            }
    }

    /// Runs `work` with the condition of the ray at this place, for hits behind `after`.
    pub fn with<R>(
        &self,
        place: usize,
        after: Option<Hit>,
        work: impl FnOnce(&Condition<'_>) -> R,
    ) -> R {
        let filter = self
            .filter
            .map(|filter| move |hit: &Hit| filter(place, hit));
        work(&Condition {
            excluded: self.except.map_or(PrimId::NONE, |except| except[place]),
            mask: self.mask.map(|mask| match mask {
                RayMasks::Same(mask) => mask,
                RayMasks::Each(masks) => masks[place],
            }),
            masks: self.masks,
            accept: match &filter {
                Some(filter) => Some(filter),
                None => None,
            },
            after,
        })
    }
}

impl<'a> Condition<'a> {
    /// Condition that every hit fulfils.
    pub const NONE: Condition<'static> = Condition::except(PrimId::NONE);

    /// Condition that every hit fulfils but hits on one primitive.
    pub const fn except(excluded: PrimId) -> Self {
        Self {
            excluded,
            mask: None,
            masks: None,
            accept: None,
            after: None,
        }
    }

    /// Whether a hit with ids as in the tree comes after the one behind which hits count, in the order in which hits are
    /// reported.
    pub fn is_behind(&self, hit: &Hit) -> bool {
        self.after.is_none_or(|after| after.precedes(hit))
    }

    /// Whether every hit counts.
    pub fn is_none(&self) -> bool {
        self.excluded == PrimId::NONE
            && self.accept.is_none()
            && match self.mask {
                None => true,
                Some(mask) => self.masks.is_none() && mask != 0,
            }
    }

    /// Whether anything in an instance can count.
    pub fn enters(&self, inst_id: u32) -> bool {
        match (self.mask, self.masks) {
            (None, _) => true,
            (Some(mask), None) => mask != 0,
            (Some(mask), Some(masks)) => masks.shows_instance(mask, inst_id),
        }
    }

    /// Whether hits on a primitive can count.
    #[inline(always)]
    pub fn may_count(&self, id: PrimId) -> bool {
        id != self.excluded
            && match (self.mask, self.masks) {
                (None, _) => true,
                (Some(mask), None) => mask != 0,
                (Some(mask), Some(masks)) => masks.shows(mask, id.inst_id, id.geom_id),
            }
    }

    /// Whether a hit fulfils everything but `after`, which [`Condition::is_behind`] checks.
    pub fn counts(&self, hit: &Hit) -> bool {
        self.may_count(PrimId::from(*hit)) && self.accept.is_none_or(|accept| accept(hit))
    }
}
