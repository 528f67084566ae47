//! Our trees, queried with conditions on what counts.

use antumbra::{Brute, Hit, Masks, PrimId, Ray, RayQuery, Visit};

use super::shapes::Sieve;
use crate::bench::engine::{Engine, Label, Query};
use crate::bench::ours::{Api, Ours, Tree};
use crate::harness::{Work, work};

/// Mask of all rays, and masks of which each has a bit in common with it: all is looked at, and nothing is hidden.
const RAY_MASK: u32 = 0b11;

/// Masks of the world.
pub fn masks() -> Masks {
    Masks::new().world(vec![0b10])
}

/// Condition on the hits that count.
#[derive(Clone, Copy)]
pub enum Condition<'a> {
    /// Hits at the ends of the interval as well.
    Closed,
    /// Hits in geometry that the mask of the ray shows.
    Mask,
    /// All but one primitive for each ray.
    Except(&'a [PrimId]),
    /// Hits that a closure accepts: three of four primitives.
    Filter,
    /// The first hit of a visit.
    Visit,
}

impl<'a> Condition<'a> {
    /// All of them, by name.
    pub fn all(starts: &'a [PrimId]) -> [(&'static str, Self); 5] {
        [
            ("closed", Self::Closed),
            ("mask", Self::Mask),
            ("except", Self::Except(starts)),
            ("filter", Self::Filter),
            ("visit", Self::Visit),
        ]
    }

    fn of<'q>(self, query: RayQuery<'q>, ray: usize) -> RayQuery<'q> {
        match self {
            Self::Closed => query.closed(),
            Self::Mask => query.mask(RAY_MASK),
            Self::Except(starts) => query.except(starts[ray]),
            Self::Filter => query.filter(&|hit: &Hit| Sieve.stops(hit.prim_id)),
            Self::Visit => query,
        }
    }
}

/// A tree, the kind of query, and what counts.
pub struct Asked<'t> {
    pub tree: &'t Tree,
    pub api: Api,
    pub condition: Condition<'t>,
}

impl Engine for Asked<'_> {
    fn label(&self) -> Label {
        let (tree, api) = (self.tree, self.api);
        Ours { tree, api }.label()
    }

    fn work<'a>(&'a self, query: Query, rays: &'a [Ray]) -> Option<Box<dyn Work + 'a>> {
        let (bvh, condition) = (&self.tree.bvh, self.condition);
        let batch = move || {
            let batch = bvh.batch(rays);
            match condition {
                Condition::Closed => batch.closed(),
                Condition::Mask => batch.mask(RAY_MASK),
                Condition::Except(starts) => batch.except(starts),
                Condition::Filter => batch.filter(&|_, hit: &Hit| Sieve.stops(hit.prim_id)),
                Condition::Visit => batch,
            }
        };
        let one = move |ray: usize| condition.of(bvh.query(&rays[ray]), ray);
        let (free, none) = (vec![false; rays.len()], vec![None; rays.len()]);
        Some(match (query, self.api, condition) {
            (Query::Intersect, Api::Single, Condition::Visit) => work(none, move |hits| {
                for (ray, hit) in hits.iter_mut().enumerate() {
                    *hit = one(ray).visit_hits(|_| Visit::Accept);
                }
            }),
            (.., Condition::Visit) => return None,
            (Query::Occluded, Api::Single, _) => work(free, move |occluded| {
                for (ray, occluded) in occluded.iter_mut().enumerate() {
                    *occluded = one(ray).occluded();
                }
            }),
            (Query::Intersect, Api::Single, _) => work(none, move |hits| {
                for (ray, hit) in hits.iter_mut().enumerate() {
                    *hit = one(ray).intersect();
                }
            }),
            (Query::Occluded, Api::Batch, _) => {
                work(free, move |occluded| batch().occluded_into(occluded))
            }
            (Query::Intersect, Api::Batch, _) => {
                work(none, move |hits| batch().intersect_into(hits))
            }
        })
    }
}

/// Distance of the first hit that counts by brute force, infinite for none.
pub fn brute(kind: &str, brute: &Brute, ray: &Ray, start: PrimId) -> f32 {
    let query = brute.query(ray);
    let hit = match kind {
        "closed" => query.closed().intersect(),
        "except" => query.except(start).intersect(),
        "filter" => query.filter(&|hit| Sieve.stops(hit.prim_id)).intersect(),
        _ => query.intersect(),
    };
    hit.map_or(f32::INFINITY, |hit| hit.t)
}
