//! The trees of a comparison: each made and taught as its own rendering would, from one pre-pass.

use std::time::Duration;

use antumbra::lab::{BinaryStage, Cost, Laboratory, Log};
use antumbra::{Builder, Bvh, Collapse, Ray, Recipe, Width};
use rayon::prelude::*;

use super::super::job::Job;
use super::super::learn::{
    Learned, first_builder, first_tree, make_anew, prepass_samples, rays_worth_learning,
};
use super::super::monitor::Phase;
use super::super::prepass;
use crate::Error;
use crate::clock::clock;
use crate::options::Options;
use crate::training::{Lesson, RaySample, TrainingSample};

/// Rays that one task answers.
const CHUNK: usize = 4096;

/// Training rays of all trees.
#[derive(Default)]
pub struct Training {
    /// Samples of the pre-pass, for the picture, and the sample of rays for trees that are made anew.
    pub learned: Learned,
    /// All shadow rays of the pre-pass.
    pub rays: Vec<Ray>,
    /// Seconds of the pre-pass without its shadow queries, summed over threads.
    pub shared: f64,
}

/// A tree that is ready for queries.
pub struct Ready {
    /// The tree.
    pub bvh: Bvh,
    /// Place of its first tree.
    pub first: usize,
    /// What was learned, and how long that took.
    pub learned: Learned,
    /// Time of the first tree.
    pub build: Duration,
    /// Mean tests of the training rays while they were logged.
    pub logging: Option<[f64; 3]>,
    /// Seconds of logging, summed over threads.
    pub log_busy: f64,
    /// Whether the order was learned from training rays.
    pub learns: bool,
}

/// What decides a first tree.
type Shape = (Builder, Collapse, Width);

/// A first tree.
pub struct First {
    shape: Shape,
    /// The tree, before its children are ordered.
    pub bvh: Bvh,
    time: Duration,
    /// Seconds and mean tests of the training rays, once they are known.
    traced: Option<(f64, [f64; 3])>,
}

/// Seconds that all threads of the current pool have run.
pub fn pool_seconds(clock: fn() -> f64) -> f64 {
    rayon::broadcast(|_| clock()).into_iter().sum()
}

impl Training {
    /// Traces the pre-pass, unless no tree learns from it.
    pub fn trace(
        job: &Job,
        options: &Options,
        bvh: &Bvh,
        recipes: &[Recipe],
        clock: fn() -> f64,
    ) -> Result<Self, Error> {
        let mut training = Self::default();
        if !recipes.iter().any(|r| r.order.log_kind().is_some()) {
            return Ok(training);
        }
        let selection = prepass_samples(job, options);
        let empty = TrainingSample::Kept {
            rays: RaySample::new(rays_worth_learning(job)),
            all: Vec::new(),
        };
        let before = pool_seconds(clock);
        let (prepass, sample) = prepass::run(job, bvh, &empty, selection)?;
        let busy = pool_seconds(clock) - before;
        if let TrainingSample::Kept { rays, all } = sample {
            training.learned.lesson = Some(Lesson::from(rays.into_rays()));
            training.rays = all;
        }
        let mut occluded = vec![false; training.rays.len()];
        let own = timed(clock, &training.rays, &mut occluded, |rays, occluded| {
            bvh.batch(rays).on_this_thread().occluded(occluded);
        });
        training.shared = (busy - own).max(0.0);
        training.learned.prepass = Some(prepass);
        training.learned.selection = selection;
        Ok(training)
    }
}

/// Answers rays in tasks. Returns the seconds of all threads.
fn timed(
    clock: fn() -> f64,
    rays: &[Ray],
    occluded: &mut [bool],
    answer: impl Fn(&[Ray], &mut [bool]) + Sync,
) -> f64 {
    rays.par_chunks(CHUNK)
        .zip(occluded.par_chunks_mut(CHUNK))
        .map(|(rays, occluded)| {
            let start = clock();
            answer(rays, occluded);
            clock() - start
        })
        .sum()
}

/// Sum of tests: nodes, primitives, and nodes outside of instances.
fn sum(costs: &[Cost]) -> [u64; 3] {
    costs.iter().fold([0; 3], |[nodes, prims, top], cost| {
        [
            nodes + u64::from(cost.node_tests),
            prims + u64::from(cost.prim_tests),
            top + u64::from(cost.top_node_tests),
        ]
    })
}

fn mean(tests: [u64; 3], rays: usize) -> [f64; 3] {
    tests.map(|tests| tests as f64 / rays.max(1) as f64)
}

impl First {
    /// Seconds and mean tests of the training rays in this tree, as in a pre-pass that learns no log of it.
    fn traced(&mut self, rays: &[Ray], clock: fn() -> f64) -> (f64, [f64; 3]) {
        if let Some(traced) = self.traced {
            return traced;
        }
        let mut occluded = vec![false; rays.len()];
        let seconds = timed(clock, rays, &mut occluded, |rays, occluded| {
            self.bvh.batch(rays).on_this_thread().occluded(occluded);
        });
        let tests = rays.par_chunks(CHUNK).map(|rays| {
            let mut costs = vec![Cost::default(); rays.len()];
            let mut occluded = vec![false; rays.len()];
            self.bvh
                .occluded_batch_counted(rays, &mut occluded, &mut costs);
            sum(&costs)
        });
        let tests = tests.reduce(|| [0; 3], |a, b| [0, 1, 2].map(|place| a[place] + b[place]));
        *self.traced.insert((seconds, mean(tests, rays.len())))
    }
}

