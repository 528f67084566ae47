//! Pictures that grow everywhere at once: every pixel gets its first sample, then the next ones.
//!
//! A finished picture has the bits of [`render`](super::render()) if every sample belongs to one pixel, as with the
//! default filter. The sums of wider filters are added in another order.

use std::sync::{Arc, Mutex, PoisonError};

use super::Task;
use super::job::Job;
use super::kept::KeptTree;
use super::monitor::{Monitor, Phase};
use super::pass::live_tile;
use super::workers::Jobs;
use crate::Error;
use crate::film::{BATCH, Film, Sample};
use crate::integrator::{Batch, Counts, Integrator, Observe, Tracer};
use crate::live::LiveTiles;
use crate::options::Options;
use crate::resume::TileWork;
use crate::world::World;
use antumbra_image::Image;

/// Most samples that a pixel gets in one round.
const DEEPEST: u32 = 16;
/// Most tiles that a thread takes at a time.
const GROUP: usize = 16;

/// Figures of a rendering after a round.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Round {
    /// Samples that every pixel has.
    pub samples: u32,
    /// Samples that every pixel will have.
    pub spp: u32,
    /// Closest-hit rays so far.
    pub closest_rays: u64,
    /// Shadow rays so far.
    pub shadow_rays: u64,
    /// Node tests of the shadow rays so far, if they are counted.
    pub node_tests: u64,
    /// Primitive tests of the shadow rays so far, if they are counted.
    pub prim_tests: u64,
}

/// Tiles that one thread takes together.
type Group = Mutex<Vec<(usize, TileWork)>>;

/// Samples of a picture that [`render_rounds`] did not finish, from which it goes on. Empty at first and in the end.
#[derive(Debug, Default)]
pub struct Growth {
    groups: Vec<Group>,
    round: Round,
    counts: Counts,
}

/// Renders a picture in rounds over all pixels, and publishes every tile of every round in
/// [`Monitor::tiles`].
///
/// Cancelled, it leaves its samples in `growth`, and goes on from there when it is called again with the same world and
/// options, except for `threads` and `recipe`. The bits of the picture are the same.
///
/// `tree` is called before every round, and `after` is called after it. Nothing is learned here: `options.recipe`,
/// `options.log_share` and `options.standard_error` are ignored. All samples of the picture are kept in memory, so that
/// a tile takes 26 bytes per pixel or more.
///
/// # Errors
/// [`Error::Cancelled`], [`Error::NoSamples`], [`Error::Threads`].
pub fn render_rounds(
    world: &World,
    options: &Options,
    tree: &(dyn Fn() -> Arc<KeptTree> + Sync),
    monitor: &dyn Monitor,
    after: &(dyn Fn(&Round) + Sync),
    growth: &mut Growth,
) -> Result<Image, Error> {
    let mut work = || {
        let options = &Options {
            standard_error: false,
            ..options.clone()
        };
        let (job, ..) = Job::begin(world, options, Task::default(), monitor)?;
        rounds(&job, options, tree, after, growth)
    };
    match options.threads {
        None => work(),
        Some(threads) => {
            let threads = threads.get();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool
                .build()
                .map_err(|source| Error::Threads { threads, source })?;
            pool.install(work)
        }
    }
}

fn rounds(
    job: &Job,
    options: &Options,
    tree: &dyn Fn() -> Arc<KeptTree>,
    after: &dyn Fn(&Round),
    growth: &mut Growth,
) -> Result<Image, Error> {
    let live = job.monitor.tiles();
    let live = live.filter(|live| live.window() == job.rules.window);
    if growth.groups.is_empty() {
        growth.begin(job, options.cost_map);
    }
    let Growth {
        groups,
        round,
        counts,
    } = growth;
    while round.samples < job.spp {
        let depth = round.samples.clamp(1, DEEPEST).min(job.spp - round.samples);
        let tree = tree();
        let moving = job.moving(&tree.bvh, false)?;
        let quiet = Quiet(job.monitor);
        let jobs = Jobs::new(groups.len(), Phase::Render, &quiet);
        let found = jobs.run(|jobs| {
            let observe = match options.counts() {
                true => Observe::Count,
                false => Observe::Nothing,
            };
            let stop = || jobs.is_cancelled();
            let tracer = Tracer::new(&tree.bvh, observe).until(&stop);
            let mut thread = Thread {
                job,
                live,
                costs: options.cost_map,
                tracer: tracer.moving(job.world, moving.as_ref()),
                integrator: Integrator::new(job.world),
                samples: Vec::new(),
                batch: Batch::default(),
            };
            while let Some(turn) = jobs.take() {
                let mut group = groups[turn].lock().unwrap_or_else(PoisonError::into_inner);
                // A cancelled round has given the first tiles of a group their samples.
                let done = round.samples + depth;
                let first = group.partition_point(|(_, tile)| tile.done >= done);
                if thread.batches(&mut group[first..], depth).is_none() {
                    return thread.tracer.take_counts();
                }
                jobs.finish();
            }
            thread.tracer.take_counts()
        })?;
        found.iter().for_each(|more| counts.add(more));
        *round = Round {
            samples: round.samples + depth,
            spp: round.spp,
            closest_rays: counts.closest_rays,
            shadow_rays: counts.shadow_rays,
            node_tests: counts.node_tests,
            prim_tests: counts.prim_tests,
        };
        job.monitor
            .progress(Phase::Render, round.samples.into(), job.spp.into());
        after(round);
    }
    let image = std::mem::take(growth).image(job)?;
    if let Some(live) = live {
        live.complete(&image, |_| true);
    }
    Ok(image)
}

