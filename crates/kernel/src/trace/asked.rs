//! What a query of many rays is about: the rays as the caller has them, what their hits have to meet, and who is told more
//! than the answer.

use core::fmt;
use core::ops::Range;

use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::{Condition, Conditions};
use crate::trace::ray_sort::Key;
use crate::tree::node::Child;

/// Rays that are asked about.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    pub rays: &'a [Ray],
    places: Places<'a>,
    /// Index of the first ray among those that were asked about.
    start: usize,
    conditions: Option<&'a Conditions<'a>>,
    /// Hits with ids as in the tree, one for each ray, behind which hits count.
    after: Option<&'a [Hit]>,
    told: Told<'a>,
}

/// Places of the rays in their batch.
#[derive(Clone, Copy)]
enum Places<'a> {
    /// One after another, from this one on.
    From(usize),
    /// Anywhere behind the first number.
    Keys(usize, &'a [Key]),
}

/// Who is told more than the answer, with the index of the ray among those that were asked about.
#[derive(Clone, Copy)]
pub(crate) enum Told<'a> {
    Nobody,
    /// Told what occludes an occluded ray.
    Occluder(&'a dyn Fn(usize, PrimId)),
    /// Told the closest hit and where it is.
    Surface(&'a dyn Fn(usize, &Ray, &Found)),
}

/// A hit with ids as in the tree, and where it is.
#[derive(Clone, Copy)]
pub(crate) struct Found {
    pub hit: Hit,
    /// Leaf of the primitive.
    pub leaf: Child,
    /// Index of its instance, or [`Found::WORLD`].
    pub instance: u32,
}

impl Found {
    /// In no instance.
    pub const WORLD: u32 = u32::MAX;
}

impl<'a> Asked<'a> {
    /// Rays whose first one has this place in their batch.
    pub fn new(rays: &'a [Ray], first: usize) -> Self {
        Self {
            rays,
            places: Places::From(first),
            start: 0,
            conditions: None,
            after: None,
            told: Told::Nobody,
        }
    }

    /// Rays that were brought together: their places are those of the keys behind `first`.
    pub fn by_keys(rays: &'a [Ray], first: usize, keys: &'a [Key]) -> Self {
        Self {
            places: Places::Keys(first, keys),
            ..Self::new(rays, 0)
        }
    }

    pub fn under(self, conditions: Option<&'a Conditions<'a>>) -> Self {
        Self { conditions, ..self }
    }

    pub fn behind(self, after: Option<&'a [Hit]>) -> Self {
        Self { after, ..self }
    }

    pub fn telling(self, told: Told<'a>) -> Self {
        Self { told, ..self }
    }

    /// Some of the rays.
    pub fn part(&self, range: Range<usize>) -> Self {
        Self {
            places: match self.places {
                Places::From(first) => Places::From(first + range.start),
                Places::Keys(first, keys) => Places::Keys(first, &keys[range.clone()]),
            },
            start: self.start + range.start,
            rays: &self.rays[range],
            ..*self
        }
    }

    fn place(&self, index: usize) -> usize {
        match self.places {
            Places::From(first) => first + index,
            Places::Keys(first, keys) => first + keys[index].index(),
        }
    }

    /// Whether each hit that a ray finds is decided about.
    #[inline(always)]
    pub fn decides(&self) -> bool {
        self.conditions.is_some() || self.after.is_some() || matches!(self.told, Told::Occluder(_))
    }

    /// Whether places of hits are wanted.
    #[inline(always)]
    pub fn wants_places(&self) -> bool {
        matches!(self.told, Told::Surface(_))
    }

    /// Runs `work` with the condition of a ray.
    pub fn with_condition<R>(&self, index: usize, work: impl FnOnce(&Condition<'_>) -> R) -> R {
        let after = self.after.map(|after| after[self.start + index]);
        match self.conditions {
            Some(conditions) => conditions.with(self.place(index), |condition| {
                work(&Condition {
                    after,
                    ..*condition
                })
            }),
            None => work(&Condition {
                after,
                ..Condition::NONE
            }),
        }
    }

    /// Tells what occludes a ray.
    pub fn tell_occluder(&self, index: usize, occluder: PrimId) {
        if let Told::Occluder(told) = self.told {
            told(self.start + index, occluder);
        }
    }

    /// Tells where the closest hit of a ray is.
    pub fn tell_surface(&self, index: usize, found: &Found) {
        if let Told::Surface(told) = self.told {
            told(self.start + index, &self.rays[index], found);
        }
    }
}

impl fmt::Debug for Asked<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Asked")
            .field("rays", &self.rays.len())
            .finish_non_exhaustive()
    }
}
