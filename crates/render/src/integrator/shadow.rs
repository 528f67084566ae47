//! Shadow rays waiting to be traced together, each with the light it brings if it gets through.

use antumbra::Ray;
use glam::Vec3;

use super::{ENOUGH, SampleCost, Wave};
use crate::integrator::tracer::Tracer;

/// Shadow rays of a wave.
#[derive(Debug, Default)]
pub struct ShadowQueue {
    rays: Vec<Ray>,
    samples: Vec<u32>,
    light: Vec<Vec3>,
}

impl ShadowQueue {
    /// Adds a ray that brings `light` to `sample` unless it is occluded.
    #[inline]
    pub fn push(&mut self, ray: Ray, sample: u32, light: Vec3) {
        self.rays.push(ray);
        self.samples.push(sample);
        self.light.push(light);
    }

    /// How many rays ever waited together, about: the room made for them.
    #[cfg(test)]
    pub fn longest(&self) -> usize {
        self.rays.capacity()
    }

    /// Traces the queue if it is long. Whoever pushes in a loop calls this in the same loop.
    pub fn relieve(&mut self, tracer: &mut Tracer, wave: &mut Wave) {
        if self.rays.len() >= ENOUGH {
            self.flush(tracer, wave);
        }
    }

    /// Traces and empties the queue.
    pub fn flush(&mut self, tracer: &mut Tracer, wave: &mut Wave) {
        self.trace(tracer, &mut wave.reflected, &mut wave.costs);
    }

    /// The same for a queue of probes.
    pub fn flush_probes(&mut self, tracer: &mut Tracer, wave: &mut Wave) {
        self.trace(tracer, &mut wave.probed, &mut wave.costs);
    }

    fn trace(&mut self, tracer: &mut Tracer, sums: &mut [Vec3], sample_costs: &mut [SampleCost]) {
        let (occluded, costs) = tracer.occluded(&self.rays);
        for ((&sample, &light), &occluded) in self.samples.iter().zip(&self.light).zip(occluded) {
            if !occluded {
                sums[sample as usize] += light;
            }
        }
        if !sample_costs.is_empty() {
            for (&sample, cost) in self.samples.iter().zip(costs) {
                let sum = &mut sample_costs[sample as usize];
                sum.tests += u64::from(cost.node_tests) + u64::from(cost.prim_tests);
                sum.rays += 1;
            }
        }
        self.rays.clear();
        self.samples.clear();
        self.light.clear();
    }
}
