//! Answers of occlusion rays with what they cost.

use antumbra::parts::{Cost, Steps};
use antumbra::{Bvh, Ray};
use rayon::prelude::*;

/// Answers and costs of rays, on all threads.
pub fn counted(bvh: &Bvh, rays: &[Ray]) -> (Vec<bool>, Vec<Cost>) {
    const CHUNK: usize = 4096;
    let mut answers = vec![false; rays.len()];
    let mut costs = vec![Cost::default(); rays.len()];
    rays.par_chunks(CHUNK)
        .zip(answers.par_chunks_mut(CHUNK))
        .zip(costs.par_chunks_mut(CHUNK))
        .for_each(|((rays, answers), costs)| bvh.occluded_batch_counted(rays, answers, costs));
    (answers, costs)
}

/// Sums of costs: node tests, primitive tests, and node tests outside of instances.
pub fn sum(costs: &[Cost]) -> [u64; 3] {
    costs.iter().fold([0; 3], |[nodes, prims, top], cost| {
        [
            nodes + u64::from(cost.node_tests),
            prims + u64::from(cost.prim_tests),
            top + u64::from(cost.top_node_tests),
        ]
    })
}
