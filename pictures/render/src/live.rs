//! Tiles of a running rendering, for whoever looks at it.
//!
//! Workers put every tile into its slot after each batch of samples. A viewer takes the tiles that changed since it
//! last looked. Both hold the lock of a slot only while they exchange a pointer, so a slow viewer never holds up a
//! worker. Tiles that change faster than a viewer looks are skipped, not queued.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use antumbra_image::{Image, Window};

use crate::Error;
use crate::film::{Rules, Tiles};

/// Picture of a running rendering, tile by tile.
#[derive(Debug)]
pub struct LiveTiles {
    resolution: [u32; 2],
    window: Window,
    tiles: Tiles,
    slots: Vec<Slot>,
}

/// Latest state of one tile.
#[derive(Debug, Default)]
struct Slot {
    /// Number of times that the tile was published.
    version: AtomicU64,
    tile: Mutex<Option<Arc<LiveTile>>>,
}

/// Part of the picture as it was when its tile was published.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveTile {
    /// Pixels of the tile, inside of the picture's window.
    pub window: Window,
    /// Linear RGB, row by row. The pixels are means of the tile's own samples; neighbours may reach into them later.
    pub pixels: Vec<[f32; 3]>,
    /// Mean node plus primitive tests per shadow ray, row by row, if they are mapped.
    pub tests: Option<Vec<f32>>,
}

/// Versions of the tiles that a viewer has seen. Every viewer has its own.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    versions: Vec<u64>,
}

impl LiveTiles {
    /// The tiles of a film, all without samples.
    pub fn new(film: &antumbra_scene::Film) -> Self {
        let rules = Rules::new(film, false);
        let tiles = Tiles::new(rules.sampled());
        let mut slots = Vec::new();
        slots.resize_with(tiles.count(), Slot::default);
        Self {
            resolution: film.resolution,
            window: rules.window,
            tiles,
            slots,
        }
    }

    /// Size of the full picture in pixels.
    pub fn resolution(&self) -> [u32; 2] {
        self.resolution
    }

    /// Pixels that are rendered.
    pub fn window(&self) -> Window {
        self.window
    }

    /// Tiles that were published since the viewer's last call. Unchanged tiles are not copied, and nobody waits.
    pub fn changed(&self, seen: &mut Seen) -> Vec<Arc<LiveTile>> {
        seen.versions.resize(self.slots.len(), 0);
        let mut changed = Vec::new();
        for (slot, seen) in self.slots.iter().zip(&mut seen.versions) {
            // The version is read before the tile. A tile that is replaced in between is found again.
            let version = slot.version.load(Ordering::Acquire);
            if version != *seen {
                *seen = version;
                changed.extend(lock(&slot.tile).clone());
            }
        }
        changed
    }

    /// The picture so far. Pixels without samples are black.
    ///
    /// # Errors
    /// [`Error::Image`] for an empty window.
    pub fn image(&self) -> Result<Image, Error> {
        let mut pixels = vec![[0.0; 3]; self.window.area()];
        for tile in self.changed(&mut Seen::default()) {
            tile.copy_to(&mut pixels, self.window);
        }
        let [width, height] = self.resolution.map(|side| side as usize);
        Image::new(width, height, self.window, pixels).map_err(Error::Image)
    }

    /// Replaces all tiles that differ from a picture of the same window, for pictures that are not rendered by samples.
    pub fn show(&self, image: &Image) {
        self.complete(image, |_| true);
    }

    /// Replaces a tile.
    pub(crate) fn publish(&self, index: usize, tile: LiveTile) {
        let Some(slot) = self.slots.get(index) else {
            return;
        };
        let tile = Arc::new(tile);
        // The old tile is freed after the lock.
        let old = lock(&slot.tile).replace(tile);
        slot.version.fetch_add(1, Ordering::Release);
        drop(old);
    }

    /// Replaces the tiles that differ from a picture, as far as `holds` says that they belong to it.
    pub(crate) fn complete(&self, image: &Image, holds: impl Fn(usize) -> bool) {
        for index in (0..self.slots.len()).filter(|&index| holds(index)) {
            let window = self.part(index);
            if window.is_empty() {
                continue;
            }
            let rows = window.y0..window.y1;
            let pixels = rows.flat_map(|y| (window.x0..window.x1).map(move |x| image.get(x, y)));
            let pixels: Vec<_> = pixels.map(Option::unwrap_or_default).collect();
            let before = lock(&self.slots[index].tile).clone();
            if before.as_ref().is_none_or(|tile| tile.pixels != pixels) {
                let tests = before.and_then(|tile| tile.tests.clone());
                self.publish(
                    index,
                    LiveTile {
                        window,
                        pixels,
                        tests,
                    },
                );
            }
        }
    }

