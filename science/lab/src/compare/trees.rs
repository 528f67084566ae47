//! The trees of a comparison: each made and taught as its own rendering would, from one pre-pass.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use antumbra::parts::{Cost, Log, Steps};
use antumbra::recipe::{Builder, Collapse};
use antumbra::{Bvh, Ray, Recipe, Stage, Width};
use antumbra_render::{
    Counts, LearningFigures, Lesson, Monitor, Observer, Phase, Queries, Session, clock,
};
use rayon::prelude::*;

use crate::counted::{counted, sum};
use crate::{Error, thread_seconds};

/// Rays that one task answers.
const CHUNK: usize = 4096;

/// Training rays of all trees.
#[derive(Default)]
pub struct Training {
    /// Sample of the training rays, for trees that are made from scratch.
    lesson: Lesson,
    /// All shadow rays of the pre-pass.
    rays: Vec<Ray>,
    /// Rays of the pre-pass.
    pub counts: Counts,
    /// Seconds of the pre-pass without its shadow queries, summed over threads.
    pub shared: f64,
}

/// A tree that is ready for queries.
pub struct Ready {
    /// The tree.
    pub bvh: Bvh,
    /// Place of its first tree.
    pub first: usize,
    /// Rays, predicted costs and times of learning.
    pub figures: LearningFigures,
    /// Time of the first tree.
    pub build: Duration,
    /// Mean tests of the training rays while they were logged.
    pub logging: Option<[f64; 3]>,
    /// Seconds of logging, summed over threads.
    pub log_busy: f64,
    /// Whether the order was learned from training rays.
    pub learns: bool,
}

/// Choices that decide a first tree: builder, collapse, width, and the bits of what a primitive test costs.
type Shape = (Builder, Collapse, Width, u32);

fn shape(builder: Builder, recipe: &Recipe) -> Shape {
    let cost = recipe.costs.prim.to_bits();
    (builder, recipe.collapse, recipe.engine.width(), cost)
}

/// A first tree.
pub struct First {
    shape: Shape,
    /// The tree, before its children are ordered.
    pub bvh: Bvh,
    time: Duration,
    /// Seconds and mean tests of the training rays, once they are known.
    traced: Option<(f64, [f64; 3])>,
}

/// Seconds for which all threads of the current pool have run.
fn pool_seconds() -> f64 {
    rayon::broadcast(|_| thread_seconds()).into_iter().sum()
}

/// Observer that keeps all shadow rays.
#[derive(Default)]
struct ShadowRays(Mutex<Vec<Ray>>);

/// The shadow rays of one thread.
struct ThreadRays<'t> {
    all: &'t ShadowRays,
    rays: Vec<Ray>,
}

impl Observer for ShadowRays {
    fn thread<'t>(&'t self, _: &'t dyn Fn() -> bool) -> Box<dyn Queries + 't> {
        Box::new(ThreadRays {
            all: self,
            rays: Vec::new(),
        })
    }
}

impl Queries for ThreadRays<'_> {
    fn occluded(&mut self, bvh: &Bvh, rays: &[Ray], occluded: &mut [bool]) {
        bvh.batch(rays).on_this_thread().occluded_into(occluded);
        self.rays.extend_from_slice(rays);
    }

    fn end(self: Box<Self>) {
        let all = self.all.0.lock();
        all.unwrap_or_else(PoisonError::into_inner)
            .extend(self.rays);
    }
}

impl Training {
    /// Traces the pre-pass, unless no tree learns from it.
    pub fn trace(session: &mut Session, bvh: &Bvh, recipes: &[Recipe]) -> Result<Self, Error> {
        if !recipes.iter().any(|r| r.order.log_kind().is_some()) {
            return Ok(Self::default());
        }
        let before = pool_seconds();
        let observer = ShadowRays::default();
        let counts = session.prepass(bvh, &observer)?;
        let rays = observer.0.into_inner();
        let rays = rays.unwrap_or_else(PoisonError::into_inner);
        let lesson = session.lesson(&rays);
        let busy = pool_seconds() - before;
        let own = seconds_of(bvh, &rays);
        Ok(Self {
            lesson,
            rays,
            counts,
            shared: (busy - own).max(0.0),
        })
    }
}

/// Answers rays in tasks. Returns the seconds of all threads.
fn seconds_of(bvh: &Bvh, rays: &[Ray]) -> f64 {
    let mut occluded = vec![false; rays.len()];
    rays.par_chunks(CHUNK)
        .zip(occluded.par_chunks_mut(CHUNK))
        .map(|(rays, occluded)| {
            let start = thread_seconds();
            bvh.batch(rays).on_this_thread().occluded_into(occluded);
            thread_seconds() - start
        })
        .sum()
}

fn mean(tests: [u64; 3], rays: usize) -> [f64; 3] {
    tests.map(|tests| tests as f64 / rays.max(1) as f64)
}

