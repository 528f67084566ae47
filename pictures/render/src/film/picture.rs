//! The film of a picture, or of a part of it.

use std::borrow::Cow;
use std::collections::BTreeMap;

use antumbra_image::{Image, Window};
use serde::{Deserialize, Serialize};

use super::rules::Rules;
use super::shard::Shard;
use super::sums::PixelSums;
use super::tile::Tiles;
use super::tile_film::TileFilm;
use crate::Error;

/// Film of a picture, or of a shard of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Film {
    rules: Rules,
    /// Sums of the tiles before `next`.
    pub(super) sums: PixelSums,
    dropped: u64,
    dropped_at: Option<[i32; 2]>,
    next: usize,
    /// Finished tiles after `next`.
    waiting: BTreeMap<usize, TileFilm>,
    /// Whether all tiles wait, to be joined with the tiles of other films.
    apart: bool,
}

impl Film {
    /// Film of a whole picture, without samples.
    pub fn new(rules: Rules) -> Self {
        Self {
            rules,
            sums: PixelSums::new(rules.window, &rules),
            dropped: 0,
            dropped_at: None,
            next: 0,
            waiting: BTreeMap::new(),
            apart: false,
        }
    }

    /// Film without samples, whose tiles are kept apart: [`Film::join`] can add up the tiles of several films in the
    /// order of a single one, and tiles can get more samples.
    pub fn apart(rules: Rules) -> Self {
        Self {
            rules,
            sums: PixelSums::new(nothing(rules), &rules),
            dropped: 0,
            dropped_at: None,
            next: 0,
            waiting: BTreeMap::new(),
            apart: true,
        }
    }

    /// Rules by which samples enter pixels.
    pub fn rules(&self) -> Rules {
        self.rules
    }

    /// Whether a tile was handed in.
    pub fn has(&self, index: usize) -> bool {
        index < self.next || self.waiting.contains_key(&index)
    }

    /// Number of tiles handed in.
    pub fn finished(&self) -> usize {
        self.next + self.waiting.len()
    }

    /// Whether sizes and tile numbers fit a film of these tiles, or of a shard of them. A film from a
    /// file may have others.
    pub fn fits(&self, tiles: &Tiles, shard: Shard) -> bool {
        let mut waiting = self.waiting.iter();
        let sums = if self.apart {
            self.next == 0 && self.sums.fits(nothing(self.rules), &self.rules)
        } else {
            shard.is_whole() && self.sums.fits(self.rules.window, &self.rules)
        };
        sums && self.next <= tiles.count()
            && waiting.all(|(&index, tile)| {
                index >= self.next
                    && index < tiles.count()
                    && shard.holds(index)
                    && tile.fits(&self.rules, tiles.window(index))
            })
    }

    /// One film from the tiles of several that keep them apart. Each tile must be in exactly one.
    pub fn join(rules: Rules, films: impl IntoIterator<Item = Self>) -> Self {
        let mut sum = Self::new(rules);
        let mut waiting = BTreeMap::new();
        for film in films {
            waiting.extend(film.waiting);
        }
        for (index, tile) in waiting {
            sum.finish(index, tile);
        }
        sum
    }

    /// The tiles, by number. `None` if they were added up.
    pub fn into_tiles(self) -> Option<BTreeMap<usize, TileFilm>> {
        self.apart.then_some(self.waiting)
    }

    /// Whether tiles are kept apart.
    pub fn is_apart(&self) -> bool {
        self.apart
    }

    /// Sums of all tiles, waiting tiles included.
    fn all_sums(&self) -> Cow<'_, PixelSums> {
        let mut sums = if self.apart {
            Cow::Owned(PixelSums::new(self.rules.window, &self.rules))
        } else {
            Cow::Borrowed(&self.sums)
        };
        for tile in self.waiting.values() {
            sums.to_mut().add(&tile.sums);
        }
        sums
    }

    /// Hands in the film of tile `index`. Every tile must come exactly once, in any order.
    pub fn finish(&mut self, index: usize, tile: TileFilm) {
        self.waiting.insert(index, tile);
        if self.apart {
            return;
        }
        while let Some(tile) = self.waiting.remove(&self.next) {
            self.sums.add(&tile.sums);
            self.dropped += tile.dropped;
            self.dropped_at = self.dropped_at.or(tile.dropped_at);
            self.next += 1;
        }
    }

    /// Pixel of the first dropped sample, in the order of tiles and samples. Complete runs agree on the pixel.
    pub fn dropped_at(&self) -> Option<[i32; 2]> {
        let waiting = || self.waiting.values().find_map(|tile| tile.dropped_at);
        self.dropped_at.or_else(waiting)
    }

    /// Samples dropped so far.
    pub fn dropped(&self) -> u64 {
        let waiting = self.waiting.values().map(|tile| tile.dropped);
        self.dropped + waiting.sum::<u64>()
    }

    /// Picture of `width` x `height` pixels.
    ///
    /// A pixel without samples is black. Where the weights of the samples cancel, the sum is not divided.
    /// Filters with negative lobes may have negative means, which become black before the film's scale. Only a
    /// negative scale makes negative pixels.
    ///
    /// # Errors
    /// [`Error::Image`] for an empty window.
    pub fn image(&self, [width, height]: [u32; 2]) -> Result<Image, Error> {
        let scale = f64::from(self.rules.scale);
        let sums = self.all_sums();
        let pixels = (0..sums.len()).map(|index| sums.mean(index, scale));
        self.picture([width, height], pixels.collect())
    }

    /// Standard error of every pixel and channel, estimated from the variance of its samples. `None` unless
    /// requested.
    ///
    /// Infinite where nothing is known: with fewer than two samples, or where the weights of the samples add up
    /// to 0. Samples count as independent, so the estimate is too large for a stratified sampler.
    ///
    /// # Errors
    /// As [`Self::image`].
    pub fn standard_error(&self, [width, height]: [u32; 2]) -> Result<Option<Image>, Error> {
        if !self.rules.squares {
            return Ok(None);
        }
        let scale = f64::from(self.rules.scale).abs();
        let sums = self.all_sums();
        let pixels = (0..sums.len()).map(|index| {
            let n = f64::from(sums.samples(index));
            let weight = sums.weight(index);
            let (weighted, squared) = (sums.weighted(index), sums.squared(index));
            let mixed = sums.mixed(index);
            std::array::from_fn(|c| {
                if !(n >= 2.0 && weight * weight > 0.0) {
                    return f32::INFINITY;
                }
                let mean = weighted[c] / weight;
                let spread = squared[c] - 2.0 * mean * mixed.value[c] + mean * mean * mixed.weight;
                let variance = spread.max(0.0) / (weight * weight) * (n / (n - 1.0));
                (variance.sqrt() * scale) as f32
            })
        });
        self.picture([width, height], pixels.collect()).map(Some)
    }

    fn picture(&self, [width, height]: [u32; 2], pixels: Vec<[f32; 3]>) -> Result<Image, Error> {
        Image::new(width as usize, height as usize, self.rules.window, pixels).map_err(Error::Image)
    }
}

/// Window of the sums of a film whose tiles are kept apart: without pixels.
fn nothing(rules: Rules) -> Window {
    Window {
        x1: rules.window.x0,
        ..rules.window
    }
}
