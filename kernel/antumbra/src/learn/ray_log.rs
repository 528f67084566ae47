//! Everything that each ray of a log hits in a wide tree when it does not stop at the first occluder: at every node
//! that it comes to, which boxes it hits and below which of them something occludes it.
//!
//! So the cost of the ray is known for any order of children, without an assumption on how the hits of different
//! children depend on each other. Slots are the slots of the tree as it was logged.

use alloc::vec::Vec;

use crate::hash;
use crate::ray::Ray;
use crate::trace::observe::{NodeVisit, Observer, Place};

/// A ray at a node. The visits of a ray are in the depth-first order of slots. A visit is followed by the visit of the
/// first child that the ray goes on to and all visits below it, then by the next child's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Visit {
    /// The node.
    pub node: u32,
    /// Number of visits below this one, and one for itself.
    pub len: u32,
    /// Slots whose boxes the ray hits.
    pub hit: u16,
    /// Slots hit below which something occludes the ray.
    pub occluding: u16,
    /// Slots hit below which the ray comes to a node: inner ones, and instances that let it in.
    pub followed: u16,
}

/// One ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoggedRay {
    /// A hash of the ray.
    pub key: u64,
    /// Where its visits end.
    pub end: usize,
}

/// The visits of some rays, 16 bytes each. Rays that cannot hit anything have none and are left out.
#[derive(Clone, Debug, Default)]
pub(crate) struct RayLog {
    pub rays: Vec<LoggedRay>,
    pub visits: Vec<Visit>,
}

impl RayLog {
    /// The visits of all rays, one after the other.
    pub fn visits(&self) -> &[Visit] {
        &self.visits
    }

    /// Adds other rays.
    pub fn append(&mut self, other: &Self) {
        let first = self.visits.len();
        let rays = other.rays.iter().map(|ray| LoggedRay {
            end: first + ray.end,
            ..*ray
        });
        self.rays.extend(rays);
        self.visits.extend_from_slice(&other.visits);
    }

    /// Where the visits of each ray begin and end, in the order in which rays were added.
    pub fn ranges(&self) -> impl Iterator<Item = core::ops::Range<usize>> {
        let mut first = 0;
        self.rays
            .iter()
            .map(move |ray| core::mem::replace(&mut first, ray.end)..ray.end)
    }

    /// [`RayLog::ranges`] in an order that depends only on the rays, not on who logged which.
    pub fn sorted_ranges(&self) -> Vec<core::ops::Range<usize>> {
        let mut rays: Vec<_> = self.rays.iter().zip(self.ranges()).collect();
        rays.sort_by(|(a, a_range), (b, b_range)| {
            let visits = |range: &core::ops::Range<usize>| &self.visits[range.clone()];
            let same = || visits(a_range).cmp(visits(b_range));
            a.key.cmp(&b.key).then_with(same)
        });
        rays.into_iter().map(|(_, range)| range).collect()
    }
}

/// Whether the same rays were logged, in any order.
impl PartialEq for RayLog {
    fn eq(&self, other: &Self) -> bool {
        let (a, b) = (self.sorted_ranges(), other.sorted_ranges());
        a.len() == b.len()
            && a.into_iter()
                .zip(b)
                .all(|(a, b)| self.visits[a] == other.visits[b])
    }
}

impl Eq for RayLog {}

/// Follows rays to their ends and writes a [`RayLog`]: slots must be visited in ascending order.
///
/// A visit is complete when all visits below it are known. Visits below it follow it, so one pass from the last visit
/// of a ray to the first completes them all.
pub(crate) struct Following<'a> {
    log: &'a mut RayLog,
    /// A hash of the ray.
    key: u64,
    /// Where in the log the visits of the ray begin.
    first: usize,
    /// Where the ray came from to each of them.
    from: Vec<Place>,
}

impl<'a> Following<'a> {
    pub fn new(log: &'a mut RayLog) -> Self {
        Self {
            log,
            key: 0,
            first: 0,
            from: Vec::new(),
        }
    }
}

impl Observer for Following<'_> {
    fn begin(&mut self, _index: usize, ray: &Ray) {
        self.key = hash::of_ray(0, ray);
        self.first = self.log.visits.len();
        self.from.clear();
    }

    fn goes_on(&self) -> bool {
        true
    }

    fn node(&mut self, visit: &NodeVisit) -> u32 {
        let number = self.from.len() as u32;
        self.from.push(visit.from);
        // Slots are in descending lanes.
        let hit = visit.lanes.reverse_bits() >> (u32::BITS - visit.width as u32);
        self.log.visits.push(Visit {
            node: visit.node as u32,
            len: 1,
            hit: hit as u16,
            occluding: 0,
            followed: 0,
        });
        number
    }

    fn occluder(&mut self, _leaf: usize, _lane: usize, from: Place) {
        self.log.visits[self.first + from.visit as usize].occluding |= 1 << from.slot;
    }

    fn end(&mut self) {
        let visits = &mut self.log.visits[self.first..];
        for (index, from) in self.from.iter().enumerate().rev() {
            let Visit { len, occluding, .. } = visits[index];
            if *from != Place::NONE {
                let above = &mut visits[from.visit as usize];
                above.len += len;
                above.followed |= 1 << from.slot;
                above.occluding |= u16::from(occluding != 0) << from.slot;
            }
        }
        let end = self.log.visits.len();
        if end > self.first {
            let key = self.key;
            self.log.rays.push(LoggedRay { key, end });
        }
    }
}
