//! The answers that every engine is compared with.
//!
//! Our kernel is watertight and promises the same bits for every tree, so one tree says what is right. That
//! tree is compared with brute force on as many rays as time allows.

use antumbra::{Brute, Bvh, Hit, Ray};
use rayon::prelude::*;

use super::engine::Query;
use crate::harness::{Answer, Answers};

/// Rays of a kind that are compared with brute force, evenly spread.
const BRUTE_RAYS: usize = 128;
/// Fewer in large scenes: no more triangle tests than this.
const BRUTE_TESTS: usize = 400_000_000;
/// But not fewer than this.
const LEAST_BRUTE_RAYS: usize = 16;

/// Right answers to a list of rays.
pub struct Reference {
    occluded: Answers,
    distances: Answers,
    hits: Vec<Option<Hit>>,
}

impl Reference {
    /// Queries a tree ray by ray.
    pub fn new(bvh: &Bvh, rays: &[Ray]) -> Self {
        let occluded = rays.iter().map(|ray| bvh.occluded(ray)).collect();
        let hits: Vec<_> = rays.iter().map(|ray| bvh.intersect(ray)).collect();
        Self {
            occluded: Answers::Occluded(occluded),
            distances: Answer::all(&hits),
            hits,
        }
    }

    /// The answers to a query.
    pub fn answers(&self, query: Query) -> &Answers {
        match query {
            Query::Occluded => &self.occluded,
            Query::Intersect => &self.distances,
        }
    }

    /// Compares some of the answers with brute force: how many, and how many of these are not the same bits.
    /// `triangles` says how many there are, an object once for every instance: more than are tested,
    /// because instances whose box is missed are passed over.
    pub fn check(&self, rays: &[Ray], brute: &Brute, triangles: usize) -> [usize; 2] {
        let affordable = (BRUTE_TESTS / triangles.max(1)).max(LEAST_BRUTE_RAYS);
        let count = BRUTE_RAYS.min(affordable).min(rays.len());
        let Answers::Occluded(occluded) = &self.occluded else {
            return [0; 2];
        };
        let wrong = |turn: usize| {
            let index = turn * rays.len() / count;
            let hit = brute.intersect(&rays[index]);
            hit != self.hits[index] || hit.is_some() != occluded[index]
        };
        let wrong = (0..count).into_par_iter().filter(|&turn| wrong(turn));
        [count, wrong.count()]
    }
}