impl First {
    /// Seconds and mean tests of the training rays in this tree, as in a pre-pass that learns no log of it.
    fn traced(&mut self, rays: &[Ray]) -> (f64, [f64; 3]) {
        if let Some(traced) = self.traced {
            return traced;
        }
        let seconds = seconds_of(&self.bvh, rays);
        let (_, costs) = counted(&self.bvh, rays);
        *self.traced.insert((seconds, mean(sum(&costs), rays.len())))
    }
}

/// Log of the training rays in a first tree, with the seconds of all threads and the mean tests.
fn log(bvh: &Bvh, recipe: &Recipe, rays: &[Ray]) -> Option<(Log, f64, [f64; 3])> {
    let (kind, seed) = (recipe.order.log_kind()?, recipe.training.seed);
    // One log for each thread, as they are large.
    let share = rays.len().div_ceil(rayon::current_num_threads()).max(1);
    let parts: Vec<(Log, f64, [u64; 3])> = rays
        .par_chunks(share)
        .map(|rays| {
            let mut log = bvh.new_log(kind, seed);
            let mut occluded = vec![false; rays.len()];
            let mut costs = vec![Cost::default(); rays.len()];
            let start = thread_seconds();
            bvh.occluded_batch_logged(rays, &mut occluded, &mut costs, &mut log);
            (log, thread_seconds() - start, sum(&costs))
        })
        .collect();
    let mut all = (bvh.new_log(kind, seed), 0.0, [0; 3]);
    for (log, seconds, tests) in parts {
        all.0.merge(&log);
        all.1 += seconds;
        for (sum, tests) in all.2.iter_mut().zip(tests) {
            *sum += tests;
        }
    }
    Some((all.0, all.1, mean(all.2, rays.len())))
}

/// Makes trees one after the other. Parts that several trees need are made once.
#[derive(Default)]
pub struct Maker {
    /// First trees so far.
    pub firsts: Vec<First>,
    /// The last tree that was made from scratch, before its children were ordered.
    anew: Option<(Shape, Bvh)>,
    /// The last binary tree that was built for the training rays.
    stage: Option<(Builder, Stage)>,
}

impl Maker {
    /// Place of the first tree of a recipe.
    pub fn first(&mut self, session: &Session, recipe: &Recipe) -> Result<usize, Error> {
        let builder = Session::first_builder(recipe);
        let shape = shape(builder, recipe);
        if let Some(place) = self.firsts.iter().position(|first| first.shape == shape) {
            return Ok(place);
        }
        let (bvh, time) = session.first_tree(recipe)?;
        self.firsts.push(First {
            shape,
            bvh,
            time,
            traced: None,
        });
        Ok(self.firsts.len() - 1)
    }

    /// The tree of a recipe whose first tree is at `place`, learned as a rendering learns the tree.
    fn tree(
        &mut self,
        session: &Session,
        recipe: &Recipe,
        place: usize,
        training: &Training,
    ) -> Result<Ready, Error> {
        let first = &mut self.firsts[place];
        let mut bvh = first.bvh.clone();
        let (mut logging, mut log_busy) = (None, 0.0);
        let mut full = None;
        let mut made_anew = false;
        let mut rays: &[Ray] = &[];
        if let Some(kind) = recipe.order.log_kind() {
            rays = training.lesson.rays();
            let anew = recipe.collapse.needs_log() || recipe.builder.needs_rays();
            let (seconds, tests) = if !anew && !kind.masks {
                let found = log(&bvh, recipe, &training.rays);
                found.map_or((0.0, [0.0; 3]), |(log, seconds, tests)| {
                    full = Some(log);
                    (seconds, tests)
                })
            } else {
                first.traced(&training.rays)
            };
            log_busy = seconds;
            logging = (!training.rays.is_empty()).then_some(tests);
            if anew {
                let shape = shape(recipe.builder, recipe);
                match &self.anew {
                    Some((of, made)) if *of == shape => {
                        bvh = made.clone();
                        made_anew = true;
                    }
                    _ => {
                        made_anew = session.make_anew(recipe, &mut bvh, rays, &mut self.stage)?;
                        self.anew = made_anew.then(|| (shape, bvh.clone()));
                    }
                }
            }
        }
        Ok(Ready {
            figures: Session::learn_order(recipe, &mut bvh, rays, full.as_ref(), made_anew)?,
            bvh,
            first: place,
            build: first.time,
            logging,
            log_busy,
            learns: recipe.order.log_kind().is_some(),
        })
    }

    /// Makes all trees, for training logs of this seed, and reports to the monitor.
    pub fn trees(
        &mut self,
        session: &Session,
        recipes: &[Recipe],
        training: &Training,
        (seed, monitor): (u64, &dyn Monitor),
    ) -> Result<Vec<Ready>, Error> {
        let mut trees = Vec::new();
        for (done, recipe) in recipes.iter().enumerate() {
            monitor.progress(Phase::Sort, done as u64, recipes.len() as u64);
            if monitor.cancelled() {
                return Err(Error::Interrupted);
            }
            let first = self.first(session, recipe)?;
            let recipe = recipe.seed(seed).clock(Some(clock));
            trees.push(self.tree(session, &recipe, first, training)?);
        }
        (self.anew, self.stage) = (None, None);
        Ok(trees)
    }
}
