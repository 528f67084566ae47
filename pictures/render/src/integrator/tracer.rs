//! Queries of the kernel, counted, timed and observed.

use std::time::{Duration, Instant};

use antumbra::parts::{Cost, Steps};
use antumbra::{Bvh, Hit, Isa, Ray};
use serde::{Deserialize, Serialize};

use super::queries::Queries;
use crate::surface::Times;
use crate::training::TrainingSample;
use crate::world::World;

/// Record to keep of the rays besides their answers.
pub enum Observe<'b> {
    /// None: the plain kernel.
    Nothing,
    /// Node and primitive tests.
    Count,
    /// Training sample, and node and primitive tests.
    Learn(Box<TrainingSample>),
    /// Queries that somebody else answers.
    Each(&'b mut (dyn Queries + 'b)),
}

/// Sums over the queries of one thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counts {
    /// Number of closest-hit rays.
    pub closest_rays: u64,
    /// Number of shadow rays, occluded or not.
    pub shadow_rays: u64,
    /// Number of shadow rays that are occluded.
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
    /// The tree that moves, if there is one, and the times that its rays can have. The moving tree answers. `bvh`, in which
    /// everything is half way, then only counts and learns.
    moving: Option<(&'b Bvh, Times)>,
    /// Time of each sample of the batch, from 0 to 1.
    sample_times: Vec<f32>,
    /// Times of the rays under way.
    times: Vec<f32>,
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
            moving: None,
            sample_times: Vec::new(),
            times: Vec::new(),
        }
    }

    /// Queries are answered by a tree of this world that moves, if there is one.
    pub fn moving(mut self, world: &World, moving: Option<&'b Bvh>) -> Self {
        self.moving = moving.zip(world.shapes.times());
        self
    }

    /// Begins a batch of samples at these times.
    pub fn begin(&mut self, times: &[f32]) {
        if let Some((_, of_world)) = self.moving {
            self.sample_times.clear();
            (self.sample_times).extend(times.iter().map(|time| of_world.nearest(*time)));
        }
    }

    /// Lets integrators call `stop`, which says whether to end before a batch is complete. Once true, it must stay true.
    pub fn until(mut self, stop: &'b dyn Fn() -> bool) -> Self {
        self.stop = Some(stop);
        self
    }

    /// Whether to end. The batch under way is then incomplete, and must not be used.
    ///
    /// Every loop whose length a scene decides has to call this.
    #[inline]
    pub fn is_stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop())
    }

    /// Instruction set of the tree.
    #[inline]
    pub fn isa(&self) -> Isa {
        self.bvh.isa()
    }

    /// Closest hits of `rays`, which belong to `samples` of the batch, written over `hits`. Ids of instances have the
    /// [time](Times) where something moves.
    pub fn intersect(
        &mut self,
        rays: &[Ray],
        samples: impl Iterator<Item = u32>,
        hits: &mut Vec<Option<Hit>>,
    ) {
        let start = Instant::now();
        hits.clear();
        hits.resize(rays.len(), None);
        if let Some((moving, of_world)) = self.moving {
            self.times.clear();
            (self.times).extend(samples.map(|sample| self.sample_times[sample as usize]));
            let batch = moving.batch(rays).at(&self.times);
            batch.on_this_thread().intersect_into(hits);
            for (hit, time) in hits.iter_mut().zip(&self.times) {
                if let Some(hit) = hit {
                    hit.inst_id = of_world.join(hit.inst_id, *time);
                }
            }
        } else if let Observe::Each(queries) = &mut self.observe {
            queries.intersect(self.bvh, rays, hits);
        } else {
            self.bvh.batch(rays).on_this_thread().intersect_into(hits);
        }
        self.counts.closest_rays += rays.len() as u64;
        self.counts.closest += start.elapsed();
    }

    /// Whether each of `rays`, which belong to `samples` of the batch, is occluded, and its cost. There are no costs unless they
    /// are observed. Where something moves, they are costs of the tree half way.
    pub fn occluded(
        &mut self,
        rays: &[Ray],
        samples: impl Iterator<Item = u32>,
    ) -> (&[bool], &[Cost]) {
        let start = Instant::now();
        self.occluded.clear();
        self.occluded.resize(rays.len(), false);
        self.costs.clear();
        let counts = match &self.observe {
            Observe::Count => true,
            Observe::Learn(sample) => sample.counts(),
            Observe::Nothing | Observe::Each(_) => false,
        };
        if counts {
            self.costs.resize(rays.len(), Cost::default());
        }
        let (occluded, costs) = (&mut self.occluded[..], &mut self.costs[..]);
        match &mut self.observe {
            Observe::Nothing if self.moving.is_some() => {}
            Observe::Nothing => self
                .bvh
                .batch(rays)
                .on_this_thread()
                .occluded_into(occluded),
            Observe::Count => self.bvh.occluded_batch_counted(rays, occluded, costs),
            Observe::Learn(sample) => {
                sample.occluded(self.bvh, rays, occluded, costs);
            }
            Observe::Each(queries) => queries.occluded(self.bvh, rays, occluded),
        }
        if let Some((moving, _)) = self.moving {
            self.times.clear();
            (self.times).extend(samples.map(|sample| self.sample_times[sample as usize]));
            let batch = moving.batch(rays).at(&self.times);
            batch.on_this_thread().occluded_into(occluded);
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

    /// The observer that answers the queries, if there is one.
    pub fn queries(&mut self) -> Option<&mut (dyn Queries + 'b)> {
        match &mut self.observe {
            Observe::Each(queries) => Some(&mut **queries),
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
}
