//! Our trees, queried with conditions on what counts.

use antumbra::{Brute, Bvh, Hit, Masks, PrimId, Ray, Visit};

use super::shapes::Sieve;
use crate::bench::engine::{Answers, Engine, Label, Query, Work};
use crate::bench::ours::{Api, Ours, Tree};

/// Mask of all rays, and masks of which each has a bit in common with it: all is looked at, and nothing is hidden.
const RAY_MASK: u32 = 0b11;

/// Masks of the world.
pub fn masks() -> Masks {
    let mut masks = Masks::default();
    masks.world = vec![0b10];
    masks
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

impl Condition<'_> {
    /// Whether there is such a query.
    pub fn has(self, query: Query, api: Api) -> bool {
        !matches!(self, Self::Visit) || (query, api) == (Query::Intersect, Api::Single)
    }
}

/// A tree, the kind of query, and what counts.
pub struct Asked<'t> {
    pub tree: &'t Tree,
    pub api: Api,
    /// All rays, of which the work of a thread is a part.
    pub all: &'t [Ray],
    pub condition: Condition<'t>,
}

impl Engine for Asked<'_> {
    fn label(&self) -> Label {
        let (tree, api) = (self.tree, self.api);
        Ours { tree, api }.label()
    }

    fn work<'a>(&'a self, query: Query, rays: &'a [Ray]) -> Option<Box<dyn Work + 'a>> {
        // Everything is asked on one thread, so that primitives left out are those of the same places.
        (self.condition.has(query, self.api) && rays.len() == self.all.len()).then(|| {
            Box::new(Asking {
                asked: self,
                query,
                rays,
                occluded: vec![false; rays.len()],
                hits: vec![None; rays.len()],
            }) as Box<dyn Work>
        })
    }
}

struct Asking<'a> {
    asked: &'a Asked<'a>,
    query: Query,
    rays: &'a [Ray],
    occluded: Vec<bool>,
    hits: Vec<Option<Hit>>,
}

impl Asking<'_> {
    fn single(&mut self, bvh: &Bvh) {
        let rays = self.rays.iter().enumerate();
        match self.query {
            Query::Occluded => {
                for ((index, ray), answer) in rays.zip(&mut self.occluded) {
                    *answer = match self.asked.condition {
                        Condition::Closed => bvh.occluded(&ray.closed()),
                        Condition::Mask => bvh.query(ray).mask(RAY_MASK).occluded(),
                        Condition::Except(starts) => {
                            bvh.query(ray).except(starts[index]).occluded()
                        }
                        Condition::Filter => bvh
                            .query(ray)
                            .filter(&|hit| Sieve.stops(hit.prim_id))
                            .occluded(),
                        Condition::Visit => bvh.query(ray).visit_hits(|_| Visit::Accept).is_some(),
                    }
                }
            }
            Query::Intersect => {
                for ((index, ray), answer) in rays.zip(&mut self.hits) {
                    *answer = match self.asked.condition {
                        Condition::Closed => bvh.intersect(&ray.closed()),
                        Condition::Mask => bvh.query(ray).mask(RAY_MASK).intersect(),
                        Condition::Except(starts) => {
                            bvh.query(ray).except(starts[index]).intersect()
                        }
                        Condition::Filter => bvh
                            .query(ray)
                            .filter(&|hit| Sieve.stops(hit.prim_id))
                            .intersect(),
                        Condition::Visit => bvh.query(ray).visit_hits(|_| Visit::Accept),
                    }
                }
            }
        }
    }

    fn batch(&mut self, bvh: &Bvh) {
        let mut batch = bvh.batch(self.rays);
        match self.asked.condition {
            Condition::Closed => batch = batch.closed(),
            Condition::Mask => batch = batch.mask(RAY_MASK),
            Condition::Except(starts) => batch = batch.except(starts),
            Condition::Filter => batch = batch.filter(&|_, hit| Sieve.stops(hit.prim_id)),
            Condition::Visit => {}
        }
        match self.query {
            Query::Occluded => batch.occluded_into(&mut self.occluded),
            Query::Intersect => batch.intersect_into(&mut self.hits),
        }
    }
}

impl Work for Asking<'_> {
    fn reset(&mut self) {
        self.occluded.fill(false);
        self.hits.fill(None);
    }

    fn run(&mut self) {
        let bvh = &self.asked.tree.bvh;
        match self.asked.api {
            Api::Single => self.single(bvh),
            Api::Batch => self.batch(bvh),
        }
    }

    fn answers(&self) -> Answers {
        match self.query {
            Query::Occluded => Answers::Occluded(self.occluded.clone()),
            Query::Intersect => Answers::of_hits(&self.hits),
        }
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
