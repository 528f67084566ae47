//! The samples of a picture so far: finished tiles, and tiles that were begun.

use std::collections::BTreeMap;
use std::time::Duration;

use antumbra_image::Window;
use serde::{Deserialize, Serialize};

use crate::film::{Film, Rules, TileFilm};
use crate::integrator::{Counts, SampleCost};

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
