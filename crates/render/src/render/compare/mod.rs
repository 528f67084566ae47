//! One picture whose queries many trees answer in turns.
//!
//! Camera paths, shading and film are done once. Every batch of shadow rays is answered and counted by every tree, and
//! a sample of the batches is timed tree by tree. All trees therefore meet the same rays at nearly the same moment.
//!
//! - `trees.rs`: the trees, each learned as its own rendering would
//! - `contest.rs`: the trees while the picture is traced

mod contest;
mod trees;

use std::time::Instant;

use antumbra::Recipe;
use antumbra_image::Image;

pub use contest::Contest;
use contest::Found;
use trees::{Maker, Ready, Training};

use super::Task;
use super::job::Job;
use super::monitor::{Monitor, Phase};
use super::pass;
use super::stats::{Split, image_hash};
use crate::Error;
use crate::integrator::{Counts, Rival, SampleCost, Timing};
use crate::options::Options;
use crate::world::World;

/// A picture that many trees were compared on.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The picture, with the bits of [`render`](super::render()).
    pub image: Image,
    /// [`image_hash`] of the picture.
    pub image_hash: u64,
    /// Closest-hit rays.
    pub closest_rays: u64,
    /// Shadow rays, those of the pre-pass included.
    pub shadow_rays: u64,
    /// Shadow rays that are occluded.
    pub occluded_rays: u64,
    /// Shadow rays of the main pass, which all trees were counted on. None was learned from.
    pub held_out_rays: u64,
    /// Every tree, in the order of the recipes.
    pub trees: Vec<ComparedTree>,
}

/// Figures of one tree. Tests are means per shadow ray: of nodes, of primitives, and of nodes outside of instances.
///
/// Times of a whole picture are composed. The part that does not depend on the tree was measured once for all of them:
/// shading, film, and the camera paths of the pre-pass.
#[derive(Clone, Debug)]
pub struct ComparedTree {
    /// Training rays of the child order; 0 if it did not learn.
    pub training_rays: u64,
    /// Tests of the training rays while they were logged. `None` if nothing was learned.
    pub logging: Option<[f64; 3]>,
    /// Tests of the held-out rays in the first tree, before its children were ordered. `None` without rays.
    pub before: Option<[f64; 3]>,
    /// Tests of the same rays in the final tree.
    pub after: Option<[f64; 3]>,
    /// Predicted cost of a shadow ray before and after ordering.
    pub predicted: Option<[f64; 2]>,
    /// Seconds of the trees, as [`Stats::build_seconds`](super::Stats::build_seconds).
    pub build_seconds: f64,
    /// Seconds of the pre-pass spread over the threads, and of following training rays.
    pub log_seconds: f64,
    /// As [`Stats::sort_seconds`](super::Stats::sort_seconds).
    pub sort_seconds: f64,
    /// As [`Stats::order_seconds`](super::Stats::order_seconds).
    pub order_seconds: f64,
    /// Seconds of a whole picture with this tree, composed, round by round. Work of all threads is divided by their
    /// number.
    pub render_seconds: Vec<f64>,
    /// Seconds of every kind of work, summed over threads. Shadow queries are those of the median round.
    pub split: Split,
    /// Whether all answers were those of the first tree, bit for bit.
    pub agrees: bool,
    /// Mean tests per shadow ray of every pixel, if asked for.
    pub cost_map: Option<Vec<f32>>,
}

