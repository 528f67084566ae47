//! The kernel's queries with their book-keeping: how many, how long, at what cost.

use std::time::{Duration, Instant};

use antumbra::{AnyBvh, Cost, Hit, Ray};
use serde::{Deserialize, Serialize};

use crate::training::sample::Evidence;

/// What is recorded about shadow rays besides the answer.
#[derive(Debug)]
pub enum Observe {
    /// Nothing; the plain kernel.
    Nothing,
    /// Node and primitive tests.
    Count,
    /// What is learned from, and the tests.
    Learn(Box<Evidence>),
    /// The rays themselves, of both kinds of query.
    Record(Box<Record>),
}

/// The rays of one worker in the order in which they were asked.
#[derive(Debug, Default)]
pub struct Record {
    /// Closest-hit rays with what they met.
    pub closest: Vec<(Ray, Option<Hit>)>,
    /// Shadow rays.
    pub shadow: Vec<Ray>,
}

/// Sums over the queries of one worker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counts {
    /// Closest-hit rays.
    pub closest_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Shadow rays that met something.
    pub occluded_rays: u64,
    /// Box tests of shadow rays, where counted.
    pub node_tests: u64,
    /// Those of them outside of instances.
    pub top_node_tests: u64,
    /// Primitive tests of shadow rays, where counted.
    pub prim_tests: u64,
    /// Time in closest-hit queries.
    pub closest: Duration,
    /// Time in shadow queries.
    pub shadow: Duration,
}

impl Counts {
    /// Adds the sums of another worker.
    pub fn add(&mut self, other: &Self) {
        self.closest_rays += other.closest_rays;
        self.shadow_rays += other.shadow_rays;
        self.occluded_rays += other.occluded_rays;
        self.node_tests += other.node_tests;
        self.top_node_tests += other.top_node_tests;
        self.prim_tests += other.prim_tests;
        self.closest += other.closest;
        self.shadow += other.shadow;
    }
}

/// One worker's access to the tree.
pub struct Tracer<'b> {
    bvh: &'b AnyBvh,
    tracer: antumbra::Tracer<'b>,
    observe: Observe,
    counts: Counts,
    occluded: Vec<bool>,
    costs: Vec<Cost>,
}

impl<'b> Tracer<'b> {
    /// A tracer that has asked nothing yet.
    pub fn new(bvh: &'b AnyBvh, observe: Observe) -> Self {
        Self {
            bvh,
            tracer: bvh.tracer(),
            observe,
            counts: Counts::default(),
            occluded: Vec::new(),
            costs: Vec::new(),
        }
    }

    /// Closest hits of `rays`, written over `hits`.
    pub fn intersect(&mut self, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        let start = Instant::now();
        hits.clear();
        hits.resize(rays.len(), None);
        self.tracer.intersect_batch(rays, hits);
        if let Observe::Record(record) = &mut self.observe {
            let found = rays.iter().copied().zip(hits.iter().copied());
            record.closest.extend(found);
        }
        self.counts.closest_rays += rays.len() as u64;
        self.counts.closest += start.elapsed();
    }

    /// Whether each of `rays` meets anything, and what each cost (nothing unless observed).
    pub fn occluded(&mut self, rays: &[Ray]) -> (&[bool], &[Cost]) {
        let start = Instant::now();
        self.occluded.clear();
        self.occluded.resize(rays.len(), false);
        self.costs.clear();
        let counts = match &self.observe {
            Observe::Count => true,
            Observe::Learn(evidence) => evidence.counts(),
            Observe::Nothing | Observe::Record(_) => false,
        };
        if counts {
            self.costs.resize(rays.len(), Cost::default());
        }
        let (occluded, costs) = (&mut self.occluded[..], &mut self.costs[..]);
        match &mut self.observe {
            Observe::Nothing => self.tracer.occluded_batch(rays, occluded),
            Observe::Count => self.bvh.occluded_batch_counted(rays, occluded, costs),
            Observe::Learn(evidence) => {
                evidence.occluded(self.bvh, &mut self.tracer, rays, occluded, costs);
            }
            Observe::Record(record) => {
                record.shadow.extend_from_slice(rays);
                self.tracer.occluded_batch(rays, occluded);
            }
        }
        self.counts.shadow_rays += rays.len() as u64;
        self.counts.occluded_rays += occluded.iter().filter(|&&o| o).count() as u64;
        for cost in costs {
            self.counts.node_tests += u64::from(cost.node_tests);
            self.counts.top_node_tests += u64::from(cost.top_node_tests);
            self.counts.prim_tests += u64::from(cost.prim_tests);
        }
        self.counts.shadow += start.elapsed();
        (&self.occluded, &self.costs)
    }

    /// The sums since they were last taken.
    pub fn take_counts(&mut self) -> Counts {
        std::mem::take(&mut self.counts)
    }

    /// The sums, and what is learned from if that was asked for.
    pub fn finish(self) -> (Counts, Option<Evidence>) {
        let evidence = match self.observe {
            Observe::Learn(evidence) => Some(*evidence),
            Observe::Nothing | Observe::Count | Observe::Record(_) => None,
        };
        (self.counts, evidence)
    }

    /// The rays asked so far; none unless they were to be recorded.
    pub fn into_record(self) -> Record {
        match self.observe {
            Observe::Record(record) => *record,
            _ => Record::default(),
        }
    }
}
