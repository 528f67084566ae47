//! Tiles of the picture, and the samples of a tile in the order in which they are traced and added.

use antumbra_image::Window;

use crate::sampler::mix;

/// Edge of a tile in pixels. It does not depend on anything, or pictures would.
const EDGE: i32 = 16;

/// Samples carried through the stages together, about.
pub const WAVE: usize = 4096;

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

    /// The tile that a pixel of the window lies in.
    pub fn of(&self, x: i32, y: i32) -> usize {
        let column = (x - self.window.x0) / EDGE;
        let row = (y - self.window.y0) / EDGE;
        row as usize * self.across() + column as usize
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
    waves_after(tile, spp, 0)
}

/// Samples of every pixel in a wave, but for the last one.
pub fn wave_depth(tile: Window) -> u32 {
    (WAVE / tile.area().max(1)).max(1) as u32
}

/// Those of the waves that are left when the first `done` samples of every pixel are, which must be whole waves.
pub fn waves_after(
    tile: Window,
    spp: u32,
    done: u32,
) -> impl Iterator<Item = impl Iterator<Item = Sample>> {
    let each = wave_depth(tile);
    (done..spp).step_by(each as usize).map(move |first| {
        let last = spp.min(first.saturating_add(each));
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

/// Which samples the pre-pass takes: a share of them, spread evenly over pixels and sample numbers.
///
/// A pixel's samples walk round a circle, each `step` further than the last, from a start of the pixel's
/// own; those that land in the first `step` of the circle are taken. That is one in `1 / share`, as evenly
/// as whole numbers allow, for any share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Selection {
    /// In units of 1 / [`CIRCLE`] of the circle; all of it takes every sample.
    step: u64,
    seed: u64,
}

/// Parts of the circle: a power of two, so that it survives arithmetic modulo 2^64, and as many as an `f64`
/// has exactly.
const CIRCLE: u64 = 1 << 53;

/// Shadow rays that are enough to learn from whatever the size of the picture.
const WORTHWHILE_RAYS: f64 = 16384.0;

/// Samples that are, however many rays each has: they have to cover the picture, too.
const WORTHWHILE: (f64, f64) = (1024.0, 4096.0);

/// But no more than this share of a small picture for that: the rest is left to profit.
const WORTHWHILE_SHARE: f64 = 0.25;

/// Samples beyond which nothing more is learned: some seconds of work, which an interruption may cost, and 50 MB.
const MOST: f64 = (1 << 22) as f64;

impl Selection {
    /// A `share` in 0..=1 of `pixels * spp` samples of about `rays` shadow rays each, raised to a few thousand
    /// samples or to a quarter of the picture, whichever is less, and lowered to 2²² samples; `None` when the share
    /// is 0.
    pub fn new(share: f64, rays: f64, pixels: usize, spp: u32, seed: u64) -> Option<Self> {
        let samples = pixels as f64 * f64::from(spp);
        let enough = (WORTHWHILE_RAYS / rays).clamp(WORTHWHILE.0, WORTHWHILE.1);
        let least = (enough / samples).min(WORTHWHILE_SHARE);
        (share > 0.0).then_some(Self {
            step: (share.max(least).min(MOST / samples).min(1.0) * CIRCLE as f64) as u64,
            seed: mix(seed),
        })
    }

    /// The share of the samples that is taken, floor included.
    pub fn share(&self) -> f64 {
        self.step as f64 / CIRCLE as f64
    }

    /// Whether a sample is taken.
    pub fn takes(&self, sample: Sample) -> bool {
        let [x, y] = sample.pixel.map(|v| u64::from(v as u32));
        // Neighbours start at random, so that a single sample per pixel is thinned out evenly too.
        let start = mix(self.seed ^ (x | y << 32));
        let walked = self.step.wrapping_mul(u64::from(sample.index));
        start.wrapping_add(walked) % CIRCLE < self.step
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
                    assert_eq!(tiles.of(x, y), index);
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
        // Share, rays per sample, samples per pixel, edge of the picture, share that is to be taken.
        let cases = [
            (0.01, 4.0, 64, 200, 0.01),
            (0.01, 4.0, 1, 200, 4096.0 / 40_000.0),
            (0.01, 1.0, 1, 200, 4096.0 / 40_000.0),
            (0.01, 8.0, 1, 200, 2048.0 / 40_000.0),
            (0.01, 64.0, 1, 200, 1024.0 / 40_000.0),
            (0.03, 4.0, 100, 200, 0.03),
            (0.5, 4.0, 16, 20, 0.5),
            (0.3, 4.0, 16, 20, 0.3),
            (0.9, 4.0, 7, 40, 0.9),
            (1e-9, 4.0, 16, 20, 0.25),
            (0.1, 4.0, 4, 8, 0.25),
            (1.0, 4.0, 2 << 14, 16, 0.5),
        ];
        for (share, rays, spp, size, expected) in cases {
            let window = Window::full(size, size);
            let selection = Selection::new(share, rays, window.area(), spp, 5).expect("a share");
            assert!((selection.share() - expected).abs() < 1e-12);
            let taken = waves(window, spp)
                .flatten()
                .filter(|&s| selection.takes(s))
                .count() as f64;
            let expected = expected * (window.area() * spp as usize) as f64;
            // A pixel takes its share rounded down or up at random: a deviation of half a sample at most.
            let deviation = 0.5 * (window.area() as f64).sqrt();
            assert!(
                (taken - expected).abs() < 4.0 * deviation,
                "{share} {spp} {size}: {taken} {expected}"
            );
        }
        assert_eq!(Selection::new(0.0, 4.0, 100, 1, 0), None);
    }

    #[test]
    fn a_pixel_takes_its_share_as_evenly_as_whole_numbers_allow() {
        for share in [0.26, 1.0 / 3.0, 0.5, 0.75, 0.999, 1.0] {
            let selection = Selection::new(share, 4.0, 1000, 1000, 9).expect("a share");
            for x in 0..50 {
                let mut taken = 0_u32;
                for index in 0..2000 {
                    let pixel = [x, -x];
                    taken += u32::from(selection.takes(Sample { pixel, index }));
                    let expected = share * f64::from(index + 1);
                    let off = (f64::from(taken) - expected).abs();
                    assert!(off < 1.0 + 1e-9, "{share}: {taken} of {}", index + 1);
                    assert!(share < 1.0 || taken == index + 1);
                }
            }
        }
    }
}
