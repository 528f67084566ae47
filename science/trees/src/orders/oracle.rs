//! The oracle: a bound for every order, which sends every ray down the shortest path to something that
//! occludes it. No order that knows less than the answer can do better; a ray that nothing occludes visits the same
//! nodes under every order.

use antumbra::parts::{Cost, NodeVisit, Observer, Place, Steps, observe};
use antumbra::{Bvh, Ray};
use rayon::prelude::*;

/// Rays that a thread answers at a time.
const CHUNK: usize = 1 << 10;

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

/// Nodes that rays visit, on the threads of the current rayon pool.
pub fn visits(bvh: &Bvh, rays: &[Ray]) -> Visits {
    sum(rays, |rays| {
        let mut occluded = vec![false; rays.len()];
        let mut costs = vec![Cost::default(); rays.len()];
        bvh.occluded_batch_counted(rays, &mut occluded, &mut costs);
        let mut sum = Visits::default();
        for (occluded, cost) in occluded.into_iter().zip(costs) {
            sum.add(occluded, cost.node_tests.into());
        }
        sum
    })
}

/// Nodes that rays would visit if each went straight to an occluder, by the shortest path to any: what the best
/// order of all, made for each single ray, could save. The tree's own order does not matter.
///
/// The difference to [`visits`] is the most that any order can still save.
pub fn oracle_visits(bvh: &Bvh, rays: &[Ray]) -> Visits {
    sum(rays, |rays| {
        let mut paths = Paths::default();
        observe(bvh, rays, &mut paths);
        paths.sum
    })
}

fn sum(rays: &[Ray], visits: impl Fn(&[Ray]) -> Visits + Sync + Send) -> Visits {
    let chunks: Vec<_> = rays.par_chunks(CHUNK).map(visits).collect();
    let mut sum = Visits::default();
    for visits in &chunks {
        sum.merge(visits);
    }
    sum
}

/// Follows rays to their ends and keeps the length of the shortest path to an occluder.
#[derive(Default)]
struct Paths {
    sum: Visits,
    /// Nodes on the path to each node that the ray has visited, itself included.
    lengths: Vec<u64>,
    shortest: Option<u64>,
}

impl Observer for Paths {
    fn begin(&mut self, _: usize, _: &Ray) {
        self.lengths.clear();
        self.shortest = None;
    }

    fn goes_on(&self) -> bool {
        true
    }

    fn node(&mut self, visit: &NodeVisit) -> u32 {
        let above = self.lengths.get(visit.from.visit as usize).unwrap_or(&0);
        self.lengths.push(above + 1);
        self.lengths.len() as u32 - 1
    }

    fn occluder(&mut self, _: usize, _: usize, from: Place) {
        let length = self.lengths[from.visit as usize];
        self.shortest = Some(
            self.shortest
                .map_or(length, |shortest| shortest.min(length)),
        );
    }

    fn end(&mut self) {
        let tests = self.shortest.unwrap_or(self.lengths.len() as u64);
        self.sum.add(self.shortest.is_some(), tests);
    }
}
