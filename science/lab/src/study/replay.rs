//! Replays: a sample of a rendering's rays, none of them learned from, answered by every combination.
//!
//! Answers that are equal bit for bit mean pictures that are equal bit for bit: a renderer learns nothing else
//! of its tree. So hundreds of combinations can be compared in the time of a few pictures. Speeds are timed in
//! turn with one and the same tree, by which they can be compared with each other although they were timed at
//! different moments.

use antumbra::parts::Cost;
use antumbra::recipe::Engine;
use antumbra::{Bvh, Isa, Ray, Recipe, Width};
use antumbra_render::World;
use antumbra_scene::Camera;
use antumbra_trees::{engine, oracle_visits};

use super::cameras;
use super::kinds::{By, Kind, Trained};
use super::log_size::LogSize;
use super::plan::{Plan, Replay, Subject};
use super::row::{Common, Row, share};
use crate::counted::counted;
use crate::thread_time;
use crate::{CollapsedTree, Error, Lot, RaysFrom, SampledRays, TrainedTree};

/// Rays from which a scene's number of shadow rays is estimated.
const PILOT: usize = 8192;
/// No share of the rays is more than this: more teach nothing, and it is what renderings do.
const MOST_SHARE: usize = 1 << 14;
/// No share is less, unless the picture is small.
const LEAST_SHARE: usize = 1 << 12;
/// How often each tree is timed beside the reference.
const ROUNDS: usize = 5;

/// The rays of one scene.
pub struct Bench<'a> {
    plan: &'a Plan,
    subject: &'a Subject,
    world: &'a World,
    /// The tree that rays are collected with.
    tracing: Bvh,
    /// Shadow rays per sample of the picture.
    pub rays_per_sample: f64,
    /// How many rays of each kind are learned from.
    pub log_rays: usize,
    /// Training rays of the test camera.
    log: Option<Lot>,
    test: Option<Lot>,
    /// Training rays of the other camera.
    other: Option<Lot>,
    /// The tree that others are compared with, and what it answers.
    reference: Option<Reference>,
    /// The oracle's node tests of the last replay's tree: of occluded rays and of the others.
    oracle: Option<(Replay, [Option<f64>; 2])>,
}

struct Reference {
    kind: Kind,
    width: Width,
    bvh: Bvh,
    answers: Vec<bool>,
}

impl<'a> Bench<'a> {
    /// Finds out how many rays the scene has. What is replayed is collected when it is first needed.
    pub fn new(plan: &'a Plan, subject: &'a Subject, world: &'a World) -> Self {
        let tracing = world.bvh(Engine::of(plan.isa));
        let spp = plan.spp_of(subject);
        let mut samples = SampledRays::new(world, &tracing, spp, plan.seed);
        let pilot = samples.take(PILOT, 0);
        let rays_per_sample = share(pilot.shadow_rays, pilot.samples);
        let total = rays_per_sample * samples.total() as f64;
        let log_rays = match plan.log_size {
            LogSize::Rays(rays) => rays as usize,
            LogSize::Share(0.0) => 0,
            LogSize::Share(share) => {
                let least = LEAST_SHARE.min((total / 4.0) as usize);
                ((share * total) as usize).clamp(least, MOST_SHARE.max(least))
            }
        };
        Self {
            plan,
            subject,
            world,
            tracing,
            rays_per_sample,
            log_rays,
            log: None,
            test: None,
            other: None,
            reference: None,
            oracle: None,
        }
    }

    /// The share of its samples from which a rendering learns.
    pub fn log_share(&self) -> f64 {
        match self.plan.log_size {
            LogSize::Share(share) => share,
            LogSize::Rays(rays) => {
                let samples = SampledRays::new(self.world, &self.tracing, self.spp(), 0).total();
                let all = self.rays_per_sample * samples as f64;
                (f64::from(rays) / all.max(1.0)).min(1.0)
            }
        }
    }

    /// How many trees of a picture there is room for, one at least.
    pub fn trees_at_once(&self) -> usize {
        // Nodes of another width take more, and the first tree of a learned one is kept beside it.
        let tree = 2 * self.tracing.report().bytes as u64;
        let [x0, x1, y0, y1] = self.subject.scene.film.pixel_bounds().map(u64::from);
        // Tests of every pixel, summed up and as a map.
        let map = if self.plan.out.is_some() { 12 } else { 0 };
        let each = tree + map * (x1 - x0) * (y1 - y0);
        usize::try_from(self.plan.memory / each.max(1)).map_or(usize::MAX, |trees| trees.max(1))
    }

