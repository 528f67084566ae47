//! Queued shadow rays, to be traced together. Each carries the light that it brings unless it is occluded.

use antumbra::Ray;
use glam::Vec3;

use super::tracer::Tracer;
use super::{Batch, ENOUGH, SampleCost};
use crate::columns::BLOCK;

/// Queued shadow rays of a batch.
#[derive(Debug, Default)]
pub struct ShadowQueue {
    rays: Vec<Ray>,
    /// Sample that each ray belongs to, and the light that it brings.
    gains: Vec<(u32, Vec3)>,
}

impl ShadowQueue {
    /// Adds a ray that brings `light` to `sample` unless it is occluded.
    #[inline]
    pub fn push(&mut self, ray: Ray, sample: u32, light: Vec3) {
        self.rays.push(ray);
        self.gains.push((sample, light));
    }

    /// Approximate length of the longest queue so far: the room made for rays.
    #[cfg(test)]
    pub fn longest(&self) -> usize {
        self.rays.capacity()
    }

    /// Traces the queue if it has no room for a block of rays. To be called in every loop that pushes. Returns true if the
    /// loop is to end, see [`Tracer::is_stopped`].
    pub fn relieve(&mut self, tracer: &mut Tracer, batch: &mut Batch) -> bool {
        if self.rays.len() + BLOCK <= ENOUGH {
            return false;
        }
        self.flush(tracer, batch);
        tracer.is_stopped()
    }

    /// Traces and empties a queue of light samples.
    pub fn flush(&mut self, tracer: &mut Tracer, batch: &mut Batch) {
        self.trace(tracer, &mut batch.reflected, &mut batch.costs);
    }

    /// Traces and empties a queue of probes.
    pub fn flush_probes(&mut self, tracer: &mut Tracer, batch: &mut Batch) {
        self.trace(tracer, &mut batch.probed, &mut batch.costs);
    }

    fn trace(&mut self, tracer: &mut Tracer, sums: &mut [Vec3], sample_costs: &mut [SampleCost]) {
        let samples = self.gains.iter().map(|&(sample, _)| sample);
        let (occluded, costs) = tracer.occluded(&self.rays, samples);
        for (&(sample, light), &occluded) in self.gains.iter().zip(occluded) {
            if !occluded {
                sums[sample as usize] += light;
            }
        }
        if !sample_costs.is_empty() {
            for (&(sample, _), cost) in self.gains.iter().zip(costs) {
                let sum = &mut sample_costs[sample as usize];
                sum.tests += u64::from(cost.node_tests) + u64::from(cost.prim_tests);
                sum.rays += 1;
            }
            if let Some(queries) = tracer.queries() {
                queries.attribute(&mut self.gains.iter().map(|&(sample, _)| sample));
            }
        }
        self.rays.clear();
        self.gains.clear();
    }
}
