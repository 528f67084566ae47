//! The film: samples become pixels, the same bits whatever the order in which tiles are finished.
//!
//! A tile adds the samples of *its own* pixels, in sample order, to a small film of its own. With a filter
//! wider than a pixel that film has a border, which overlaps the tiles around. Tile films are added to the
//! picture strictly in tile order; one that is finished early waits, and in a shard, which lacks tiles in
//! between, all do. Sums are double precision, and are stored and read again as they are.

pub mod filter;
mod shard;
pub mod tile;

use std::borrow::Cow;
use std::collections::BTreeMap;

use antumbra_image::{Image, Window};
use antumbra_scene::Filter;
use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::color::luminance;
pub use shard::{BadShard, Shard};
use tile::Tiles;

/// How a [`Window`] is stored.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Window")]
struct StoredWindow {
    x0: i32,
    y0: i32,
    x1: i32,
    y1: i32,
}

/// The rules by which samples enter pixels.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Rules {
    /// Pixels of the picture that are wanted.
    #[serde(with = "StoredWindow")]
    pub window: Window,
    filter: Filter,
    radius: [f32; 2],
    scale: f32,
    max_luminance: f32,
    squares: bool,
}

impl Rules {
    /// The rules of a scene's film; `squares` keeps what the standard error needs.
    pub fn new(film: &antumbra_scene::Film, squares: bool) -> Self {
        let [x0, x1, y0, y1] = film.pixel_bounds().map(|bound| bound as i32);
        Self {
            window: Window { x0, y0, x1, y1 },
            filter: film.filter,
            radius: filter::radius(&film.filter),
            scale: film.scale,
            max_luminance: film.max_sample_luminance,
            squares,
        }
    }

    /// Pixels that must be sampled: those of the window and, with a wide filter, those around it, even
    /// outside the picture.
    pub fn sampled(&self) -> Window {
        let [rx, ry] = self.radius.map(reach);
        let Window { x0, y0, x1, y1 } = self.window;
        Window {
            x0: x0 - rx,
            y0: y0 - ry,
            x1: x1 + rx,
            y1: y1 + ry,
        }
    }

    /// The pixels of the picture that samples of a tile reach.
    fn reached(&self, tile: Window) -> Window {
        let [rx, ry] = self.radius.map(reach);
        let inside = self.window;
        Window {
            x0: (tile.x0 - rx).max(inside.x0),
            y0: (tile.y0 - ry).max(inside.y0),
            x1: (tile.x1 + rx).min(inside.x1),
            y1: (tile.y1 + ry).min(inside.y1),
        }
    }

    /// Whether two are the same bit for bit.
    pub(crate) fn equals(&self, other: &Self) -> bool {
        let numbers = |rules: &Self| [rules.scale, rules.max_luminance].map(f32::to_bits);
        (self.window, self.squares) == (other.window, other.squares)
            && self.filter == other.filter
            && numbers(self) == numbers(other)
    }

    /// Whether a picture can be made by these rules, which may come from a damaged file.
    pub(crate) fn are_valid(&self) -> bool {
        let Window { x0, y0, x1, y1 } = self.window;
        let limit = i32::MAX / 4;
        let fits = [x0, y0, x1, y1].iter().all(|v| (0..limit).contains(v));
        let radius = self
            .radius
            .iter()
            .all(|r| *r > 0.0 && *r <= Filter::MAX_RADIUS);
        fits && !self.window.is_empty() && radius && self.radius == filter::radius(&self.filter)
    }
}

/// How many pixels beyond its own a sample of a pixel may reach.
fn reach(radius: f32) -> i32 {
    (radius - 0.5).ceil().max(0.0) as i32
}

/// Sums over the samples of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Pixel {
    weighted: [f64; 3],
    weight: f64,
}

/// Further sums, for the standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Squares {
    /// Sums of (weight * value)² and weight² * value.
    squared: [f64; 3],
    mixed: [f64; 3],
    weight: f64,
    samples: u64,
}

/// A rectangle of pixels that collects samples.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Patch {
    #[serde(with = "StoredWindow")]
    window: Window,
    pixels: Vec<Pixel>,
    squares: Vec<Squares>,
}

impl Patch {
    fn new(window: Window, squares: bool) -> Self {
        let area = window.area();
        Self {
            window,
            pixels: vec![Pixel::default(); area],
            squares: vec![Squares::default(); if squares { area } else { 0 }],
        }
    }

