//! What traversals get of a batch: rays, the conditions on hits, and who gets a report beside the answers.

use core::fmt;
use core::ops::Range;

use crate::geometry::best::TreeHit;
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::{Condition, Conditions};
use crate::trace::ray_sort::Key;
use crate::tree::node::Child;

/// Rays of a batch, or some of them.
#[derive(Clone, Copy)]
pub(crate) struct RayBatch<'a> {
    pub rays: &'a [Ray],
    places: Places<'a>,
    /// Index of the first ray in the list that the batch began with.
    start: usize,
    conditions: Option<&'a Conditions<'a>>,
    /// Condition of every ray, if there are no `conditions`.
    condition: &'a Condition<'a>,
    /// A hit for each ray in that list, with ids as in the tree. Only hits behind it count.
    after: Option<&'a [Hit]>,
    report: Report<'a>,
    is_alike: bool,
    /// Per ray, its share of the span at which it looks at a tree that moves.
    shares: Option<&'a [f32]>,
}

/// Places of the rays in their batch.
#[derive(Clone, Copy)]
enum Places<'a> {
    /// One after another, from this one on.
    From(usize),
    /// In the order of these keys, whose places count from the first number.
    Keys(usize, &'a [Key]),
}

/// Receivers of reports. The number is the index of the ray in the list that the batch began with.
#[derive(Clone, Copy)]
pub(crate) enum Report<'a> {
    Nothing,
    /// The occluder of an occluded ray.
    Occluder(&'a dyn Fn(usize, PrimId)),
    /// The closest hit of a ray.
    Surface(&'a dyn Fn(usize, &Ray, &LocatedHit)),
}

/// A hit, and where the tree has the primitive.
#[derive(Clone, Copy)]
pub(crate) struct LocatedHit {
    /// With ids as in the tree.
    pub hit: TreeHit,
    /// Leaf of the primitive.
    pub leaf: Child,
    /// Index of its instance, or [`LocatedHit::WORLD`].
    pub instance: u32,
}

impl LocatedHit {
    /// Value of [`LocatedHit::instance`] for a hit in the world itself.
    pub const WORLD: u32 = u32::MAX;
}

impl<'a> RayBatch<'a> {
    /// Rays in the order of their batch, where the first one has this place.
    pub fn new(rays: &'a [Ray], first: usize) -> Self {
        Self {
            rays,
            places: Places::From(first),
            start: 0,
            conditions: None,
            condition: &Condition::NONE,
            after: None,
            report: Report::Nothing,
            is_alike: false,
            shares: None,
        }
    }

    /// Rays in the order of keys, which hold their places counted from `first`.
    pub fn by_keys(rays: &'a [Ray], first: usize, keys: &'a [Key]) -> Self {
        Self {
            places: Places::Keys(first, keys),
            ..Self::new(rays, 0)
        }
    }

    /// Only hits that fulfil the conditions count.
    pub fn under(self, conditions: Option<&'a Conditions<'a>>) -> Self {
        Self { conditions, ..self }
    }

    /// Only hits that fulfil this condition count.
    pub fn when(self, condition: &'a Condition<'a>) -> Self {
        Self { condition, ..self }
    }

    /// Only hits behind these count, one for each ray.
    pub fn behind(self, after: &'a [Hit]) -> Self {
        Self {
            after: Some(after),
            ..self
        }
    }

    /// Neighbours are occluded by the same things, mostly.
    pub fn alike(self, is_alike: bool) -> Self {
        Self { is_alike, ..self }
    }

    /// Each ray looks at its own share of the span of a tree that moves.
    pub fn at(self, shares: Option<&'a [f32]>) -> Self {
        Self { shares, ..self }
    }

    pub fn shares(&self) -> Option<&'a [f32]> {
        self.shares
    }

    /// The share at which a ray looks.
    pub fn share(&self, index: usize) -> Option<f32> {
        self.shares.map(|shares| shares[index])
    }

    pub fn reporting(self, report: Report<'a>) -> Self {
        Self { report, ..self }
    }

    /// Part of the batch: the rays of a range.
    pub fn part(&self, range: Range<usize>) -> Self {
        Self {
            places: match self.places {
                Places::From(first) => Places::From(first + range.start),
                Places::Keys(first, keys) => Places::Keys(first, &keys[range.clone()]),
            },
            start: self.start + range.start,
            shares: self.shares.map(|shares| &shares[range.clone()]),
            rays: &self.rays[range],
            ..*self
        }
    }

    /// Place of a ray in its batch.
    #[inline(always)]
    fn place(&self, index: usize) -> usize {
        match self.places {
            Places::From(first) => first + index,
            Places::Keys(first, keys) => first + keys[index].index(),
        }
    }

    /// Whether what occluded a ray is likely to occlude the next.
    #[inline(always)]
    pub fn is_alike(&self) -> bool {
        self.is_alike
    }

    /// Whether hits count by the conditions of their rays, or occluders are reported, or rays look at times.
    #[inline(always)]
    pub fn is_conditional(&self) -> bool {
        self.conditions.is_some()
            || self.after.is_some()
            || self.shares.is_some()
            || matches!(self.report, Report::Occluder(_))
    }

    /// Whether traversals have to note the leaves of hits.
    #[inline(always)]
    pub fn reports_surfaces(&self) -> bool {
        matches!(self.report, Report::Surface(_))
    }

    /// Runs `work` with the condition of a ray.
    pub fn with_condition<R>(&self, index: usize, work: impl FnOnce(&Condition<'_>) -> R) -> R {
        let after = self.after.map(|after| after[self.start + index]);
        match self.conditions {
            Some(conditions) => conditions.with(self.place(index), after, work),
            None if after.is_none() => work(self.condition),
            None => work(&Condition {
                after,
                ..*self.condition
            }),
        }
    }

    /// Reports the occluder of a ray.
    #[inline(always)]
    pub fn report_occluder(&self, index: usize, occluder: PrimId) {
        if let Report::Occluder(receive) = self.report {
            receive(self.start + index, occluder);
        }
    }

    /// Reports the closest hit of a ray.
    pub fn report_surface(&self, index: usize, found: &LocatedHit) {
        if let Report::Surface(receive) = self.report {
            receive(self.start + index, &self.rays[index], found);
        }
    }
}

impl fmt::Debug for RayBatch<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RayBatch")
            .field("rays", &self.rays.len())
            .finish_non_exhaustive()
    }
}
