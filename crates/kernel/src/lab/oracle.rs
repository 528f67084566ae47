//! The oracle: a bound for every order, which sends every ray down the shortest path to something that
//! occludes it. No order that knows less than the answer can do better; a ray that nothing occludes visits the same
//! nodes under every order.

use alloc::vec::Vec;

use crate::learn::ray_log::{RayLog, Visit};
use crate::tree::node::ChildKind;
use crate::tree::wide::Tree;

/// Node tests of occlusion queries, counted separately for rays that are occluded and rays that are not. A node test is
/// one of all N boxes of a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Number of rays that are occluded.
    pub occluded_rays: u64,
    /// Sum of the node tests of those rays.
    pub occluded_tests: u64,
    /// Number of rays that are not occluded, also those that cannot hit anything and test nothing.
    pub unoccluded_rays: u64,
    /// Sum of the node tests of those rays.
    pub unoccluded_tests: u64,
}

impl Visits {
    /// Node tests per occluded ray; 0 without any.
    pub fn occluded(&self) -> f64 {
        mean(self.occluded_tests, self.occluded_rays)
    }

    /// Node tests per ray that is not occluded; 0 without any.
    pub fn unoccluded(&self) -> f64 {
        mean(self.unoccluded_tests, self.unoccluded_rays)
    }

    /// Node tests per ray; 0 without any.
    pub fn all(&self) -> f64 {
        mean(
            self.occluded_tests + self.unoccluded_tests,
            self.occluded_rays + self.unoccluded_rays,
        )
    }

    /// Adds the counts of other rays.
    pub fn merge(&mut self, other: &Self) {
        self.occluded_rays += other.occluded_rays;
        self.occluded_tests += other.occluded_tests;
        self.unoccluded_rays += other.unoccluded_rays;
        self.unoccluded_tests += other.unoccluded_tests;
    }

    /// Adds one ray.
    pub(crate) fn add(&mut self, occluded: bool, tests: u64) {
        if occluded {
            self.occluded_rays += 1;
            self.occluded_tests += tests;
        } else {
            self.unoccluded_rays += 1;
            self.unoccluded_tests += tests;
        }
    }
}

fn mean(sum: u64, count: u64) -> f64 {
    if count == 0 {
        0.0
    } else {
        sum as f64 / count as f64
    }
}

/// Adds the rays of a log, each by its shortest path.
pub(crate) fn add_shortest(tree: &Tree, log: &RayLog, sum: &mut Visits) {
    let mut shortest = Vec::new();
    for range in log.ranges() {
        let visits = &log.visits()[range];
        // Children follow their parents, so going backwards visits them first.
        shortest.clear();
        shortest.resize(visits.len(), 0u64);
        for place in (0..visits.len()).rev() {
            shortest[place] = below(tree, visits, place, &shortest);
        }
        match visits.first() {
            Some(root) if root.occluding != 0 => sum.add(true, shortest[0]),
            _ => sum.add(false, visits.len() as u64),
        }
    }
}

/// Nodes on the shortest path from a visit to an occluder, both ends included; of no meaning if there is none.
fn below(tree: &Tree, visits: &[Visit], place: usize, known: &[u64]) -> u64 {
    let visit = &visits[place];
    let node = tree.nodes.get(visit.node as usize);
    let mut least = u64::MAX;
    let mut next = place + 1;
    for slot in 0..node.len() {
        let occludes = visit.occluding >> slot & 1 == 1;
        if visit.followed >> slot & 1 == 1 {
            if occludes {
                least = least.min(known[next]);
            }
            next += visits[next].len as usize;
        } else if occludes && matches!(node.child(slot).kind(), ChildKind::Leaf(_)) {
            least = 0;
        }
    }
    least.saturating_add(1)
}
