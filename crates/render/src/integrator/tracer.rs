//! Queries of the kernel, counted, timed and recorded.

use std::time::{Duration, Instant};

use antumbra::lab::Cost;
use antumbra::{Bvh, Hit, Isa, Ray};
use serde::{Deserialize, Serialize};

use super::rivals::Rivals;
use crate::training::TrainingSample;

/// Record to keep of the rays besides their answers.
pub enum Observe<'b> {
    /// None: the plain kernel.
    Nothing,
    /// Node and primitive tests.
    Count,
    /// Training sample, and node and primitive tests.
    Learn(Box<TrainingSample>),
    /// Rays of both kinds of query.
    Record(Box<Record>),
    /// Queries answered by several trees.
    Compare(Box<Rivals<'b>>),
}

/// Rays of one thread, in the order of the queries.
#[derive(Debug, Default)]
pub struct Record {
    /// Closest-hit rays with their hits.
    pub closest: Vec<(Ray, Option<Hit>)>,
    /// Shadow rays.
    pub shadow: Vec<Ray>,
}

/// Sums over the queries of one thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counts {
    /// Closest-hit rays.
    pub closest_rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
    /// Shadow rays that are occluded.
    pub occluded_rays: u64,
    /// Node tests of shadow rays, where counted.
    pub node_tests: u64,
    /// Node tests of shadow rays outside of instances, where counted.
    pub top_node_tests: u64,
    /// Primitive tests of shadow rays, where counted.
    pub prim_tests: u64,
    /// Time in closest-hit queries.
    pub closest: Duration,
    /// Time in shadow queries.
    pub shadow: Duration,
}

impl Counts {
    /// Adds the sums of another thread.
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

/// Access of one thread to the tree.
pub struct Tracer<'b> {
    bvh: &'b Bvh,
    observe: Observe<'b>,
    counts: Counts,
    occluded: Vec<bool>,
    costs: Vec<Cost>,
    stop: Option<&'b dyn Fn() -> bool>,
}

impl<'b> Tracer<'b> {
    /// A tracer without queries so far.
    pub fn new(bvh: &'b Bvh, observe: Observe<'b>) -> Self {
        Self {
            bvh,
            observe,
            counts: Counts::default(),
            occluded: Vec::new(),
            costs: Vec::new(),
            stop: None,
        }
    }

    /// Lets integrators ask `stop` whether to end before a batch is complete. Once true, it must stay true.
    pub fn until(mut self, stop: &'b dyn Fn() -> bool) -> Self {
        self.stop = Some(stop);
        self
    }

    /// Whether to end. The batch under way is then incomplete, and must not be used.
    ///
    /// Every loop whose length a scene decides has to ask.
    #[inline]
    pub fn is_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop())
    }

    /// Instruction set of the tree.
    #[inline]
    pub fn isa(&self) -> Isa {
        self.bvh.isa()
    }

    /// Closest hits of `rays`, written over `hits`.
    pub fn intersect(&mut self, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        let start = Instant::now();
        hits.clear();
        hits.resize(rays.len(), None);
        if let Observe::Compare(rivals) = &mut self.observe {
            rivals.intersect(self.bvh, rays, hits);
        } else {
            self.bvh.batch(rays).on_this_thread().intersect(hits);
        }
        if let Observe::Record(record) = &mut self.observe {
            let found = rays.iter().copied().zip(hits.iter().copied());
            record.closest.extend(found);
        }
        self.counts.closest_rays += rays.len() as u64;
        self.counts.closest += start.elapsed();
    }

    /// Whether each of `rays` is occluded, and its cost. No costs unless they are observed.
    pub fn occluded(&mut self, rays: &[Ray]) -> (&[bool], &[Cost]) {
        let start = Instant::now();
        self.occluded.clear();
        self.occluded.resize(rays.len(), false);
        self.costs.clear();
        let counts = match &self.observe {
            Observe::Count => true,
            Observe::Learn(sample) => sample.counts(),
            Observe::Nothing | Observe::Record(_) | Observe::Compare(_) => false,
        };
        if counts {
            self.costs.resize(rays.len(), Cost::default());
        }
        let (occluded, costs) = (&mut self.occluded[..], &mut self.costs[..]);
        match &mut self.observe {
            Observe::Nothing => self.bvh.batch(rays).on_this_thread().occluded(occluded),
            Observe::Count => self.bvh.occluded_batch_counted(rays, occluded, costs),
            Observe::Learn(sample) => {
                sample.occluded(self.bvh, rays, occluded, costs);
            }
            Observe::Record(record) => {
                record.shadow.extend_from_slice(rays);
                self.bvh.batch(rays).on_this_thread().occluded(occluded);
            }
            Observe::Compare(rivals) => rivals.occluded(self.bvh, rays, occluded),
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

    /// Tells the samples that the last rays belong to, which matters where trees are compared.
    #[inline]
    pub fn attribute(&mut self, samples: impl Iterator<Item = u32>) {
        if let Observe::Compare(rivals) = &mut self.observe {
            rivals.attribute(samples);
        }
    }

    /// The trees that are compared, if any are.
    pub fn rivals(&mut self) -> Option<&mut Rivals<'b>> {
        match &mut self.observe {
            Observe::Compare(rivals) => Some(rivals),
            _ => None,
        }
    }

    /// Sums since they were last taken.
    pub fn take_counts(&mut self) -> Counts {
        std::mem::take(&mut self.counts)
    }

    /// Sums, and the training sample if there is one.
    pub fn finish(self) -> (Counts, Option<TrainingSample>) {
        let sample = match self.observe {
            Observe::Learn(sample) => Some(*sample),
            _ => None,
        };
        (self.counts, sample)
    }

    /// The trees that were compared, if any were.
    pub fn into_rivals(self) -> Option<Rivals<'b>> {
        match self.observe {
            Observe::Compare(rivals) => Some(*rivals),
            _ => None,
        }
    }

    /// Recorded rays. None unless recording was asked for.
    pub fn into_record(self) -> Record {
        match self.observe {
            Observe::Record(record) => *record,
            _ => Record::default(),
        }
    }
}
