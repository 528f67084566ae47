//! Sums over the samples of a rectangle of pixels.

use antumbra_image::Window;
use serde::{Deserialize, Serialize};

use super::rules::StoredWindow;

/// Sums over the samples of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Pixel {
    pub weighted: [f64; 3],
    pub weight: f64,
}

/// Further sums over the samples of one pixel, for the standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Squares {
    /// Sum of (weight * value)².
    pub squared: [f64; 3],
    /// Sum of weight² * value.
    pub mixed: [f64; 3],
    /// Sum of weight².
    pub weight: f64,
    pub samples: u64,
}

/// Sums over the samples of a rectangle of pixels.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct PixelSums {
    #[serde(with = "StoredWindow")]
    pub window: Window,
    pub pixels: Vec<Pixel>,
    /// Empty without a standard error.
    pub squares: Vec<Squares>,
}

impl PixelSums {
    /// Sums without samples.
    pub fn new(window: Window, squares: bool) -> Self {
        let area = window.area();
        Self {
            window,
            pixels: vec![Pixel::default(); area],
            squares: vec![Squares::default(); if squares { area } else { 0 }],
        }
    }

    /// Whether the size is the one that [`PixelSums::new`] makes.
    pub fn fits(&self, window: Window, squares: bool) -> bool {
        let area = window.area();
        self.window == window
            && self.pixels.len() == area
            && self.squares.len() == if squares { area } else { 0 }
    }

    /// Place of a pixel in the lists.
    pub fn index(&self, x: i32, y: i32) -> usize {
        let (row, column) = (y - self.window.y0, x - self.window.x0);
        row as usize * self.window.width() + column as usize
    }

    /// Adds the sums of a rectangle inside this one.
    pub fn add(&mut self, other: &Self) {
        for y in other.window.y0..other.window.y1 {
            for x in other.window.x0..other.window.x1 {
                let (to, from) = (self.index(x, y), other.index(x, y));
                let (sum, part) = (&mut self.pixels[to], &other.pixels[from]);
                add(&mut sum.weighted, part.weighted);
                sum.weight += part.weight;
                if let Some(part) = other.squares.get(from) {
                    let sum = &mut self.squares[to];
                    add(&mut sum.squared, part.squared);
                    add(&mut sum.mixed, part.mixed);
                    sum.weight += part.weight;
                    sum.samples += part.samples;
                }
            }
        }
    }
}

/// Adds colour by colour.
pub(super) fn add(sum: &mut [f64; 3], part: [f64; 3]) {
    for (sum, part) in sum.iter_mut().zip(part) {
        *sum += part;
    }
}