    /// Pixels of a tile that are inside of the picture's window. May be empty: samples of a wide filter lie outside.
    pub(crate) fn part(&self, index: usize) -> Window {
        let (tile, whole) = (self.tiles.window(index), self.window);
        Window {
            x0: tile.x0.max(whole.x0),
            y0: tile.y0.max(whole.y0),
            x1: tile.x1.min(whole.x1),
            y1: tile.y1.min(whole.y1),
        }
    }
}

impl LiveTile {
    /// Copies the pixels to a picture of `window`, row by row. Pixels outside of it are left out.
    pub fn copy_to(&self, picture: &mut [[f32; 3]], window: Window) {
        let width = self.window.width();
        for (row, pixels) in self.pixels.chunks_exact(width.max(1)).enumerate() {
            let y = self.window.y0 + row as i32;
            for (column, pixel) in pixels.iter().enumerate() {
                let x = self.window.x0 + column as i32;
                if window.contains(x, y) {
                    let (down, right) = ((y - window.y0) as usize, (x - window.x0) as usize);
                    picture[down * window.width() + right] = *pixel;
                }
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::Film;

    fn film() -> Film {
        Film {
            resolution: [40, 20],
            ..Film::default()
        }
    }

    fn tile(live: &LiveTiles, index: usize, value: f32) -> LiveTile {
        let window = live.part(index);
        LiveTile {
            window,
            pixels: vec![[value; 3]; window.area()],
            tests: None,
        }
    }

    #[test]
    fn a_viewer_gets_every_change_once() {
        let live = LiveTiles::new(&film());
        let mut seen = Seen::default();
        assert!(live.changed(&mut seen).is_empty());
        live.publish(5, tile(&live, 5, 1.0));
        live.publish(1, tile(&live, 1, 2.0));
        live.publish(1, tile(&live, 1, 3.0));
        let found = live.changed(&mut seen);
        let values: Vec<_> = found.iter().map(|tile| tile.pixels[0][0]).collect();
        assert_eq!(values, [3.0, 1.0]);
        assert!(live.changed(&mut seen).is_empty());
        // Another viewer has seen nothing yet.
        assert_eq!(live.changed(&mut Seen::default()).len(), 2);
        let image = live.image().expect("a picture");
        assert_eq!(image.get(39, 19), Some([1.0; 3]));
        assert_eq!(image.get(20, 3), Some([3.0; 3]));
        assert_eq!(image.get(0, 0), Some([0.0; 3]));
    }

    #[test]
    fn a_finished_picture_replaces_what_differs() {
        let live = LiveTiles::new(&film());
        live.publish(0, tile(&live, 0, 0.5));
        live.publish(1, tile(&live, 1, 0.25));
        let mut seen = Seen::default();
        live.changed(&mut seen);
        let window = live.window();
        let image = Image::from_fn(40, 20, window, |_, _| [0.5; 3]).expect("a picture");
        live.complete(&image, |index| index < 3);
        let changed = live.changed(&mut seen);
        let corners: Vec<_> = changed.iter().map(|tile| tile.window.x0).collect();
        assert_eq!(corners, [16, 32]);
    }

    /// A viewer's last read returns the last published state, whatever happens in between.
    #[test]
    fn no_change_is_lost_between_threads() {
        let live = LiveTiles::new(&film());
        std::thread::scope(|scope| {
            let writers: Vec<_> = (0..3)
                .map(|index| {
                    let live = &live;
                    scope.spawn(move || {
                        for turn in 1..=2000 {
                            live.publish(index, tile(live, index, turn as f32));
                        }
                    })
                })
                .collect();
            let mut seen = Seen::default();
            let mut last = [0.0; 3];
            loop {
                let done = writers.iter().all(|writer| writer.is_finished());
                for tile in live.changed(&mut seen) {
                    let value = tile.pixels[0][0];
                    assert!(tile.pixels.iter().all(|pixel| *pixel == [value; 3]));
                    let index = tile.window.x0 as usize / 16;
                    assert!(value >= last[index]);
                    last[index] = value;
                }
                if done {
                    break;
                }
            }
            assert_eq!(last, [2000.0; 3]);
        });
    }
}