    fn spp(&self) -> u32 {
        self.plan.spp_of(self.subject)
    }

    /// Collects the rays of the test camera.
    fn collect(&mut self) {
        if self.test.is_some() {
            return;
        }
        let mut samples = SampledRays::new(self.world, &self.tracing, self.spp(), self.plan.seed);
        let log = samples.take(self.log_rays, self.log_rays);
        self.log = Some(log);
        self.test = Some(samples.take_in_picture_order(self.plan.replay, self.plan.replay));
    }

    /// Rays of the other camera to learn from.
    fn other(&mut self) -> Result<&Lot, Error> {
        if self.other.is_none() {
            let turned;
            let camera: &Camera = match &self.subject.train {
                Some(camera) => camera,
                None => {
                    turned = cameras::turned(&self.subject.scene.camera);
                    &turned
                }
            };
            let samples = SampledRays::new(self.world, &self.tracing, self.spp(), self.plan.seed);
            let mut samples = samples.with_camera(camera)?;
            self.other = Some(samples.take(self.log_rays, self.log_rays));
        }
        self.other
            .as_ref()
            .ok_or_else(|| Error::report("no rays of the other camera"))
    }

    /// The binary tree of a replay, and the log of what it learns from.
    pub fn trained_tree(&mut self, replay: &Replay) -> Result<TrainedTree, Error> {
        let (world, seed, rays_from) = (self.world, self.plan.seed, self.plan.rays_from);
        self.collect();
        let size = replay.log_rays.unwrap_or(self.log_rays);
        let other_kind = match replay.kind {
            Kind::Shadow => Kind::Ao,
            Kind::Ao => Kind::Shadow,
        };
        let (lot, kind) = match replay.trained {
            Trained::TrainCamera | Trained::TurnedCamera => (Some(self.other()?), replay.kind),
            Trained::OtherKind => (self.log.as_ref(), other_kind),
            Trained::TestCamera | Trained::Surfaces => (self.log.as_ref(), replay.kind),
        };
        let rays = lot.map_or(&[][..], |lot| lot.of(kind));
        let rays = &rays[..rays.len().min(size)];
        let from = match replay.trained {
            Trained::Surfaces => RaysFrom::Surfaces,
            _ if rays_from == RaysFrom::Camera => RaysFrom::Camera,
            _ => RaysFrom::Both,
        };
        let recipe = Recipe::default()
            .builder(replay.combination.tree)
            .seed(seed);
        Ok(TrainedTree::new(world, &recipe, rays, from))
    }

    /// Whether there is anything to replay; a scene may have no shadow rays.
    pub fn has_rays(&mut self, kind: Kind) -> bool {
        self.collect();
        self.test
            .as_ref()
            .is_some_and(|lot| !lot.of(kind).is_empty())
    }

