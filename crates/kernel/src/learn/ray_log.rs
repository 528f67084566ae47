//! What each ray of a log meets in a wide tree when it does not stop at the first occluder: at every node that it
//! comes to, which boxes it hits and below which of them something occludes it.
//!
//! That is enough to know what the ray would cost with the children in any order, and needs no assumption on how
//! the hits of different children depend on each other. Slots are those of the tree as it was logged.

/// A ray at a node. The visits of a ray stand in the depth-first order of slots: behind a visit stand those of the
/// first child that the ray goes on to, and all below it, then those of the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Visit {
    /// The node.
    pub node: u32,
    /// How many visits this is, with those below it.
    pub len: u32,
    /// Slots whose boxes the ray hits.
    pub hit: u16,
    /// Those of them below which something occludes the ray.
    pub occluding: u16,
    /// Those of them below which the ray comes to a node: inner ones, and instances that let it in.
    pub followed: u16,
    /// The signs of its direction, in the space of the node: see
    /// [`RaySetup::octant`](crate::geometry::ray_setup::RaySetup::octant).
    pub octant: u8,
}

/// One ray.
#[derive(Clone, Copy, Debug)]
struct LoggedRay {
    /// A hash of the ray.
    key: u64,
    /// Where its visits end.
    end: usize,
}

/// The visits of some rays, 16 bytes each. Rays that cannot hit anything have none and are left out.
#[derive(Clone, Debug, Default)]
pub(crate) struct RayLog {
    rays: Vec<LoggedRay>,
    visits: Vec<Visit>,
}

impl RayLog {
    /// Of all rays, one after the other.
    pub fn visits(&self) -> &[Visit] {
        &self.visits
    }

    /// Adds a visit, to be completed, and returns its place.
    pub fn push(&mut self, visit: Visit) -> usize {
        self.visits.push(visit);
        self.visits.len() - 1
    }

    pub fn visit_mut(&mut self, place: usize) -> &mut Visit {
        &mut self.visits[place]
    }

    /// The visits since the last call are those of one ray.
    pub fn end_ray(&mut self, key: u64) {
        let end = self.visits.len();
        if end > self.rays.last().map_or(0, |ray| ray.end) {
            self.rays.push(LoggedRay { key, end });
        }
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

    /// The same in an order that depends only on what the rays are, not on who logged which.
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