/// Renders one picture, and compares the trees of `recipes` on its queries.
///
/// `clock` tells for how many seconds the calling thread has run. Every timed batch of shadow rays is answered
/// `rounds` times by each tree. `options.recipe` is the only recipe if there is no other. `options.threads` and
/// `options.count` do not matter: all rays are counted, in the current rayon pool.
///
/// # Errors
/// As [`render`](super::render()).
pub fn compare(
    world: &World,
    options: &Options,
    recipes: &[Recipe],
    clock: fn() -> f64,
    rounds: usize,
    monitor: &dyn Monitor,
) -> Result<Compared, Error> {
    let (job, done, _) = Job::begin(world, options, Task::default(), monitor)?;
    let recipes = match recipes {
        [] => std::slice::from_ref(&options.recipe),
        _ => recipes,
    };
    monitor.progress(Phase::Build, 0, 1);
    let mut maker = Maker::new(&job, options, clock);
    let first = maker.first(&recipes[0])?;
    monitor.progress(Phase::Build, 1, 1);
    let bvh = &maker.firsts[first].bvh;
    let training = Training::trace(&job, options, bvh, recipes, clock)?;
    let trees = maker.trees(recipes, &training)?;

    // Orders are compared with the tree that they began with: with the one that keeps it as it is, or else beside them.
    let mut rivals: Vec<Rival> = trees
        .iter()
        .map(|tree| Rival {
            bvh: &tree.bvh,
            timed: true,
        })
        .collect();
    let mut before = vec![None; maker.firsts.len()];
    for (place, (tree, recipe)) in trees.iter().zip(recipes).enumerate() {
        if recipe.order == antumbra::Order::Simple {
            before[tree.first] = Some(place);
        }
    }
    for tree in trees.iter().filter(|tree| tree.learns) {
        before[tree.first].get_or_insert_with(|| {
            rivals.push(Rival {
                bvh: &maker.firsts[tree.first].bvh,
                timed: false,
            });
            rivals.len() - 1
        });
    }
    let timing = Timing {
        clock,
        rounds: rounds.max(1),
    };
    let contest = Contest::new(&job, rivals, timing, options.cost_map);
    let sums = pass::run(
        &job,
        options,
        &trees[0].bvh,
        &training.learned,
        done,
        Some(&contest),
    )?;
    let developing = Instant::now();
    let image = sums.film.image(world.film.resolution)?;
    let developing = developing.elapsed().as_secs_f64();
    let mut found = contest.into_found().ok_or(Error::Cancelled)?;
    let maps = std::mem::take(&mut found.maps);
    let main = sums.effort.counts;
    let mut total = main;
    if let Some(prepass) = &training.learned.prepass {
        total.add(&prepass.counts);
    }
    let composer = Composer {
        found: &found,
        closest: closest_times(&trees, &found),
        training: &training,
        main: &main,
        developing,
    };
    let figures = trees.iter().enumerate().map(|(place, tree)| {
        let map = maps.get(place).map(Vec::as_slice);
        let before = match tree.learns {
            true => before[tree.first].unwrap_or(place),
            false => place,
        };
        ComparedTree {
            cost_map: map.map(|tests| per_ray(tests, &found.rays)),
            ..composer.tree(place, before, tree)
        }
    });
    Ok(Compared {
        image_hash: image_hash(&image),
        trees: figures.collect(),
        image,
        closest_rays: total.closest_rays,
        shadow_rays: total.shadow_rays,
        occluded_rays: total.occluded_rays,
        held_out_rays: main.shadow_rays,
    })
}

/// Mean tests per shadow ray of every pixel.
fn per_ray(tests: &[u64], rays: &[u64]) -> Vec<f32> {
    let of = |(&tests, &rays)| SampleCost { tests, rays }.mean();
    tests.iter().zip(rays).map(of).collect()
}

/// Makes the figures of a tree from what was measured of it and of all.
/// Seconds of timed closest hits, tree by tree. They do not depend on the order of children, so trees that differ by that
/// alone share the median.
fn closest_times(trees: &[Ready], found: &Found) -> Vec<f64> {
    let median_of = |first: usize| {
        let alike = trees
            .iter()
            .zip(&found.trees)
            .filter(|(tree, _)| tree.first == first);
        let mut seconds: Vec<f64> = alike.map(|(_, own)| own.closest).collect();
        seconds.sort_unstable_by(f64::total_cmp);
        seconds[seconds.len() / 2]
    };
    trees.iter().map(|tree| median_of(tree.first)).collect()
}

struct Composer<'a> {
    found: &'a Found,
    /// See [`closest_times`].
    closest: Vec<f64>,
    training: &'a Training,
    /// Rays of the main pass.
    main: &'a Counts,
    developing: f64,
}

impl Composer<'_> {
    fn tests(&self, place: usize) -> Option<[f64; 3]> {
        let rays = self.main.shadow_rays;
        let tests = self.found.trees[place].tests;
        (rays > 0).then(|| tests.map(|tests| tests as f64 / rays as f64))
    }

    fn tree(&self, place: usize, before: usize, tree: &Ready) -> ComparedTree {
        let (shared, own) = (&self.found.shared, &self.found.trees[place]);
        // Of all rays, from those that were timed.
        let scale = |[all, timed]: [u64; 2]| all as f64 / timed.max(1) as f64;
        let mut shadow: Vec<f64> = own
            .shadow
            .iter()
            .map(|s| s * scale(shared.shadow_rays))
            .collect();
        let closest = self.closest[place] * scale(shared.closest_rays);
        let learned = &tree.learned;
        let following = learned.following.as_secs_f64();
        let prepass = if tree.learns {
            self.training.shared + tree.log_busy
        } else {
            0.0
        };
        let sort = learned.sorting.as_secs_f64();
        let threads = rayon::current_num_threads() as f64;
        let serial = following + sort + self.developing;
        let work = prepass + closest + shared.shading + shared.film;
        let render_seconds = shadow
            .iter()
            .map(|s| serial + (work + s) / threads)
            .collect();
        shadow.sort_unstable_by(f64::total_cmp);
        let build = (tree.build + learned.rebuilding).as_secs_f64();
        ComparedTree {
            training_rays: learned.logged_rays,
            logging: tree.logging,
            before: self.tests(before),
            after: self.tests(place),
            predicted: learned.predicted,
            build_seconds: build,
            log_seconds: prepass / threads + following,
            sort_seconds: sort,
            order_seconds: learned.ordering.as_secs_f64(),
            render_seconds,
            split: Split {
                build,
                log: prepass + following,
                sort,
                shadow: shadow[shadow.len() / 2],
                closest,
                shading: shared.shading,
                film: shared.film + self.developing,
            },
            agrees: !own.differs,
            cost_map: None,
        }
    }
}