    /// Whether [`Patch::new`] would make one of this size.
    fn fits(&self, window: Window, squares: bool) -> bool {
        let area = window.area();
        self.window == window
            && self.pixels.len() == area
            && self.squares.len() == if squares { area } else { 0 }
    }

    fn index(&self, x: i32, y: i32) -> usize {
        let (row, column) = (y - self.window.y0, x - self.window.x0);
        row as usize * self.window.width() + column as usize
    }

    fn add(&mut self, other: &Self) {
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

fn add(sum: &mut [f64; 3], part: [f64; 3]) {
    for (sum, part) in sum.iter_mut().zip(part) {
        *sum += part;
    }
}

/// The film of one tile.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TileFilm {
    rules: Rules,
    patch: Patch,
    /// Samples that were not finite or had negative luminance.
    dropped: u64,
    /// Pixel of the first of them.
    dropped_at: Option<[i32; 2]>,
}

impl TileFilm {
    /// An empty film for the samples of the pixels in `tile`.
    pub fn new(rules: Rules, tile: Window) -> Self {
        Self {
            rules,
            patch: Patch::new(rules.reached(tile), rules.squares),
            dropped: 0,
            dropped_at: None,
        }
    }

    /// Whether this is the film of a tile by these rules; what was read from a file may be otherwise.
    pub fn fits(&self, rules: &Rules, tile: Window) -> bool {
        self.patch.fits(rules.reached(tile), rules.squares)
    }

    /// Adds a sample of pixel (x, y), at `inside` in `[0, 1)²` of it.
    ///
    /// Samples that are not finite or have negative luminance are dropped and counted; they are not even
    /// weighed. (pbrt counts them as black.)
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
        let [rx, ry] = self.rules.radius;
        let ([left, right], [up, down]) = (span(inside[0], rx), span(inside[1], ry));
        let window = self.patch.window;
        for py in (y + up).max(window.y0)..(y + down).min(window.y1) {
            for px in (x + left).max(window.x0)..(x + right).min(window.x1) {
                let offset = [
                    (x - px) as f32 + inside[0] - 0.5,
                    (y - py) as f32 + inside[1] - 0.5,
                ];
                let weight = f64::from(filter::weight(&self.rules.filter, offset));
                let index = self.patch.index(px, py);
                let pixel = &mut self.patch.pixels[index];
                add(&mut pixel.weighted, value.map(|v| v * weight));
                pixel.weight += weight;
                if let Some(squares) = self.patch.squares.get_mut(index) {
                    add(
                        &mut squares.squared,
                        value.map(|v| v * weight * (v * weight)),
                    );
                    add(&mut squares.mixed, value.map(|v| weight * weight * v));
                    squares.weight += weight * weight;
                    squares.samples += 1;
                }
            }
        }
    }
}

/// Pixels reached by a sample at `inside` of pixel 0: those whose centre is at most `radius` away, half-open
/// so that a box of one pixel holds each sample once.
fn span(inside: f32, radius: f32) -> [i32; 2] {
    let center = inside - 0.5;
    let first = (center - radius).floor() as i32 + 1;
    let last = (center + radius).floor() as i32;
    [first, last + 1]
}

/// The picture under way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Film {
    rules: Rules,
    /// Tiles before `next`.
    patch: Patch,
    dropped: u64,
    dropped_at: Option<[i32; 2]>,
    next: usize,
    /// Finished ones after it.
    waiting: BTreeMap<usize, TileFilm>,
    /// Whether all tiles wait, to be joined with those of other films.
    apart: bool,
}

impl Film {
    /// A picture without samples.
    pub fn new(rules: Rules) -> Self {
        Self {
            rules,
            patch: Patch::new(rules.window, rules.squares),
            dropped: 0,
            dropped_at: None,
            next: 0,
            waiting: BTreeMap::new(),
            apart: false,
        }
    }

    /// The same for some of the tiles of a picture: they are kept apart, so that [`Film::join`] can add up
    /// those of several films in the order of a single one.
    pub fn apart(rules: Rules) -> Self {
        let nothing = Window {
            x1: rules.window.x0,
            ..rules.window
        };
        Self {
            rules,
            patch: Patch::new(nothing, rules.squares),
            dropped: 0,
            dropped_at: None,
            next: 0,
            waiting: BTreeMap::new(),
            apart: true,
        }
    }