    /// Answers the test rays. Returns the row.
    pub fn measure(
        &mut self,
        common: &Common,
        replay: &Replay,
        collapsed: &mut CollapsedTree,
    ) -> Result<Row, Error> {
        self.collect();
        let Some(test) = &self.test else {
            return Err(Error::report("no rays to replay"));
        };
        let rays = test.of(replay.kind);
        let width = replay.combination.width;
        let fits = |r: &Reference| r.kind == replay.kind && r.width == width;
        let reference = match self.reference.take().filter(fits) {
            Some(reference) => reference,
            None => Reference::new(self.world, replay.kind, width, self.plan.isa, rays),
        };
        let oracle = match self.oracle {
            // The oracle of a tree is the same for all its orders, which follow each other.
            Some((of, oracle)) if replay.shares_collapse(&of) && replay.shares_tree(&of) => oracle,
            _ => oracle(collapsed.bvh(), rays),
        };
        self.oracle = Some((*replay, oracle));
        let ordered = collapsed.order(replay.combination.order)?;
        let (answers, costs) = counted(&ordered.bvh, rays);
        let trees = [&reference.bvh, &ordered.bvh];
        let ([speeds, seconds], equal) = timed(trees, rays, &reference.answers);
        let equal_answers = equal && answers == reference.answers;
        let mean = |tests, chosen| mean_of((&costs, &answers), tests, chosen);
        let node_tests = |cost: &Cost| cost.node_tests;
        let occluded = answers.iter().filter(|occluded| **occluded).count();
        let row = Row {
            part: replay.part,
            rays: replay.kind,
            learned_from: replay.trained,
            log_rays: collapsed.learned_from(),
            test_rays: rays.len() as u64,
            occluded_share: share(occluded as u64, rays.len() as u64),
            node_tests_after: mean(node_tests, None).or(Some(0.0)),
            prim_tests_after: mean(|cost| cost.prim_tests, None).or(Some(0.0)),
            top_node_tests_after: (mean(|cost| cost.top_node_tests, None).or(Some(0.0)))
                .filter(|_| common.two_levels),
            node_tests_occluded: mean(node_tests, Some(true)),
            node_tests_unoccluded: mean(node_tests, Some(false)),
            oracle_occluded: oracle[0],
            oracle_unoccluded: oracle[1],
            predicted_cost_before: ordered.predicted.map(|[before, _]| before),
            predicted_cost_after: ordered.predicted.map(|[_, after]| after),
            log_seconds: (collapsed.follow_time() + ordered.log_time).as_secs_f64(),
            sort_seconds: ordered.sort_time.as_secs_f64(),
            build_seconds: collapsed.build_time().as_secs_f64(),
            mrays_per_s: Some(1e-6 * rays.len() as f64 / seconds[ROUNDS / 2]),
            speed: Some(speeds[ROUNDS / 2]),
            speed_range: Some([speeds[0], speeds[ROUNDS - 1]]),
            equal_answers: Some(equal_answers),
            ..Row::empty(common, &replay.combination, By::Replay)
        };
        self.reference = Some(reference);
        Ok(row)
    }
}

/// Means of the oracle's node tests of the occluded rays and of the others; `None` without such rays.
fn oracle(bvh: &Bvh, rays: &[Ray]) -> [Option<f64>; 2] {
    let visits = oracle_visits(bvh, rays);
    [
        (visits.occluded_rays > 0).then(|| visits.occluded()),
        (visits.unoccluded_rays > 0).then(|| visits.unoccluded()),
    ]
}

/// Means of tests over all rays, or over those with one answer; `None` without such rays.
fn mean_of(
    (costs, answers): (&[Cost], &[bool]),
    tests: fn(&Cost) -> u32,
    chosen: Option<bool>,
) -> Option<f64> {
    let of = costs.iter().zip(answers);
    let of = of.filter(|(_, occluded)| chosen.is_none_or(|chosen| **occluded == chosen));
    let (sum, count) = of.fold((0, 0), |(sum, count), (cost, _)| {
        (sum + u64::from(tests(cost)), count + 1)
    });
    (count > 0).then(|| sum as f64 / f64::from(count))
}

/// Speeds of the second of two trees over the first, and its seconds, each from the least: CPU time of interleaved rounds. Then
/// whether all answers were as expected.
fn timed(trees: [&Bvh; 2], rays: &[Ray], expected: &[bool]) -> ([[f64; ROUNDS]; 2], bool) {
    let mut found = [[0.0; ROUNDS]; 2];
    let mut answers = vec![false; rays.len()];
    let mut equal = true;
    for round in 0..ROUNDS {
        let [first, second] = trees.map(|bvh| {
            let start = thread_time::seconds();
            bvh.batch(rays).on_this_thread().occluded_into(&mut answers);
            let seconds = (thread_time::seconds() - start).max(1e-9);
            equal &= answers == expected;
            seconds
        });
        (found[0][round], found[1][round]) = (first / second, second);
    }
    for sorted in &mut found {
        sorted.sort_unstable_by(f64::total_cmp);
    }
    (found, equal)
}

impl Reference {
    fn new(world: &World, kind: Kind, width: Width, isa: Isa, rays: &[Ray]) -> Self {
        let bvh = world.bvh(engine(isa, width));
        let answers = bvh.batch(rays).occluded();
        Self {
            kind,
            width,
            bvh,
            answers,
        }
    }
}

impl Plan {
    /// Samples per pixel of the pictures of a scene.
    pub fn spp_of(&self, subject: &Subject) -> u32 {
        self.spp.unwrap_or(subject.scene.sampler.pixel_samples)
    }
}
