//! Where the threads of a rendering put down what they have done, so that it can be copied at any time.
//!
//! A tile under work lies in the slot of its thread, which locks it only while samples are added: whoever makes
//! a copy waits no longer than that, and nobody waits for the tracing.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use antumbra_image::Window;
use serde::{Deserialize, Serialize};

use crate::film::{Film, Rules, TileFilm};
use crate::integrator::SampleCost;
use crate::integrator::tracer::Counts;

/// What it took to do something.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Effort {
    /// Rays.
    pub counts: Counts,
    /// Time of all threads.
    pub busy: Duration,
    /// The part of it that went into the film.
    pub filming: Duration,
}

impl Effort {
    /// Adds what something else took.
    pub fn add(&mut self, other: &Self) {
        self.counts.add(&other.counts);
        self.busy += other.busy;
        self.filming += other.filming;
    }
}

/// A tile that was begun.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TileWork {
    /// Its samples so far.
    pub film: TileFilm,
    /// How many samples of every pixel that are: whole waves.
    pub done: u32,
    /// What its pixels' shadow rays cost, if that is wanted.
    pub costs: Option<Vec<SampleCost>>,
    /// What it took.
    pub effort: Effort,
}

impl TileWork {
    /// A tile without samples.
    pub fn new(rules: Rules, window: Window, costs: bool) -> Self {
        Self {
            film: TileFilm::new(rules, window),
            done: 0,
            costs: costs.then(|| vec![SampleCost::default(); window.area()]),
            effort: Effort::default(),
        }
    }
}

/// Everything that is done of a picture.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Sums {
    /// The finished tiles.
    pub film: Film,
    /// Costs of their pixels, row by row of the picture's window, if they are wanted.
    pub costs: Option<Vec<SampleCost>>,
    /// What they took.
    pub effort: Effort,
    /// Tiles that were begun and have no thread.
    pub begun: BTreeMap<usize, TileWork>,
}

impl Sums {
    /// Nothing done yet.
    pub fn new(film: Film, costs: bool) -> Self {
        let area = film.rules().window.area();
        Self {
            film,
            costs: costs.then(|| vec![SampleCost::default(); area]),
            effort: Effort::default(),
            begun: BTreeMap::new(),
        }
    }
}

/// What all threads share. Who locks the sums and a slot locks the sums first.
pub struct Desk {
    sums: Mutex<Sums>,
    slots: Vec<Mutex<Option<(usize, TileWork)>>>,
}

impl Desk {
    /// A desk for so many threads, with what is already done.
    pub fn new(sums: Sums, threads: usize) -> Self {
        Self {
            sums: Mutex::new(sums),
            slots: (0..threads).map(|_| Mutex::default()).collect(),
        }
    }

    /// A thread takes up a tile: as it was left, or anew. Returns how many samples of every pixel it has.
    pub fn begin(&self, thread: usize, index: usize, anew: impl FnOnce() -> TileWork) -> u32 {
        let mut sums = lock(&self.sums);
        let tile = sums.begun.remove(&index).unwrap_or_else(anew);
        let done = tile.done;
        *lock(&self.slots[thread]) = Some((index, tile));
        done
    }

    /// A thread adds to its tile.
    pub fn add(&self, thread: usize, add: impl FnOnce(&mut TileWork)) {
        if let Some((_, tile)) = &mut *lock(&self.slots[thread]) {
            add(tile);
        }
    }

    /// The tile of a thread has all its samples. `tile` are its pixels.
    pub fn finish(&self, thread: usize, tile: Window) {
        let mut sums = lock(&self.sums);
        let Some((index, work)) = lock(&self.slots[thread]).take() else {
            return;
        };
        let window = sums.film.rules().window;
        if let (Some(map), Some(costs)) = (&mut sums.costs, &work.costs) {
            place(map, window, costs, tile);
        }
        sums.effort.add(&work.effort);
        sums.film.finish(index, work.film);
    }

    /// A copy of all that is done, also of tiles under work.
    pub fn copy(&self) -> Sums {
        let sums = lock(&self.sums);
        let mut copy = sums.clone();
        copy.begun
            .extend(self.slots.iter().filter_map(|slot| lock(slot).clone()));
        copy
    }

    /// All that is done, when no thread works any more.
    pub fn clear(self) -> Sums {
        let mut sums = self
            .sums
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        for slot in self.slots {
            sums.begun
                .extend(slot.into_inner().unwrap_or_else(PoisonError::into_inner));
        }
        sums
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Copies the costs of a tile's pixels to the map of the window.
fn place(map: &mut [SampleCost], window: Window, costs: &[SampleCost], tile: Window) {
    let pixels = (tile.y0..tile.y1).flat_map(|y| (tile.x0..tile.x1).map(move |x| (x, y)));
    for ((x, y), &cost) in pixels.zip(costs) {
        if window.contains(x, y) {
            let (row, column) = (y - window.y0, x - window.x0);
            map[row as usize * window.width() + column as usize] = cost;
        }
    }
}
