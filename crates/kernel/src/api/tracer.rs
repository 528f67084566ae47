//! Queries of one thread, without allocation.

use super::bvh::Bvh;
use crate::ray::{Hit, Ray};
use crate::trace::memory::Memory;
use crate::trace::query::Closest;

/// Queries on the calling thread, reusing the traversal stacks. Make one per thread.
///
/// [`Bvh::occluded`] and [`Bvh::intersect`] are as fast and need none. The batches of a tracer share nothing with other
/// threads; those of [`Bvh::batch`] take their memory from a pool of the tree.
#[derive(Debug)]
pub struct Tracer<'a> {
    bvh: &'a Bvh,
    memory: Memory,
}

impl<'a> Tracer<'a> {
    pub(crate) fn new(bvh: &'a Bvh) -> Self {
        Self {
            bvh,
            memory: Memory::default(),
        }
    }

    /// Whether anything lies in the ray's interval.
    pub fn occluded(&mut self, ray: &Ray) -> bool {
        let mut answer = [false];
        let rays = core::slice::from_ref(ray);
        self.bvh.occluded_each(&mut self.memory, rays, &mut answer);
        answer[0]
    }

    /// The closest hit in the ray's interval; at equal distances the smallest (inst_id, geom_id,
    /// prim_id).
    pub fn intersect(&mut self, ray: &Ray) -> Option<Hit> {
        let mut answer = [None];
        let rays = core::slice::from_ref(ray);
        self.bvh
            .each::<Closest>(&mut self.memory, rays, &mut answer);
        answer[0]
    }

    /// Whether anything lies in the interval of each ray: `occluded[i]` answers `rays[i]`.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_batch(&mut self, rays: &[Ray], occluded: &mut [bool]) {
        self.bvh.occluded_many(&mut self.memory, rays, occluded);
    }

    /// The closest hit of each ray: `hits[i]` answers `rays[i]`.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn intersect_batch(&mut self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.bvh.many::<Closest>(&mut self.memory, rays, hits);
    }
}
