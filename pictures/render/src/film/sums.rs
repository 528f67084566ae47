//! Sums over the samples of a rectangle of pixels.
//!
//! # Memory
//!
//! With the default filter, a box of one pixel, every sample weighs 1 and belongs to one pixel. Then sums of weights are
//! numbers of samples, and only those are kept: 26 bytes per pixel, 50 with the sums of the standard error. Other filters
//! take 34 bytes, 90 with the standard error.

use antumbra_image::Window;
use serde::{Deserialize, Serialize};

use super::counts::Counts;
use super::rules::{Rules, StoredWindow};

/// Sums for the standard error that equal other sums if every sample weighs 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Mixed {
    /// Sum of weight² * value.
    pub value: [f64; 3],
    /// Sum of weight².
    pub weight: f64,
}

/// Sums over the samples of a rectangle of pixels, row by row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PixelSums {
    #[serde(with = "StoredWindow")]
    pub window: Window,
    /// Sums of weight * value.
    weighted: Vec<[f64; 3]>,
    /// Number of samples of each pixel.
    samples: Counts,
    /// Sums of weights. Empty if every sample weighs 1.
    weights: Vec<f64>,
    /// Sums of (weight * value)². Empty without a standard error.
    squared: Vec<[f64; 3]>,
    /// Empty without a standard error, or if every sample weighs 1.
    mixed: Vec<Mixed>,
}

impl PixelSums {
    /// Sums without samples.
    pub fn new(window: Window, rules: &Rules) -> Self {
        let [all, weights, squared, mixed] = lengths(window, rules);
        Self {
            window,
            weighted: vec![[0.0; 3]; all],
            samples: Counts::new(all),
            weights: vec![0.0; weights],
            squared: vec![[0.0; 3]; squared],
            mixed: vec![Mixed::default(); mixed],
        }
    }

    /// Whether the size is the one that [`PixelSums::new`] makes.
    pub fn fits(&self, window: Window, rules: &Rules) -> bool {
        let [all, rest @ ..] = lengths(window, rules);
        self.window == window
            && [self.weighted.len(), self.samples.len()] == [all; 2]
            && [self.weights.len(), self.squared.len(), self.mixed.len()] == rest
    }

    /// Memory of the lists in bytes.
    #[cfg(test)]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.weighted[..])
            + 2 * self.samples.len()
            + size_of_val(&self.weights[..])
            + size_of_val(&self.squared[..])
            + size_of_val(&self.mixed[..])
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Place of a pixel in the lists.
    pub fn index(&self, x: i32, y: i32) -> usize {
        let (row, column) = (y - self.window.y0, x - self.window.x0);
        row as usize * self.window.width() + column as usize
    }

    /// Sum of weight * value of a pixel.
    pub fn weighted(&self, index: usize) -> [f64; 3] {
        self.weighted[index]
    }

    /// Number of samples of a pixel.
    pub fn samples(&self, index: usize) -> u32 {
        self.samples.get(index)
    }

    /// Sum of the weights of a pixel.
    pub fn weight(&self, index: usize) -> f64 {
        let weight = self.weights.get(index).copied();
        weight.unwrap_or_else(|| f64::from(self.samples(index)))
    }

    /// Mean of a pixel, times `scale`. Negative means become black before. Where the weights cancel, the sum is
    /// not divided.
    pub fn mean(&self, index: usize, scale: f64) -> [f32; 3] {
        let weight = self.weight(index);
        let mean = |sum: f64| if weight == 0.0 { sum } else { sum / weight };
        self.weighted(index)
            .map(|sum| (mean(sum).max(0.0) * scale) as f32)
    }

    /// Sum of (weight * value)² of a pixel. 0 without a standard error.
    pub fn squared(&self, index: usize) -> [f64; 3] {
        self.squared.get(index).copied().unwrap_or_default()
    }

    /// Sums of weight² * value and of weight² of a pixel.
    pub fn mixed(&self, index: usize) -> Mixed {
        let mixed = self.mixed.get(index).copied();
        mixed.unwrap_or_else(|| Mixed {
            value: self.weighted(index),
            weight: self.weight(index),
        })
    }

    /// Adds a sample to a pixel.
    #[inline]
    pub fn sample(&mut self, index: usize, value: [f64; 3], weight: f64) {
        add(&mut self.weighted[index], value.map(|v| v * weight));
        self.samples.add(index, 1);
        if let Some(sum) = self.weights.get_mut(index) {
            *sum += weight;
        }
        if let Some(sum) = self.squared.get_mut(index) {
            add(sum, value.map(|v| v * weight * (v * weight)));
        }
        if let Some(sum) = self.mixed.get_mut(index) {
            add(&mut sum.value, value.map(|v| weight * weight * v));
            sum.weight += weight * weight;
        }
    }

    /// Adds the sums of a rectangle inside this one, by the same rules.
    pub fn add(&mut self, other: &Self) {
        for y in other.window.y0..other.window.y1 {
            for x in other.window.x0..other.window.x1 {
                let (to, from) = (self.index(x, y), other.index(x, y));
                add(&mut self.weighted[to], other.weighted[from]);
                self.samples.add(to, other.samples.get(from));
                if let Some(part) = other.weights.get(from) {
                    self.weights[to] += part;
                }
                if let Some(&part) = other.squared.get(from) {
                    add(&mut self.squared[to], part);
                }
                if let Some(part) = other.mixed.get(from) {
                    add(&mut self.mixed[to].value, part.value);
                    self.mixed[to].weight += part.weight;
                }
            }
        }
    }
}

/// Lengths of the lists: of all pixels, and of those that may be empty.
fn lengths(window: Window, rules: &Rules) -> [usize; 4] {
    let area = window.area();
    let if_kept = |kept: bool| if kept { area } else { 0 };
    let weighs = !rules.weigh_one();
    [
        area,
        if_kept(weighs),
        if_kept(rules.squares),
        if_kept(rules.squares && weighs),
    ]
}

/// Adds colour by colour.
fn add(sum: &mut [f64; 3], part: [f64; 3]) {
    for (sum, part) in sum.iter_mut().zip(part) {
        *sum += part;
    }
}
