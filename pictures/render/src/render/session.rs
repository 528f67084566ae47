//! One rendering step by step, with the trees and the observer of the caller.

use std::time::{Duration, Instant};

use antumbra::parts::Log;
use antumbra::recipe::Builder;
use antumbra::{Bvh, Ray, Recipe, Stage};
use antumbra_image::{Image, Window};

use super::Task;
use super::job::Job;
use super::learn::{self, Learned, LearningFigures, prepass_samples, rays_worth_learning};
use super::monitor::Monitor;
use super::{pass, prepass};
use crate::Error;
use crate::film::batch_depth;
use crate::integrator::{Counts, Observer};
use crate::options::Options;
use crate::resume::Sums;
use crate::training::{Lesson, RaySample, TrainingSample};
use crate::world::World;

/// A rendering that is taken step by step, in the current rayon pool.
///
/// [`render`](super::render()) takes the steps with one tree. Whoever compares trees takes some of them once for all
/// trees. The picture has the bits of [`render`](super::render()), whatever the trees.
pub struct Session<'a> {
    job: Job<'a>,
    options: &'a Options,
    done: Sums,
    learned: Learned,
}

/// A picture whose queries were observed.
#[derive(Clone, Debug)]
pub struct ObservedPicture {
    /// Picture of all samples.
    pub image: Image,
    /// Rays of the main pass.
    pub counts: Counts,
    /// Time of making pixels of the film's sums.
    pub developing: Duration,
}

impl<'a> Session<'a> {
    /// A whole picture of which nothing is traced. `options.recipe`, `options.threads` and `options.count` do not matter.
    ///
    /// # Errors
    /// [`Error::NoSamples`], [`Error::LogShare`].
    pub fn new(
        world: &'a World,
        options: &'a Options,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, Error> {
        let (job, done, _) = Job::begin(world, options, Task::default(), monitor)?;
        Ok(Self {
            job,
            options,
            done,
            learned: Learned::default(),
        })
    }

    /// Pixels of the picture.
    pub fn window(&self) -> Window {
        self.job.rules.window
    }

    /// About how many batches of paths the picture has.
    pub fn batches(&self) -> u64 {
        let depth = u64::from(batch_depth(self.job.tiles.window(0)));
        self.job.todo.len() as u64 * u64::from(self.job.spp).div_ceil(depth)
    }

    /// Builder of the first tree of a recipe.
    pub fn first_builder(recipe: &Recipe) -> Builder {
        learn::first_builder(recipe)
    }

    /// The first tree of a recipe, for any rays, with the time that it takes.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn first_tree(&self, recipe: &Recipe) -> Result<(Bvh, Duration), Error> {
        learn::first_tree(self.job.world, recipe, self.job.monitor)
    }

    /// Traces the pre-pass in any tree: the first share of the samples, whose shadow rays are training rays.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn prepass(&mut self, bvh: &Bvh, observer: &dyn Observer) -> Result<Counts, Error> {
        let selection = prepass_samples(&self.job, self.options);
        let empty = TrainingSample::Rays {
            rays: RaySample::new(0),
            counted: false,
        };
        let (prepass, _) = prepass::run(&self.job, bvh, &empty, selection, Some(observer))?;
        let counts = prepass.counts;
        self.learned.prepass = Some(prepass);
        self.learned.selection = selection;
        Ok(counts)
    }

    /// The training rays that a rendering keeps of all shadow rays of its pre-pass.
    pub fn lesson(&self, rays: &[Ray]) -> Lesson {
        let mut sample = RaySample::new(rays_worth_learning(&self.job));
        sample.extend(rays);
        Lesson::from(sample.into_rays())
    }

    /// Makes the final tree of a recipe from scratch for `rays`. Returns false if the first tree is the final one. The
    /// binary tree is taken from `kept` if it is there, and else kept.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn make_anew(
        &self,
        recipe: &Recipe,
        bvh: &mut Bvh,
        rays: &[Ray],
        kept: &mut Option<(Builder, Stage)>,
    ) -> Result<bool, Error> {
        learn::make_anew(&self.job, recipe, bvh, rays, kept)
    }

    /// Learns the child order of the final tree, which was `made_anew` or is the first tree, from a log or else from
    /// `rays`.
    ///
    /// # Errors
    /// [`Error::Order`].
    pub fn learn_order(
        recipe: &Recipe,
        bvh: &mut Bvh,
        rays: &[Ray],
        log: Option<&Log>,
        made_anew: bool,
    ) -> Result<LearningFigures, Error> {
        learn::learn_order(recipe, bvh, rays, log, made_anew)
    }

    /// Traces all samples that the pre-pass has not taken.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn trace(self, bvh: &Bvh, observer: &dyn Observer) -> Result<ObservedPicture, Error> {
        let Self {
            job,
            options,
            done,
            learned,
        } = self;
        let sums = pass::run(&job, options, bvh, &learned, done, Some(observer))?;
        let developing = Instant::now();
        Ok(ObservedPicture {
            image: sums.film.image(job.world.film.resolution)?,
            counts: sums.effort.counts,
            developing: developing.elapsed(),
        })
    }
}
