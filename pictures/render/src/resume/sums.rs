//! The samples of a picture so far: finished tiles, and tiles that were begun.

use std::collections::BTreeMap;
use std::time::Duration;

use antumbra_image::Window;
use serde::{Deserialize, Serialize};

use crate::film::{Film, Rules, TileFilm};
use crate::integrator::{Batch, Counts, SampleCost};

/// Effort of some work.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Effort {
    /// Numbers of rays and tests.
    pub counts: Counts,
    /// Time of all threads.
    pub busy: Duration,
    /// Part of `busy` that went into the film.
    pub filming: Duration,
}

impl Effort {
    /// Adds the effort of other work.
    pub fn add(&mut self, other: &Self) {
        self.counts.add(&other.counts);
        self.busy += other.busy;
        self.filming += other.filming;
    }
}

/// A tile that was begun.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TileWork {
    /// Samples so far.
    pub film: TileFilm,
    /// Number of samples that every pixel has: whole batches.
    pub done: u32,
    /// Cost of the shadow rays of every pixel, if wanted.
    pub costs: Option<Vec<SampleCost>>,
    /// Effort so far.
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

    /// Adds sample `index` of a batch, of this pixel of the tile's `window`.
    pub fn add(&mut self, window: Window, [x, y]: [i32; 2], batch: &Batch, index: usize) {
        if let Some(costs) = &mut self.costs {
            let (row, column) = ((y - window.y0) as usize, (x - window.x0) as usize);
            costs[row * window.width() + column].add(&batch.costs[index]);
        }
        let inside = batch.inside[index];
        self.film.add([x, y], inside, batch.radiance(index));
    }
}

/// Samples of a picture so far.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Sums {
    /// Finished tiles.
    pub film: Film,
    /// Costs of finished pixels, row by row of the picture's window, if wanted.
    pub costs: Option<Vec<SampleCost>>,
    /// Effort of the finished tiles.
    pub effort: Effort,
    /// Unfinished tiles that no thread works on.
    pub begun: BTreeMap<usize, TileWork>,
}

impl Sums {
    /// Sums without samples.
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