impl Growth {
    /// Makes groups of tiles without samples.
    fn begin(&mut self, job: &Job, cost_map: bool) {
        let tiles = job.tiles.count();
        let size = (tiles / (4 * rayon::current_num_threads())).clamp(1, GROUP);
        let anew = |index| {
            let window = job.tiles.window(index);
            (index, TileWork::new(job.rules, window, cost_map))
        };
        let group = |first: usize| (first..tiles.min(first + size)).map(anew).collect();
        let firsts = (0..tiles).step_by(size);
        self.groups = firsts.map(|first| Mutex::new(group(first))).collect();
        self.round.spp = job.spp;
    }

    /// Picture of all tiles.
    fn image(self, job: &Job) -> Result<Image, Error> {
        let mut film = Film::new(job.rules);
        for group in self.groups {
            let tiles = group.into_inner().unwrap_or_else(PoisonError::into_inner);
            for (index, tile) in tiles {
                film.finish(index, tile.film);
            }
        }
        film.image(job.world.film.resolution)
    }
}

/// A monitor that hears nothing of single tiles.
struct Quiet<'a>(&'a dyn Monitor);

impl Monitor for Quiet<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// A thread with its buffers.
struct Thread<'a> {
    job: &'a Job<'a>,
    live: Option<&'a LiveTiles>,
    /// Whether a cost map is wanted.
    costs: bool,
    tracer: Tracer<'a>,
    integrator: Integrator,
    samples: Vec<Sample>,
    batch: Batch,
}

impl Thread<'_> {
    /// Gives every pixel of tiles `depth` more samples, some tiles at a time. `None` when cancelled: the rest has none.
    fn batches(&mut self, tiles: &mut [(usize, TileWork)], depth: u32) -> Option<()> {
        // Small batches are slow, and large ones take memory.
        let together = (BATCH / (256 * depth as usize)).max(1);
        let mut batches = tiles.chunks_mut(together);
        batches.try_for_each(|tiles| self.batch(tiles, depth))
    }

    /// Gives every pixel of some tiles `depth` more samples. `None` when cancelled: no sample was added.
    fn batch(&mut self, tiles: &mut [(usize, TileWork)], depth: u32) -> Option<()> {
        let job = self.job;
        self.batch.clear();
        self.samples.clear();
        for (index, tile) in tiles.iter() {
            let window = job.tiles.window(*index);
            for y in window.y0..window.y1 {
                for x in window.x0..window.x1 {
                    let pixel = [x, y];
                    let numbers = tile.done..tile.done + depth;
                    self.samples
                        .extend(numbers.map(|index| Sample { pixel, index }));
                }
            }
        }
        for &sample in &self.samples {
            job.push(sample, &mut self.batch);
        }
        self.integrator
            .trace(job.world, &mut self.tracer, &mut self.batch, self.costs);
        if self.tracer.is_stopped() {
            return None;
        }
        let mut traced = 0;
        for (index, tile) in tiles {
            let window = job.tiles.window(*index);
            for _ in 0..window.area() * depth as usize {
                let pixel = self.samples[traced].pixel;
                tile.add(window, pixel, &self.batch, traced);
                traced += 1;
            }
            tile.done += depth;
            if let Some(live) = self.live
                && let Some(shown) = live_tile(live, *index, window, tile)
            {
                live.publish(*index, shown);
            }
        }
        Some(())
    }
}
