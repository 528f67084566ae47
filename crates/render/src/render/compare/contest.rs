//! The trees of a comparison while the picture is traced, and the sums of all threads.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use antumbra::lab::Cost;
use antumbra_image::Window;

use super::super::job::Job;
use crate::film::{Sample, batch_depth};
use crate::integrator::{Map, Rival, RivalSums, Rivals, SharedSums, Timing};
use crate::sampler::mix;

/// Numbers of batches of paths whose shadow rays are timed, and closest hits, that are enough for every tree.
const ENOUGH_BATCHES: [u64; 2] = [64, 16];
/// Of a large picture, one batch in so many is timed.
const SPARSEST: [u64; 2] = [4, 16];

/// Trees that answer the queries of one picture, and their sums.
pub struct Contest<'a> {
    trees: Vec<Rival<'a>>,
    timing: Timing,
    /// One batch of paths in so many is timed: its shadow rays, and its closest hits.
    every: [u64; 2],
    window: Window,
    found: Mutex<(Vec<RivalSums>, SharedSums)>,
    /// Tests of every pixel of the window, tree by tree; empty unless wanted.
    maps: Vec<Mutex<Vec<u64>>>,
    /// Shadow rays of every pixel, in the same case.
    rays: Mutex<Vec<u64>>,
    /// Whether a thread stopped before all trees had answered its rays.
    incomplete: AtomicBool,
}

/// Sums of all threads.
#[derive(Debug, Default)]
pub struct Found {
    /// Sums of every tree.
    pub trees: Vec<RivalSums>,
    /// Sums that all trees share.
    pub shared: SharedSums,
    /// Tests of every pixel of the window, tree by tree; empty unless wanted.
    pub maps: Vec<Vec<u64>>,
    /// Shadow rays of every pixel, in the same case.
    pub rays: Vec<u64>,
}

/// Pixel outside of the window.
const OUTSIDE: u32 = u32::MAX;

impl<'a> Contest<'a> {
    /// A contest of trees for the picture of a job. With `maps`, tests are mapped.
    pub fn new(job: &Job, trees: Vec<Rival<'a>>, timing: Timing, maps: bool) -> Self {
        let window = job.rules.window;
        let depth = u64::from(batch_depth(job.tiles.window(0)));
        let batches = job.todo.len() as u64 * u64::from(job.spp).div_ceil(depth);
        let every = |kind: usize| (batches / ENOUGH_BATCHES[kind]).clamp(1, SPARSEST[kind]);
        let sums = RivalSums {
            shadow: vec![0.0; timing.rounds],
            ..RivalSums::default()
        };
        let map = || Mutex::new(vec![0; window.area()]);
        Self {
            every: [0, 1].map(every),
            window,
            found: Mutex::new((vec![sums; trees.len()], SharedSums::default())),
            maps: trees
                .iter()
                .filter(|tree| maps && tree.timed)
                .map(|_| map())
                .collect(),
            rays: if maps { map() } else { Mutex::default() },
            incomplete: AtomicBool::new(false),
            trees,
            timing,
        }
    }

    /// The trees for one more thread, whose tests of pixels go to `map`, until `stop` is true.
    pub fn rivals<'t>(&'t self, map: Map<'t>, stop: &'t dyn Fn() -> bool) -> Rivals<'t> {
        let map = (!self.maps.is_empty()).then_some(map);
        Rivals::new(&self.trees, self.timing, map, stop)
    }

    /// Whether shadow rays and closest hits of a batch of paths are timed: one batch in so many, whichever thread
    /// traces it.
    pub fn times(&self, tile: usize, samples: &[Sample]) -> [bool; 2] {
        let first = samples.first().map_or(0, |sample| sample.index);
        let hash = mix(tile as u64 ^ u64::from(first) << 40);
        self.every.map(|every| hash.is_multiple_of(every))
    }

    /// Number of a sample's pixel.
    pub fn pixel(&self, sample: &Sample) -> u32 {
        let ([x, y], window) = (sample.pixel, self.window);
        if !window.contains(x, y) {
            return OUTSIDE;
        }
        let (row, column) = ((y - window.y0) as usize, (x - window.x0) as usize);
        (row * window.width() + column) as u32
    }

    /// Adds the tests of rays to their pixels.
    pub fn map(&self, tree: usize, pixels: &[u32], costs: &[Cost]) {
        let Some(map) = self.maps.get(tree) else {
            return;
        };
        let mut map = map.lock().unwrap_or_else(PoisonError::into_inner);
        let inside = |(pixel, _): &(&u32, _)| **pixel != OUTSIDE;
        for (&pixel, cost) in pixels.iter().zip(costs).filter(inside) {
            map[pixel as usize] += u64::from(cost.node_tests) + u64::from(cost.prim_tests);
        }
        if tree == 0 {
            let mut rays = self.rays.lock().unwrap_or_else(PoisonError::into_inner);
            for &pixel in pixels.iter().filter(|pixel| **pixel != OUTSIDE) {
                rays[pixel as usize] += 1;
            }
        }
    }

    /// Adds the sums of a thread.
    pub fn add(&self, rivals: Rivals) {
        let Some((trees, shared)) = rivals.into_sums() else {
            self.incomplete.store(true, Ordering::Relaxed);
            return;
        };
        let mut found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        let (sums, all) = &mut *found;
        for (sum, own) in sums.iter_mut().zip(trees) {
            for (sum, own) in sum.tests.iter_mut().zip(own.tests) {
                *sum += own;
            }
            for (sum, own) in sum.shadow.iter_mut().zip(own.shadow) {
                *sum += own;
            }
            sum.closest += own.closest;
            sum.differs |= own.differs;
        }
        for place in 0..2 {
            all.shadow_rays[place] += shared.shadow_rays[place];
            all.closest_rays[place] += shared.closest_rays[place];
        }
        all.shading += shared.shading;
        all.film += shared.film;
    }

    /// The sums of all threads. `None` if one of them stopped before.
    pub fn into_found(self) -> Option<Found> {
        if self.incomplete.into_inner() {
            return None;
        }
        let found = self.found.into_inner();
        let (trees, shared) = found.unwrap_or_else(PoisonError::into_inner);
        let maps = self.maps.into_iter().map(Mutex::into_inner);
        Some(Found {
            trees,
            shared,
            rays: self
                .rays
                .into_inner()
                .unwrap_or_else(PoisonError::into_inner),
            maps: maps
                .map(|map| map.unwrap_or_else(PoisonError::into_inner))
                .collect(),
        })
    }
}