/// Log of the training rays in a first tree, with the seconds of all threads and the mean tests.
fn log(
    job: &Job,
    bvh: &Bvh,
    recipe: &Recipe,
    rays: &[Ray],
    clock: fn() -> f64,
) -> Option<(Log, f64, [f64; 3])> {
    let kind = recipe.order.log_kind()?;
    // One log for each thread, as they are large.
    let share = rays.len().div_ceil(rayon::current_num_threads()).max(1);
    let parts: Vec<(Log, f64, [u64; 3])> = rays
        .par_chunks(share)
        .map(|rays| {
            let mut log = bvh.new_log(kind, job.seed);
            let mut occluded = vec![false; rays.len()];
            let mut costs = vec![Cost::default(); rays.len()];
            let start = clock();
            bvh.occluded_batch_logged(rays, &mut occluded, &mut costs, &mut log);
            (log, clock() - start, sum(&costs))
        })
        .collect();
    let mut all = (bvh.new_log(kind, job.seed), 0.0, [0; 3]);
    for (log, seconds, tests) in parts {
        all.0.merge(&log);
        all.1 += seconds;
        for (sum, tests) in all.2.iter_mut().zip(tests) {
            *sum += tests;
        }
    }
    Some((all.0, all.1, mean(all.2, rays.len())))
}

/// Makes trees one after the other. What several of them need is made once.
pub struct Maker<'a> {
    job: &'a Job<'a>,
    options: &'a Options,
    clock: fn() -> f64,
    /// First trees so far.
    pub firsts: Vec<First>,
    /// The last tree that was made anew, before its children were ordered.
    anew: Option<(Shape, Bvh)>,
    /// The last binary tree that was built for the training rays.
    stage: Option<(Builder, BinaryStage)>,
}

impl<'a> Maker<'a> {
    /// A maker that has made nothing yet.
    pub fn new(job: &'a Job<'a>, options: &'a Options, clock: fn() -> f64) -> Self {
        Self {
            job,
            options,
            clock,
            firsts: Vec::new(),
            anew: None,
            stage: None,
        }
    }

    /// Place of the first tree of a recipe.
    pub fn first(&mut self, recipe: &Recipe) -> Result<usize, Error> {
        let shape = (first_builder(recipe), recipe.collapse, recipe.width);
        if let Some(place) = self.firsts.iter().position(|first| first.shape == shape) {
            return Ok(place);
        }
        let options = Options {
            recipe: *recipe,
            ..self.options.clone()
        };
        let (bvh, time) = first_tree(self.job.world, &options, self.job.monitor)?;
        self.firsts.push(First {
            shape,
            bvh,
            time,
            traced: None,
        });
        Ok(self.firsts.len() - 1)
    }

    /// The tree of a recipe, learned as a rendering learns it.
    pub fn tree(&mut self, recipe: &Recipe, training: &Training) -> Result<Ready, Error> {
        let place = self.first(recipe)?;
        let recipe = recipe.seed(self.job.seed).clock(Some(clock));
        let first = &mut self.firsts[place];
        let mut bvh = first.bvh.clone();
        let (mut logging, mut log_busy) = (None, 0.0);
        let mut learned = Learned::default();
        let mut full = None;
        let mut made_anew = false;
        let mut rays: &[Ray] = &[];
        if let Some(kind) = recipe.order.log_kind() {
            rays = training.learned.lesson.as_ref().map_or(rays, Lesson::rays);
            let anew = recipe.collapse.needs_log() || recipe.builder.needs_rays();
            let (seconds, tests) = if !anew && !kind.masks {
                let found = log(self.job, &bvh, &recipe, &training.rays, self.clock);
                found.map_or((0.0, [0.0; 3]), |(log, seconds, tests)| {
                    full = Some(log);
                    (seconds, tests)
                })
            } else {
                first.traced(&training.rays, self.clock)
            };
            log_busy = seconds;
            logging = (!training.rays.is_empty()).then_some(tests);
            if anew {
                let shape = (recipe.builder, recipe.collapse, recipe.width);
                match &self.anew {
                    Some((of, made)) if *of == shape => {
                        bvh = made.clone();
                        made_anew = true;
                    }
                    _ => {
                        made_anew = make_anew(self.job, &recipe, &mut bvh, rays, &mut self.stage)?;
                        self.anew = made_anew.then(|| (shape, bvh.clone()));
                    }
                }
            }
        }
        bvh.learn_order(rays, full.as_ref(), &recipe)
            .map_err(Error::Order)?;
        bvh.choose_prefetch(rays, &recipe);
        learned.note(&recipe, &bvh, made_anew);
        Ok(Ready {
            bvh,
            first: place,
            learned,
            build: first.time,
            logging,
            log_busy,
            learns: recipe.order.log_kind().is_some(),
        })
    }

    /// Makes all trees, and tells the monitor.
    pub fn trees(&mut self, recipes: &[Recipe], training: &Training) -> Result<Vec<Ready>, Error> {
        let monitor = self.job.monitor;
        let mut trees = Vec::new();
        for (done, recipe) in recipes.iter().enumerate() {
            monitor.progress(Phase::Sort, done as u64, recipes.len() as u64);
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            trees.push(self.tree(recipe, training)?);
        }
        (self.anew, self.stage) = (None, None);
        Ok(trees)
    }
}
