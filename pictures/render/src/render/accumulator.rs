//! The tile accumulator: where threads put samples and finished tiles, to be copied at any time.
//!
//! A tile that is being traced lies in the slot of its thread. The thread locks the slot only while it adds samples,
//! so a copy waits for an addition at most, never for tracing.

use std::sync::{Mutex, MutexGuard, PoisonError};

use antumbra_image::Window;

use crate::integrator::SampleCost;
use crate::resume::{Sums, TileWork};

/// Sums of a picture, and a slot for every thread. Lock the sums before a slot.
pub struct TileAccumulator {
    sums: Mutex<Sums>,
    slots: Vec<Mutex<Option<(usize, TileWork)>>>,
}

impl TileAccumulator {
    /// An accumulator for `threads` threads, on top of `sums`.
    pub fn new(sums: Sums, threads: usize) -> Self {
        Self {
            sums: Mutex::new(sums),
            slots: (0..threads).map(|_| Mutex::default()).collect(),
        }
    }

    /// Takes up a tile, as it was left or else `anew`. Returns the number of samples that every pixel has.
    pub fn begin(&self, thread: usize, index: usize, anew: impl FnOnce() -> TileWork) -> u32 {
        let mut sums = lock(&self.sums);
        let tile = sums.begun.remove(&index).unwrap_or_else(anew);
        let done = tile.done;
        *lock(&self.slots[thread]) = Some((index, tile));
        done
    }

    /// Adds samples to the tile of a thread.
    pub fn add(&self, thread: usize, add: impl FnOnce(&mut TileWork)) {
        if let Some((_, tile)) = &mut *lock(&self.slots[thread]) {
            add(tile);
        }
    }

    /// Finishes the tile of a thread, whose pixels are `tile`.
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

    /// A copy of the sums, unfinished tiles included.
    pub fn copy(&self) -> Sums {
        let sums = lock(&self.sums);
        let mut copy = sums.clone();
        copy.begun
            .extend(self.slots.iter().filter_map(|slot| lock(slot).clone()));
        copy
    }

    /// The sums, once all threads have stopped.
    pub fn into_sums(self) -> Sums {
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

/// Copies the costs of a tile's pixels to the cost map of the window.
fn place(map: &mut [SampleCost], window: Window, costs: &[SampleCost], tile: Window) {
    let pixels = (tile.y0..tile.y1).flat_map(|y| (tile.x0..tile.x1).map(move |x| (x, y)));
    for ((x, y), &cost) in pixels.zip(costs) {
        if window.contains(x, y) {
            let (row, column) = (y - window.y0, x - window.x0);
            map[row as usize * window.width() + column as usize] = cost;
        }
    }
}
