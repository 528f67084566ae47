//! No tree at all: every primitive against every ray, in plain scalar code. The oracle that every tree,
//! order and level is compared with, and the first thing to try when an answer is in doubt.

use alloc::vec::Vec;

use antumbra_simd::Scalar;

use crate::geometry::QueryKind;
use crate::geometry::best::Best;
use crate::geometry::instance_ray::Interval;
use crate::geometry::masks::SceneMasks;
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::geometry::ray_setup::RaySetup;
use crate::prim_id::PrimId;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::visit::{Ranked, Visit};

/// A scene without an acceleration structure, with the queries of [`crate::Bvh`].
#[derive(Clone, Debug)]
pub struct Brute {
    primitives: Primitives,
    reach: f32,
    pub(crate) masks: Option<SceneMasks>,
}

impl Brute {
    /// Keeps the primitives as they are.
    pub fn new(primitives: Primitives) -> Self {
        let reach = primitives.bounds().reach();
        Self {
            primitives,
            reach,
            masks: None,
        }
    }

    pub(crate) fn primitives(&self) -> &Primitives {
        &self.primitives
    }

    /// Whether anything lies in the ray's interval.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let Some(world) = RaySetup::new(ray, self.reach) else {
            return false;
        };
        let mut object = RaySetup::IDLE;
        any_hit(&self.primitives, &world)
            || self.primitives.instances.iter().any(|placed| {
                let entered = placed.placement.enter(Scalar, &world, &mut object);
                let primitives = &self.primitives.objects[placed.object as usize];
                entered.is_some() && any_hit(primitives, &object)
            })
    }

    /// The closest hit in the ray's interval; at equal distances the smallest (inst_id, geom_id, prim_id).
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let world = RaySetup::new(ray, self.reach)?;
        let mut best = Best::none(ray.tfar);
        offer_hits(&self.primitives, &world, &mut best);
        let mut object = RaySetup::IDLE;
        for placed in &self.primitives.instances {
            if let Some(interval) = placed.placement.enter(Scalar, &world, &mut object) {
                best.enter(interval, placed.placement.inst_id);
                let primitives = &self.primitives.objects[placed.object as usize];
                offer_hits(primitives, &object, &mut best);
                best.exit();
            }
        }
        best.found()
    }

    /// Every hit of the ray as [`Bvh::all_hits`](crate::Bvh::all_hits) lists them.
    pub fn all_hits(&self, ray: &Ray) -> Vec<Hit> {
        let Some(world) = RaySetup::new(ray, self.reach) else {
            return Vec::new();
        };
        let mut hits = Vec::new();
        add_hits(&self.primitives, &world, Interval::WORLD, &mut hits);
        let mut object = RaySetup::IDLE;
        for placed in &self.primitives.instances {
            if let Some(interval) = placed.placement.enter(Scalar, &world, &mut object) {
                let primitives = &self.primitives.objects[placed.object as usize];
                add_hits(primitives, &object, interval, &mut hits);
            }
        }
        hits.sort_by_key(|hit| Ranked(*hit));
        for hit in &mut hits {
            *hit = hit.told();
        }
        hits
    }

    /// Tells of every hit of the ray as [`Bvh::visit_hits`](crate::Bvh::visit_hits) does.
    pub fn visit_hits(&self, ray: &Ray, mut visit: impl FnMut(Hit) -> Visit) -> Option<Hit> {
        for hit in self.all_hits(ray) {
            match visit(hit) {
                Visit::Accept => return Some(hit),
                Visit::Reject => {}
                Visit::Stop => return None,
            }
        }
        None
    }

    /// Whether anything but a primitive lies in the ray's interval.
    pub fn occluded_except(&self, ray: &Ray, excluded: PrimId) -> bool {
        self.occluded_when(ray, &Condition::except(excluded))
    }

    /// Whether anything that meets a condition occludes a ray.
    pub(crate) fn occluded_when(&self, ray: &Ray, condition: &Condition<'_>) -> bool {
        let Some(world) = RaySetup::new(ray, self.reach) else {
            return false;
        };
        let occludes = |primitives: &Primitives, ray: &RaySetup, interval: Interval| {
            (0..primitives.len()).any(|index| {
                // User geometry tells of a hit only if it is asked for one.
                let is_user = primitives.kind(index) == PrimKind::User;
                let query = match condition.accept {
                    Some(_) if is_user => QueryKind::Intersect,
                    _ => QueryKind::Occluded,
                };
                let hit = primitives.hit(index, ray, query).map(|hit| Hit {
                    t: interval.clamp(hit.t),
                    inst_id: ray.inst_id,
                    ..hit
                });
                hit.is_some_and(|hit| condition.counts(&hit.told()))
            })
        };
        let mut object = RaySetup::IDLE;
        occludes(&self.primitives, &world, Interval::WORLD)
            || self.primitives.instances.iter().any(|placed| {
                let entered = placed.placement.enter(Scalar, &world, &mut object);
                let primitives = &self.primitives.objects[placed.object as usize];
                entered.is_some_and(|interval| occludes(primitives, &object, interval))
            })
    }

    /// The closest hit in the ray's interval on anything but a primitive.
    pub fn intersect_except(&self, ray: &Ray, excluded: PrimId) -> Option<Hit> {
        let mut hits = self.all_hits(ray).into_iter();
        hits.find(|hit| PrimId::from(*hit) != excluded)
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

/// Whether the ray hits any of the primitives, instances aside.
fn any_hit(primitives: &Primitives, ray: &RaySetup) -> bool {
    (0..primitives.len()).any(|index| primitives.hit(index, ray, QueryKind::Occluded).is_some())
}

/// Adds all hits of the ray with the primitives, instances aside, at the distances at which they are reported.
fn add_hits(primitives: &Primitives, ray: &RaySetup, interval: Interval, hits: &mut Vec<Hit>) {
    for index in 0..primitives.len() {
        if let Some(hit) = primitives.hit(index, ray, QueryKind::Intersect) {
            hits.push(Hit {
                t: interval.clamp(hit.t),
                inst_id: ray.inst_id,
                ..hit
            });
        }
    }
}

/// All hits of the ray with the primitives, instances aside.
fn offer_hits(primitives: &Primitives, ray: &RaySetup, best: &mut Best) {
    for index in 0..primitives.len() {
        if let Some(hit) = primitives.hit(index, ray, QueryKind::Intersect) {
            best.offer(hit);
        }
    }
}
