//! Tiles of the picture, and the samples of a tile in the order in which they are traced and added.

use antumbra_image::Window;

use crate::sampler::mix;

/// Edge of a tile in pixels. It does not depend on anything, or pictures would.
const EDGE: i32 = 16;

/// Samples carried through the stages together, about.
const WAVE: usize = 4096;

/// The tiles that cover a window, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Tiles {
    window: Window,
}

impl Tiles {
    /// The tiles of a window.
    pub fn new(window: Window) -> Self {
        Self { window }
    }

    fn across(&self) -> usize {
        self.window.width().div_ceil(EDGE as usize)
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.across() * self.window.height().div_ceil(EDGE as usize)
    }

    /// The pixels of a tile.
    pub fn window(&self, index: usize) -> Window {
        let (column, row) = (index % self.across(), index / self.across());
        let x0 = self.window.x0 + column as i32 * EDGE;
        let y0 = self.window.y0 + row as i32 * EDGE;
        Window {
            x0,
            y0,
            x1: (x0 + EDGE).min(self.window.x1),
            y1: (y0 + EDGE).min(self.window.y1),
        }
    }
}

/// One sample of one pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// The pixel.
    pub pixel: [i32; 2],
    /// Number of the sample in its pixel.
    pub index: u32,
}

/// The samples of a tile, cut into waves: a range of sample numbers of all pixels at a time, and within a
/// wave pixel by pixel. The samples of a pixel come in ascending order.
pub fn waves(tile: Window, spp: u32) -> impl Iterator<Item = impl Iterator<Item = Sample>> {
    let each = (WAVE / tile.area().max(1)).max(1);
    (0..spp).step_by(each).map(move |first| {
        let last = spp.min(first.saturating_add(each as u32));
        (tile.y0..tile.y1).flat_map(move |y| {
            (tile.x0..tile.x1).flat_map(move |x| {
                (first..last).map(move |index| Sample {
                    pixel: [x, y],
                    index,
                })
            })
        })
    })
}

/// Which samples the pre-pass takes: one in `stride`, spread over pixels and sample numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Selection {
    stride: u32,
    seed: u64,
}

/// Samples that are enough to learn from whatever the size of the picture.
const WORTHWHILE: f64 = 4096.0;

/// One sample in so few at most, even of tiny pictures: the rest is left to profit.
const LEAST_STRIDE: f64 = 4.0;

impl Selection {
    /// About `share` of `pixels * spp` samples, but at least a few thousand if the picture has that many;
    /// `None` when the share is 0.
    pub fn new(share: f64, pixels: usize, spp: u32, seed: u64) -> Option<Self> {
        let samples = pixels as f64 * f64::from(spp);
        let wanted = (share * samples).max(WORTHWHILE);
        let stride = (samples / wanted).floor().max(LEAST_STRIDE);
        (share > 0.0).then_some(Self {
            stride: stride.min(f64::from(u32::MAX)) as u32,
            seed: mix(seed),
        })
    }

    /// One sample in so many is taken.
    pub fn stride(&self) -> u64 {
        u64::from(self.stride)
    }

    /// Whether a sample is taken.
    pub fn takes(&self, sample: Sample) -> bool {
        let [x, y] = sample.pixel.map(|v| u64::from(v as u32));
        let start = mix(self.seed ^ (x | y << 32)) as u32 % self.stride;
        // Neighbours start at random, so that a single sample per pixel is thinned out evenly too.
        (u64::from(start) + u64::from(sample.index)) % u64::from(self.stride) == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    const WINDOW: Window = Window {
        x0: -3,
        y0: 2,
        x1: 40,
        y1: 35,
    };

    #[test]
    fn tiles_cover_the_window_once() {
        let tiles = Tiles::new(WINDOW);
        let mut seen = HashSet::new();
        for index in 0..tiles.count() {
            let tile = tiles.window(index);
            for y in tile.y0..tile.y1 {
                for x in tile.x0..tile.x1 {
                    assert!(WINDOW.contains(x, y) && seen.insert((x, y)));
                }
            }
        }
        assert_eq!(seen.len(), WINDOW.area());
    }

    #[test]
    fn waves_hold_every_sample_once_and_in_order() {
        let tile = Tiles::new(WINDOW).window(0);
        let mut next = std::collections::HashMap::new();
        for wave in waves(tile, 37) {
            for sample in wave {
                let expected = next.entry(sample.pixel).or_insert(0);
                assert_eq!(sample.index, *expected);
                *expected += 1;
            }
        }
        assert_eq!(next.len(), tile.area());
        assert!(next.values().all(|&count| count == 37));
    }

    #[test]
    fn selections_take_their_share() {
        for (share, spp, size) in [(0.01, 64, 200), (0.01, 1, 200), (0.5, 16, 20), (1.0, 4, 8)] {
            let window = Window::full(size, size);
            let selection = Selection::new(share, window.area(), spp, 5).expect("a share");
            let taken = waves(window, spp)
                .flatten()
                .filter(|&s| selection.takes(s))
                .count();
            let samples = (window.area() * spp as usize) as f64;
            let expected = (share * samples)
                .max(WORTHWHILE)
                .min(samples / LEAST_STRIDE);
            let ratio = taken as f64 / expected;
            assert!(
                (0.6..1.7).contains(&ratio),
                "{share} {spp} {size}: {taken} {expected}"
            );
        }
        assert_eq!(Selection::new(0.0, 100, 1, 0), None);
    }
}
