//! One rendering as all of its threads see it.

use std::time::Instant;

use antumbra::Bvh;

use super::Task;
use super::learn::Learned;
use super::monitor::Monitor;
use crate::Error;
use crate::film::{Film, Rules, Sample, Shard, Tiles};
use crate::integrator::{Batch, dimension};
use crate::options::Options;
use crate::resume::{Earlier, Snapshot, Sums};
use crate::sampler::{Method, Sampler};
use crate::training::Lesson;
use crate::world::World;

/// State that all threads of a rendering share.
pub struct Job<'a> {
    /// Scene that is rendered.
    pub world: &'a World,
    /// Observer of the rendering.
    pub monitor: &'a dyn Monitor,
    /// Tiles of the sampled pixels.
    pub tiles: Tiles,
    /// Samples per pixel.
    pub spp: u32,
    /// Seed of all random values.
    pub seed: u64,
    /// Samples per pixel that textures are made for, if it is another number than `spp`.
    texture_spp: Option<u32>,
    /// Rules by which samples enter pixels.
    pub rules: Rules,
    /// Part of the picture to render.
    pub shard: Shard,
    /// Unfinished tiles of the part. Tiles that were begun come first.
    pub todo: Vec<usize>,
    /// Generator of random values.
    pub method: Method,
    started: Instant,
    earlier: Earlier,
    sampler: Sampler,
}

impl<'a> Job<'a> {
    /// The job of a task, the samples that are done already, and the training rays if they are given.
    ///
    /// # Errors
    /// [`Error::NoSamples`], [`Error::LogShare`], [`Error::OtherSnapshot`].
    pub fn begin(
        world: &'a World,
        options: &Options,
        task: Task,
        monitor: &'a dyn Monitor,
    ) -> Result<(Self, Sums, Option<Lesson>), Error> {
        let started = Instant::now();
        let spp = options.spp.unwrap_or(world.sampler.pixel_samples);
        if spp == 0 {
            return Err(Error::NoSamples {
                what: "samples per pixel",
            });
        }
        if !(0.0..=1.0).contains(&options.log_share) {
            return Err(Error::LogShare {
                share: options.log_share,
            });
        }
        let rules = Rules::new(&world.film, options.standard_error);
        let method = Method::of(world.sampler.kind, spp);
        let mut job = Self {
            world,
            monitor,
            tiles: Tiles::new(rules.sampled()),
            spp,
            seed: options.seed,
            texture_spp: options.texture_spp,
            rules,
            shard: task.shard,
            todo: Vec::new(),
            method,
            started,
            earlier: Earlier::default(),
            sampler: Sampler::new(method, options.seed),
        };
        let (done, learned) = match task.resume {
            Some(snapshot) => job.resume(snapshot, options.cost_map)?,
            None => (job.nothing_done(options.cost_map, task.extendable), None),
        };
        job.todo = job.unfinished(&done);
        Ok((job, done, task.lesson.or(learned)))
    }

    /// Goes on from a snapshot: the samples and the training rays in it.
    fn resume(&mut self, found: Snapshot, costs: bool) -> Result<(Sums, Option<Lesson>), Error> {
        let fits = found.rules().equals(&self.rules)
            && found.resolution == self.world.film.resolution
            && found.spp == self.spp
            && (found.texture_spp == self.texture_spp || !self.world.has_textures())
            && found.shard == self.shard
            && found.sums.costs.is_some() == costs;
        if !fits {
            return Err(Error::OtherSnapshot);
        }
        self.earlier = found.earlier;
        Ok((found.sums, found.lesson))
    }

    fn nothing_done(&self, costs: bool, extendable: bool) -> Sums {
        let film = if self.shard.is_whole() && !extendable {
            Film::new(self.rules)
        } else {
            Film::apart(self.rules)
        };
        Sums::new(film, costs)
    }

    fn unfinished(&self, done: &Sums) -> Vec<usize> {
        let mine = (0..self.tiles.count()).filter(|&tile| self.shard.holds(tile));
        let left = mine.filter(|&tile| !done.film.has(tile));
        let (mut todo, fresh): (Vec<_>, Vec<_>) =
            left.partition(|tile| done.begun.contains_key(tile));
        todo.extend(fresh);
        todo
    }

    /// Adds the camera ray of a sample to a batch.
    pub fn push(&self, sample: Sample, batch: &mut Batch) {
        batch.push(&self.world.camera, &self.sampler, sample);
        // The mean distance of so many samples in a pixel, as in pbrt-v3.
        let count = self.texture_spp.unwrap_or(self.spp).max(1);
        batch.step = 1.0 / (count as f32).sqrt();
    }

    /// The tree of the world with its motion; `None` where no instance moves.
    ///
    /// # Errors
    /// [`Error::Moves`] if the scene moves and an observer answers the queries, which does not know their times.
    pub fn moving(&self, bvh: &Bvh, is_observed: bool) -> Result<Option<Bvh>, Error> {
        if is_observed && self.world.moves() {
            return Err(Error::Moves);
        }
        self.world.moving(bvh)
    }

    /// Position of a sample inside its pixel.
    pub fn inside(&self, sample: Sample) -> [f32; 2] {
        let [x, y] = sample.pixel;
        self.sampler
            .stream(x, y, sample.index)
            .pair(dimension::FILM)
    }

    /// Number of pixels in the unfinished tiles.
    pub fn pixels_to_do(&self) -> usize {
        let areas = self.todo.iter().map(|&tile| self.tiles.window(tile).area());
        areas.sum()
    }

    /// State of the job, to be resumed or joined.
    pub fn snapshot(&self, sums: Sums, learned: &Learned) -> Snapshot {
        let mut earlier = self.earlier;
        earlier.seconds += self.started.elapsed().as_secs_f64();
        if let Some(prepass) = &learned.prepass {
            earlier.prepass.add(&prepass.counts);
        }
        Snapshot {
            shard: self.shard,
            spp: self.spp,
            texture_spp: self.texture_spp,
            resolution: self.world.film.resolution,
            sums,
            lesson: learned.lesson.clone(),
            earlier,
        }
    }
}
