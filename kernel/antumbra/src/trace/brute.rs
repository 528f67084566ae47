//! No tree at all: every primitive against every ray, in plain scalar code. The oracle that every tree,
//! order and level is compared with, and the first thing to try when an answer is in doubt.

use alloc::borrow::Cow;
use alloc::vec::Vec;

use antumbra_simd::Scalar;

use crate::geometry::QueryKind;
use crate::geometry::best::{Best, TreeHit};
use crate::geometry::instance_ray::Interval;
use crate::geometry::masks::SceneMasks;
use crate::geometry::primitives::Primitives;
use crate::geometry::ray_setup::RaySetup;
use crate::ray::{Hit, Ray};
use crate::trace::condition::Condition;
use crate::trace::judge::named;
use crate::trace::visit::Ranked;

/// A scene without an acceleration structure, with the queries of [`Bvh`](crate::Bvh): every primitive is tested.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::{Brute, Primitives, Ray};
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let brute = Brute::new(&Primitives::new(&geometry)?);
/// let ray = Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]);
/// assert_eq!(brute.intersect(&ray), bvh.intersect(&ray));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone)]
pub struct Brute {
    primitives: Primitives,
    reach: f32,
    pub(crate) masks: Option<SceneMasks>,
}

impl Brute {
    /// Copies the primitives. Queries test every one of them: an oracle for comparisons, not for speed.
    #[must_use]
    pub fn new(primitives: &Primitives) -> Self {
        let reach = primitives.bounds().reach();
        Self {
            primitives: primitives.clone(),
            reach,
            masks: None,
        }
    }

    /// The scene at a time, or as it is.
    pub(crate) fn at(&self, time: Option<f32>) -> Cow<'_, Self> {
        match time {
            Some(time) if self.primitives.moves() => Cow::Owned(Self {
                primitives: self.primitives.at(time),
                reach: self.reach,
                masks: self.masks.clone(),
            }),
            _ => Cow::Borrowed(self),
        }
    }

    pub(crate) fn reach(&self) -> f32 {
        self.reach
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

    /// Every hit of the ray as [`RayQuery::all_hits`](crate::RayQuery::all_hits) lists them.
    pub(crate) fn all_hits(&self, ray: &Ray) -> Vec<Hit> {
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
        hits.sort_by_key(|found| Ranked(*found));
        hits.into_iter().map(TreeHit::told).collect()
    }

    /// Whether any hit that fulfils a condition occludes a ray.
    pub(crate) fn occluded_when(&self, ray: &Ray, condition: &Condition<'_>) -> bool {
        let Some(world) = RaySetup::new(ray, self.reach) else {
            return false;
        };
        let occludes = |primitives: &Primitives, ray: &RaySetup, interval: Interval| {
            (0..primitives.len()).any(|index| {
                if condition.accept.is_none() {
                    let hit = primitives.occluder(index, ray);
                    return hit.is_some_and(|id| condition.may_count(named(id, ray)));
                }
                let hit = primitives.hit(index, ray, QueryKind::Occluded);
                hit.is_some_and(|hit| condition.counts(&hit.placed(interval, ray.inst_id).told()))
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
}

/// Whether the ray hits any of the primitives, instances aside.
fn any_hit(primitives: &Primitives, ray: &RaySetup) -> bool {
    (0..primitives.len()).any(|index| primitives.occluder(index, ray).is_some())
}

/// Adds all hits of the ray with the primitives, instances aside, at the distances at which they are reported.
fn add_hits(primitives: &Primitives, ray: &RaySetup, interval: Interval, hits: &mut Vec<TreeHit>) {
    for index in 0..primitives.len() {
        if let Some(hit) = primitives.hit(index, ray, QueryKind::Intersect) {
            hits.push(hit.placed(interval, ray.inst_id));
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
