//! Many rays through one tree, compiled once per level.

use antumbra_simd::{Simd, Width, WithSimd};

use super::observe::Observer;
use super::pick::Pick;
use super::query::{Closest, Occlusion};
use super::setup::RaySetup;
use super::single::traverse;
use super::stack::Stack;
use crate::bvh::Bvh;
use crate::ray::{Hit, Ray};

/// Asks of every ray whether anything lies in its interval. `occluded` is as long as `rays`.
pub(crate) struct OccludedBatch<'a, P, O, const N: usize> {
    pub bvh: &'a Bvh<N>,
    pub stack: &'a mut Stack,
    pub rays: &'a [Ray],
    pub occluded: &'a mut [bool],
    pub pick: P,
    pub observer: O,
}

impl<P: Pick, O: Observer, const N: usize> WithSimd<N> for OccludedBatch<'_, P, O, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(mut self, simd: S) {
        for (index, (ray, occluded)) in self.rays.iter().zip(self.occluded).enumerate() {
            self.observer.begin(index);
            self.pick.begin(ray);
            let mut query = Occlusion {
                pick: &mut self.pick,
                observer: &mut self.observer,
                occluded: false,
            };
            if let Some(setup) = RaySetup::new(ray, self.bvh.reach) {
                traverse::<S, N, _>(simd, self.bvh, &setup, self.stack, &mut query);
            }
            *occluded = query.occluded;
        }
    }
}

/// Finds the closest hit of every ray. `hits` is as long as `rays`.
pub(crate) struct IntersectBatch<'a, const N: usize> {
    pub bvh: &'a Bvh<N>,
    pub stack: &'a mut Stack,
    pub rays: &'a [Ray],
    pub hits: &'a mut [Option<Hit>],
}

impl<const N: usize> WithSimd<N> for IntersectBatch<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        for (ray, hit) in self.rays.iter().zip(self.hits) {
            let mut query = Closest { best: None };
            if let Some(setup) = RaySetup::new(ray, self.bvh.reach) {
                traverse::<S, N, _>(simd, self.bvh, &setup, self.stack, &mut query);
            }
            *hit = query.best;
        }
    }
}