    /// The rules of this film.
    pub fn rules(&self) -> Rules {
        self.rules
    }

    /// Whether a tile was handed in.
    pub fn has(&self, index: usize) -> bool {
        index < self.next || self.waiting.contains_key(&index)
    }

    /// How many tiles were handed in.
    pub fn finished(&self) -> usize {
        self.next + self.waiting.len()
    }

    /// Whether sizes and tile numbers are those of a film of these tiles, or of a shard of them; what was read
    /// from a file may be otherwise.
    pub fn fits(&self, tiles: &Tiles, shard: Shard) -> bool {
        let mut waiting = self.waiting.iter();
        let sums = if shard.is_whole() {
            self.patch.fits(self.rules.window, self.rules.squares)
        } else {
            self.next == 0
        };
        sums && self.apart != shard.is_whole()
            && self.next <= tiles.count()
            && waiting.all(|(&index, tile)| {
                index >= self.next
                    && index < tiles.count()
                    && shard.holds(index)
                    && tile.fits(&self.rules, tiles.window(index))
            })
    }

    /// The film of the tiles of several films that are kept apart. Each tile must be in one of them.
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

    /// The sums of all tiles, also of those that wait.
    fn sums(&self) -> Cow<'_, Patch> {
        let mut patch = if self.apart {
            Cow::Owned(Patch::new(self.rules.window, self.rules.squares))
        } else {
            Cow::Borrowed(&self.patch)
        };
        for tile in self.waiting.values() {
            patch.to_mut().add(&tile.patch);
        }
        patch
    }

    /// Hands in the film of tile `index`. Every tile must come once, in any order.
    pub fn finish(&mut self, index: usize, tile: TileFilm) {
        self.waiting.insert(index, tile);
        if self.apart {
            return;
        }
        while let Some(tile) = self.waiting.remove(&self.next) {
            self.patch.add(&tile.patch);
            self.dropped += tile.dropped;
            self.dropped_at = self.dropped_at.or(tile.dropped_at);
            self.next += 1;
        }
    }

    /// Pixel of the first sample dropped, by tiles and in them by samples: the same in every run that is complete.
    pub fn dropped_at(&self) -> Option<[i32; 2]> {
        let waiting = || self.waiting.values().find_map(|tile| tile.dropped_at);
        self.dropped_at.or_else(waiting)
    }

    /// Samples dropped so far.
    pub fn dropped(&self) -> u64 {
        let waiting = self.waiting.values().map(|tile| tile.dropped);
        self.dropped + waiting.sum::<u64>()
    }

    /// The picture of `width` x `height` pixels. A pixel without samples is black; where the weights of the
    /// samples cancel, their sum stands undivided. Negative means (a filter may have negative lobes) become
    /// black before the film's scale, so only a negative scale makes negative pixels.
    ///
    /// # Errors
    /// [`Error::Image`] for an empty window.
    pub fn image(&self, [width, height]: [u32; 2]) -> Result<Image, Error> {
        let scale = f64::from(self.rules.scale);
        let sums = self.sums();
        let pixels = sums.pixels.iter().map(|pixel| {
            let mean = |sum: f64| {
                if pixel.weight == 0.0 {
                    sum
                } else {
                    sum / pixel.weight
                }
            };
            pixel
                .weighted
                .map(|sum| (mean(sum).max(0.0) * scale) as f32)
        });
        self.picture([width, height], pixels.collect())
    }

    /// Standard error of every pixel and channel, estimated from the variance of its samples; `None` unless
    /// asked for. Infinite where nothing is known: with fewer than two samples, or where the weights of the
    /// samples add up to 0, as those of a filter with negative lobes may.
    ///
    /// Samples count as independent. For a stratified sampler it is therefore too large.
    ///
    /// # Errors
    /// As [`Self::image`].
    pub fn standard_error(&self, [width, height]: [u32; 2]) -> Result<Option<Image>, Error> {
        if !self.rules.squares {
            return Ok(None);
        }
        let scale = f64::from(self.rules.scale).abs();
        let sums = self.sums();
        let pixels = sums.pixels.iter().zip(&sums.squares);
        let pixels = pixels.map(|(pixel, squares)| {
            let n = squares.samples as f64;
            let known = squares.samples >= 2 && pixel.weight * pixel.weight > 0.0;
            std::array::from_fn(|c| {
                if !known {
                    return f32::INFINITY;
                }
                let mean = pixel.weighted[c] / pixel.weight;
                let spread = squares.squared[c] - 2.0 * mean * squares.mixed[c]
                    + mean * mean * squares.weight;
                let variance = spread.max(0.0) / (pixel.weight * pixel.weight) * (n / (n - 1.0));
                (variance.sqrt() * scale) as f32
            })
        });
        self.picture([width, height], pixels.collect()).map(Some)
    }

    fn picture(&self, [width, height]: [u32; 2], pixels: Vec<[f32; 3]>) -> Result<Image, Error> {
        Image::new(width as usize, height as usize, self.rules.window, pixels).map_err(Error::Image)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film(filter: Filter) -> antumbra_scene::Film {
        antumbra_scene::Film {
            resolution: [4, 4],
            filter,
            ..Default::default()
        }
    }

    const FULL: Window = Window {
        x0: 0,
        y0: 0,
        x1: 4,
        y1: 4,
    };

    #[test]
    fn a_box_of_one_pixel_holds_each_sample_once() {
        let rules = Rules::new(&film(Filter::default()), true);
        assert_eq!(rules.sampled(), FULL);
        let mut tile = TileFilm::new(rules, FULL);
        for inside in [[0.0, 0.0], [0.5, 0.5], [1.0 - f32::EPSILON, 0.0]] {
            tile.add([1, 2], inside, Vec3::new(1.0, 2.0, 3.0));
        }
        let mut film = Film::new(rules);
        film.finish(0, tile);
        let weights: Vec<f64> = film.patch.pixels.iter().map(|p| p.weight).collect();
        let mut expected = vec![0.0; 16];
        expected[2 * 4 + 1] = 3.0;
        assert_eq!(weights, expected);
        let image = film.image([4, 4]).unwrap();
        assert_eq!(image.pixels()[9], [1.0, 2.0, 3.0]);
        assert_eq!(image.pixels()[0], [0.0; 3]);
        let errors = film.standard_error([4, 4]).unwrap().unwrap();
        assert_eq!(errors.pixels()[9], [0.0; 3]);
        assert_eq!(errors.pixels()[0], [f32::INFINITY; 3]);
    }

    #[test]
    fn wide_filters_reach_neighbours_and_samples_outside_count() {
        let rules = Rules::new(&film(Filter::Box { radius: [1.5, 0.5] }), false);
        let sampled = rules.sampled();
        assert_eq!(
            (sampled.x0, sampled.x1, sampled.y0, sampled.y1),
            (-1, 5, 0, 4)
        );
        let mut tile = TileFilm::new(rules, sampled);
        tile.add([-1, 0], [0.5, 0.5], Vec3::ONE);
        tile.add([2, 1], [0.5, 0.5], Vec3::ONE);
        let mut film = Film::new(rules);
        film.finish(0, tile);
        let weights: Vec<f64> = film.patch.pixels[..8].iter().map(|p| p.weight).collect();
        assert_eq!(weights, [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn tiles_are_added_in_order_whatever_order_they_come_in() {
        let rules = Rules::new(
            &film(Filter::Gaussian {
                radius: [2.0, 2.0],
                alpha: 1.0,
            }),
            false,
        );
        let tile = |index: usize| {
            let x = index as i32 * 2;
            let mut tile = TileFilm::new(
                rules,
                Window {
                    x0: x,
                    x1: x + 2,
                    ..FULL
                },
            );
            tile.add([x, 1], [0.3, 0.9], Vec3::splat(0.1 + index as f32 * 0.7));
            tile.add([x + 1, 1], [0.1, 0.2], Vec3::splat(1e-3));
            tile
        };
        let (mut one, mut other) = (Film::new(rules), Film::new(rules));
        [0, 1].into_iter().for_each(|i| one.finish(i, tile(i)));
        [1, 0].into_iter().for_each(|i| other.finish(i, tile(i)));
        assert_eq!(one.image([4, 4]).unwrap(), other.image([4, 4]).unwrap());
        assert!(one.image([4, 4]).unwrap().pixels()[5][0] > 0.0);
    }

    #[test]
    fn films_are_joined_in_the_order_of_tiles() {
        let rules = Rules::new(&film(Filter::Box { radius: [1.5, 0.5] }), false);
        // 2⁵³ + 1 + 1 is another number than 1 + 1 + 2⁵³.
        let tile = |index: usize| {
            let x = index as i32;
            let window = Window {
                x0: x,
                x1: x + 1,
                ..FULL
            };
            let mut tile = TileFilm::new(rules, window);
            let value = if index == 0 { 2.0_f32.powi(53) } else { 1.0 };
            tile.add([x, 1], [0.5, 0.5], Vec3::splat(value));
            tile.add([x, 1], [0.5, 0.5], Vec3::NAN);
            tile
        };
        let mut whole = Film::new(rules);
        (0..3).for_each(|index| whole.finish(index, tile(index)));
        let (mut one, mut other) = (Film::apart(rules), Film::apart(rules));
        [1, 2].into_iter().for_each(|i| one.finish(i, tile(i)));
        other.finish(0, tile(0));
        let joined = Film::join(rules, [one, other]);
        assert_eq!(joined.patch.pixels, whole.patch.pixels);
        assert_eq!(joined.dropped(), 3);
    }

    #[test]
    fn the_standard_error_is_that_of_the_textbook() {
        let mut scene = film(Filter::default());
        scene.scale = 2.0;
        let rules = Rules::new(&scene, true);
        let mut tile = TileFilm::new(rules, FULL);
        for value in [1.0, 2.0, 4.0, 5.0] {
            tile.add([0, 0], [0.5, 0.5], Vec3::splat(value));
        }
        let mut film = Film::new(rules);
        film.finish(0, tile);
        // Variance 10 / 3 of four samples, scaled by 2.
        let expected = 2.0 * (10.0_f32 / 3.0 / 4.0).sqrt();
        let found = film.standard_error([4, 4]).unwrap().unwrap().pixels()[0][0];
        assert!((found - expected).abs() < 1e-6);
        assert_eq!(film.image([4, 4]).unwrap().pixels()[0], [6.0; 3]);
    }

    #[test]
    fn weights_that_cancel_leave_the_standard_error_unknown() {
        // The triangle is 0 at its edge: two samples there weigh nothing.
        let triangle = Filter::Triangle { radius: [0.5, 0.5] };
        let rules = Rules::new(&film(triangle), true);
        let mut tile = TileFilm::new(rules, FULL);
        for value in [1.0, 2.0] {
            tile.add([0, 0], [0.0, 0.5], Vec3::splat(value));
        }
        let mut film = Film::new(rules);
        film.finish(0, tile);
        let pixels = film.patch.pixels.iter().zip(&film.patch.squares);
        let weightless = pixels.filter(|(p, s)| p.weight == 0.0 && s.samples == 2);
        assert_eq!(weightless.count(), 1);
        let errors = film.standard_error([4, 4]).unwrap().unwrap();
        assert!(errors.pixels().iter().all(|e| *e == [f32::INFINITY; 3]));
    }

    #[test]
    fn a_negative_scale_makes_negative_pixels_of_positive_means_only() {
        let mut scene = film(Filter::default());
        scene.scale = -2.0;
        let rules = Rules::new(&scene, true);
        let mut tile = TileFilm::new(rules, FULL);
        tile.add([0, 0], [0.5, 0.5], Vec3::new(5.0, -1.0, 0.0));
        let mut film = Film::new(rules);
        film.finish(0, tile);
        assert_eq!(film.image([4, 4]).unwrap().pixels()[0], [-10.0, 0.0, 0.0]);
    }

    #[test]
    fn bad_samples_are_dropped_and_bright_ones_dimmed() {
        let mut scene = film(Filter::default());
        scene.max_sample_luminance = 1.0;
        let rules = Rules::new(&scene, false);
        let mut tile = TileFilm::new(rules, FULL);
        for bad in [Vec3::NAN, Vec3::INFINITY, Vec3::splat(-1.0)] {
            tile.add([0, 0], [0.5, 0.5], bad);
        }
        tile.add([0, 0], [0.5, 0.5], Vec3::splat(8.0));
        let mut film = Film::new(rules);
        film.finish(0, tile);
        assert_eq!(film.dropped(), 3);
        assert_eq!(film.dropped_at(), Some([0, 0]));
        let pixel = film.image([4, 4]).unwrap().pixels()[0];
        assert!((pixel[0] - 1.0).abs() < 1e-5, "{pixel:?}");
    }
}
