//! The trees of a comparison while the picture is traced, and the sums of all threads.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use antumbra::Bvh;
use antumbra::parts::Cost;
use antumbra_image::Window;
use antumbra_render::{Observer, PathBatch, Queries, SampleCost};
use xxhash_rust::xxh3::xxh3_64;

use super::thread::{SharedSums, Thread, TreeSums};

/// Numbers of batches of paths whose shadow rays are timed, and closest hits, that are enough for every tree.
const ENOUGH_BATCHES: [u64; 2] = [64, 16];
/// Of a large picture, one batch in so many is timed.
const SPARSEST: [u64; 2] = [4, 16];

/// A tree among others.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'b> {
    /// The tree.
    pub bvh: &'b Bvh,
    /// Whether its queries are timed. If not, they are only counted.
    pub timed: bool,
}

/// Trees that answer the queries of one picture, and their sums.
pub struct Comparison<'a> {
    /// The trees.
    pub trees: Vec<Candidate<'a>>,
    /// How often every timed batch of shadow rays is answered by each tree.
    pub rounds: usize,
    /// One batch of paths in so many is timed: its shadow rays, and its closest hits.
    every: [u64; 2],
    window: Window,
    found: Mutex<(Vec<TreeSums>, SharedSums)>,
    /// Costs of every pixel of the window, tree by tree; empty unless wanted.
    maps: Vec<Mutex<Vec<SampleCost>>>,
    /// Whether a thread stopped before all trees had answered its rays.
    incomplete: AtomicBool,
}

/// Sums of all threads.
#[derive(Debug, Default)]
pub struct Found {
    /// Sums of every tree.
    pub trees: Vec<TreeSums>,
    /// Sums that all trees share.
    pub shared: SharedSums,
    /// Costs of every pixel of the window, tree by tree; empty unless wanted.
    pub maps: Vec<Vec<SampleCost>>,
}

/// Pixel outside of the window.
const OUTSIDE: u32 = u32::MAX;

impl<'a> Comparison<'a> {
    /// A comparison on a picture of so many `batches` of paths. With `maps`, costs are mapped.
    pub fn new(
        trees: Vec<Candidate<'a>>,
        rounds: usize,
        window: Window,
        batches: u64,
        maps: bool,
    ) -> Self {
        let every = |kind: usize| (batches / ENOUGH_BATCHES[kind]).clamp(1, SPARSEST[kind]);
        let mapped = trees.iter().filter(|tree| maps && tree.timed);
        let map = |_| Mutex::new(vec![SampleCost::default(); window.area()]);
        Self {
            every: [0, 1].map(every),
            window,
            found: Mutex::new((
                vec![TreeSums::new(rounds); trees.len()],
                SharedSums::default(),
            )),
            maps: mapped.map(map).collect(),
            incomplete: AtomicBool::new(false),
            trees,
            rounds,
        }
    }

    /// Whether shadow rays and closest hits of a batch of paths are timed: one batch in so many, whichever thread
    /// traces it.
    pub fn times(&self, paths: &PathBatch<'_>) -> [bool; 2] {
        let hash = xxh3_64(&(paths.tile as u64 ^ u64::from(paths.first) << 40).to_le_bytes());
        self.every.map(|every| hash.is_multiple_of(every))
    }

    /// Whether costs are mapped.
    pub fn maps(&self) -> bool {
        !self.maps.is_empty()
    }

    /// Place of a pixel in the window.
    pub fn pixel(&self, [x, y]: [i32; 2]) -> u32 {
        let window = self.window;
        if !window.contains(x, y) {
            return OUTSIDE;
        }
        let (row, column) = ((y - window.y0) as usize, (x - window.x0) as usize);
        (row * window.width() + column) as u32
    }

    /// Adds the costs of rays in a tree to their pixels.
    pub fn map(&self, tree: usize, pixels: &[u32], costs: &[Cost]) {
        let Some(map) = self.maps.get(tree) else {
            return;
        };
        let mut map = map.lock().unwrap_or_else(PoisonError::into_inner);
        let inside = |(pixel, _): &(&u32, _)| **pixel != OUTSIDE;
        for (&pixel, cost) in pixels.iter().zip(costs).filter(inside) {
            map[pixel as usize].add(&SampleCost {
                tests: u64::from(cost.node_tests) + u64::from(cost.prim_tests),
                rays: 1,
            });
        }
    }

    /// Adds the sums of a thread: `None` if it stopped before all trees had answered its rays.
    pub fn add(&self, sums: Option<(Vec<TreeSums>, SharedSums)>) {
        let Some((trees, shared)) = sums else {
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
            maps: maps
                .map(|map| map.unwrap_or_else(PoisonError::into_inner))
                .collect(),
        })
    }
}

impl Observer for Comparison<'_> {
    fn thread<'t>(&'t self, stop: &'t dyn Fn() -> bool) -> Box<dyn Queries + 't> {
        Box::new(Thread::new(self, stop))
    }
}
