//! What a query of many rays is about: the rays as the caller has them, what their hits have to meet, and who is told more
//! than the answer.

use core::fmt;
use core::ops::Range;

use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::ray_columns::Rays;
use crate::trace::condition::{Condition, Conditions};
use crate::trace::ray_sort::Key;
use crate::tree::node::Child;

/// Rays that are asked about.
#[derive(Clone, Copy)]
pub(crate) struct Asked<'a> {
    rays: Rays<'a>,
    /// Whether hits at the ends of the intervals count.
    closed: bool,
    places: Places<'a>,
    conditions: Option<&'a Conditions<'a>>,
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

/// Who is told more than the answer, with the place of the ray in its batch.
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
    pub fn new(rays: Rays<'a>, first: usize) -> Self {
        Self {
            rays,
            closed: false,
            places: Places::From(first),
            conditions: None,
            told: Told::Nobody,
        }
    }

    /// Rays alone.
    pub fn plain(rays: &'a [Ray]) -> Self {
        Self::new(Rays::List(rays), 0)
    }

    /// Rays of these that were brought together, as they are asked about: their places are those of the keys behind `first`.
    pub fn brought_together(&self, rays: &'a [Ray], first: usize, keys: &'a [Key]) -> Self {
        Self {
            rays: Rays::List(rays),
            closed: false,
            places: Places::Keys(first, keys),
            ..*self
        }
    }

    pub fn closed(self, closed: bool) -> Self {
        Self { closed, ..self }
    }

    pub fn under(self, conditions: Option<&'a Conditions<'a>>) -> Self {
        Self { conditions, ..self }
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
            rays: self.rays.part(range),
            ..*self
        }
    }

    #[inline(always)]
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// The rays, if they lie one after the other.
    pub fn list(&self) -> Option<&'a [Ray]> {
        match self.rays {
            Rays::List(rays) if !self.closed => Some(rays),
            _ => None,
        }
    }

    #[inline(always)]
    pub fn get(&self, index: usize) -> Ray {
        let ray = match &self.rays {
            Rays::List(rays) => rays[index],
            Rays::Columns(columns) => columns.get(index),
        };
        if self.closed { ray.closed() } else { ray }
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
        self.conditions.is_some() || matches!(self.told, Told::Occluder(_))
    }

    /// Whether places of hits are wanted.
    #[inline(always)]
    pub fn wants_places(&self) -> bool {
        matches!(self.told, Told::Surface(_))
    }

    /// Runs `work` with the condition of a ray.
    pub fn with_condition<R>(&self, index: usize, work: impl FnOnce(&Condition<'_>) -> R) -> R {
        match self.conditions {
            Some(conditions) => conditions.with(self.place(index), work),
            None => work(&Condition::NONE),
        }
    }

    /// Tells what occludes a ray.
    pub fn tell_occluder(&self, index: usize, occluder: PrimId) {
        if let Told::Occluder(told) = self.told {
            told(self.place(index), occluder);
        }
    }

    /// Tells where the closest hit of a ray is.
    pub fn tell_surface(&self, index: usize, found: &Found) {
        if let Told::Surface(told) = self.told {
            told(self.place(index), &self.get(index), found);
        }
    }
}

impl fmt::Debug for Asked<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Asked")
            .field("rays", &self.len())
            .finish_non_exhaustive()
    }
}
