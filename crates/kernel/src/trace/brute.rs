//! No tree at all: every primitive against every ray, in plain scalar code. The oracle that every tree,
//! order and level is compared with, and the first thing to try when an answer is in doubt.

use super::setup::RaySetup;
use crate::geometry::QueryKind;
use crate::primitives::Primitives;
use crate::ray::{Hit, Ray};

/// A scene without an acceleration structure, with the queries of [`crate::AnyBvh`].
#[derive(Clone, Debug)]
pub struct Brute {
    primitives: Primitives,
    reach: f32,
}

impl Brute {
    /// Keeps the primitives as they are.
    pub fn new(primitives: Primitives) -> Self {
        let reach = primitives.bounds().reach();
        Self { primitives, reach }
    }

    /// Whether anything lies in the ray's interval.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let Some(setup) = RaySetup::new(ray, self.reach) else {
            return false;
        };
        (0..self.primitives.len()).any(|index| {
            let hit = self.primitives.hit(index, &setup, QueryKind::Occluded);
            hit.is_some()
        })
    }

    /// The closest hit in the ray's interval; at equal distances the smallest (geom_id, prim_id).
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let setup = RaySetup::new(ray, self.reach)?;
        let mut best = Hit::none(ray.tfar);
        for index in 0..self.primitives.len() {
            if let Some(hit) = self.primitives.hit(index, &setup, QueryKind::Intersect) {
                hit.improve(&mut best);
            }
        }
        best.found()
    }

    /// [`Brute::occluded`] for every ray.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.occluded(ray);
        }
    }

    /// [`Brute::intersect`] for every ray.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "one answer per ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.intersect(ray);
        }
    }
}
