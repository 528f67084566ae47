//! Tiles of the picture, and the samples of a tile in the order in which they are traced and added.

use antumbra_image::Window;

/// Edge of a tile in pixels. A constant, since pictures depend on it.
const EDGE: i32 = 16;

/// Approximate number of samples in a batch.
pub const BATCH: usize = 4096;

/// Tiles that cover a window, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Tiles {
    window: Window,
}

impl Tiles {
    /// Tiles of a window.
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

    /// Tile that a pixel of the window lies in.
    pub fn of(&self, x: i32, y: i32) -> usize {
        let column = (x - self.window.x0) / EDGE;
        let row = (y - self.window.y0) / EDGE;
        row as usize * self.across() + column as usize
    }

    /// Pixels of a tile.
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
    /// Column and row of the pixel.
    pub pixel: [i32; 2],
    /// Number of the sample in its pixel.
    pub index: u32,
}

/// Samples of a tile, cut into batches.
///
/// A batch holds a range of sample numbers of all pixels, pixel by pixel. The samples of a pixel come in ascending
/// order.
pub fn batches(tile: Window, spp: u32) -> impl Iterator<Item = impl Iterator<Item = Sample>> {
    batches_after(tile, spp, 0)
}

/// Samples of every pixel in a batch. The last batch may have fewer.
pub fn batch_depth(tile: Window) -> u32 {
    (BATCH / tile.area().max(1)).max(1) as u32
}

/// Batches that are left when the first `done` samples of every pixel are traced, which must be whole batches.
pub fn batches_after(
    tile: Window,
    spp: u32,
    done: u32,
) -> impl Iterator<Item = impl Iterator<Item = Sample>> {
    let each = batch_depth(tile);
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
    fn batches_hold_every_sample_once_and_in_order() {
        let tile = Tiles::new(WINDOW).window(0);
        let mut next = std::collections::HashMap::new();
        for batch in batches(tile, 37) {
            for sample in batch {
                let expected = next.entry(sample.pixel).or_insert(0);
                assert_eq!(sample.index, *expected);
                *expected += 1;
            }
        }
        assert_eq!(next.len(), tile.area());
        assert!(next.values().all(|&count| count == 37));
    }
}
