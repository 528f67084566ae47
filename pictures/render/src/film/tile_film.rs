//! The film of one tile.

use antumbra_image::Window;
use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::filter;
use super::rules::Rules;
use super::sums::PixelSums;
use crate::color::luminance;

/// Sums of samples over the pixels that one tile reaches.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TileFilm {
    rules: Rules,
    pub(super) sums: PixelSums,
    /// Samples that were not finite or had negative luminance.
    pub(super) dropped: u64,
    /// Pixel of the first dropped sample.
    pub(super) dropped_at: Option<[i32; 2]>,
}

impl TileFilm {
    /// An empty film for the samples of the pixels in `tile`.
    pub fn new(rules: Rules, tile: Window) -> Self {
        Self {
            rules,
            sums: PixelSums::new(rules.reached(tile), &rules),
            dropped: 0,
            dropped_at: None,
        }
    }

    /// Whether the size fits a tile by these rules. A film from a file may have another.
    pub fn fits(&self, rules: &Rules, tile: Window) -> bool {
        self.sums.fits(rules.reached(tile), rules)
    }

    /// Pixels of `part` so far, row by row, from the samples of this tile only. `part` must lie inside of what the
    /// tile reaches.
    pub fn pixels(&self, part: Window) -> Vec<[f32; 3]> {
        let scale = f64::from(self.rules.scale);
        let rows = part.y0..part.y1;
        let places = rows.flat_map(|y| (part.x0..part.x1).map(move |x| (x, y)));
        places
            .map(|(x, y)| self.sums.mean(self.sums.index(x, y), scale))
            .collect()
    }

    /// Adds a sample of pixel (x, y), at position `inside` in `[0, 1)²`.
    ///
    /// Samples that are not finite or have negative luminance are dropped and counted, and add no weight. (pbrt
    /// counts them as black.)
    pub fn add(&mut self, [x, y]: [i32; 2], inside: [f32; 2], radiance: Vec3) {
        let bright = luminance(radiance);
        if !radiance.is_finite() || !bright.is_finite() || bright < -1e-5 {
            self.dropped += 1;
            self.dropped_at.get_or_insert([x, y]);
            return;
        }
        let value = if bright > self.rules.max_luminance {
            radiance * (self.rules.max_luminance / bright)
        } else {
            radiance
        };
        let value = value.to_array().map(f64::from);
        if self.rules.weigh_one() {
            let window = self.sums.window;
            if window.contains(x, y) {
                let index = self.sums.index(x, y);
                self.sums.sample(index, value, 1.0);
            }
            return;
        }
        let [rx, ry] = self.rules.radius;
        let ([left, right], [up, down]) = (span(inside[0], rx), span(inside[1], ry));
        let window = self.sums.window;
        for py in (y + up).max(window.y0)..(y + down).min(window.y1) {
            for px in (x + left).max(window.x0)..(x + right).min(window.x1) {
                let offset = [
                    (x - px) as f32 + inside[0] - 0.5,
                    (y - py) as f32 + inside[1] - 0.5,
                ];
                let weight = f64::from(filter::weight(&self.rules.filter, offset));
                let index = self.sums.index(px, py);
                self.sums.sample(index, value, weight);
            }
        }
    }
}

/// Pixels whose centre is at most `radius` away from position `inside` of pixel 0. The interval is half-open, so
/// that a box of one pixel holds each sample once.
fn span(inside: f32, radius: f32) -> [i32; 2] {
    let center = inside - 0.5;
    let first = (center - radius).floor() as i32 + 1;
    let last = (center + radius).floor() as i32;
    [first, last + 1]
}
