//! An image at ever coarser resolution, with lookups averaged over the footprint of a pixel.
//!
//! # Levels
//!
//! The finest level is the image itself, shared with the scene unless its texels need another type. Coarser levels
//! are averages over boxes, kept as linear 16-bit fractions for 8-bit images. A level has half as many texels as the
//! finer one, rounded down. A texel is the average over the part of the finer level that it covers, so all levels
//! have one mean.
//!
//! pbrt-v3 first resamples an image whose sides are not powers of two with a wider filter. The image becomes larger,
//! and values may overshoot. Here such an image keeps its size.

use std::sync::{Arc, LazyLock};

use antumbra_scene::{Image, Pixels, TextureFilter, Wrap};
use glam::{IVec2, Vec2, Vec3};
use rayon::prelude::*;

use super::Value;
use super::mapping::Coordinates;

/// An image ready for lookups.
#[derive(Clone, Debug)]
pub struct Pyramid<T> {
    /// Levels from fine to coarse. The last has one texel.
    levels: Vec<Level<T>>,
    wrap: Wrap,
    /// Values of bytes.
    decode: &'static [f32; 256],
    /// Texels along the longer side of the finest level.
    longest: f32,
}

#[derive(Clone, Debug)]
struct Level<T> {
    size: IVec2,
    texels: Texels<T>,
}

/// Texels of a level, rows from top to bottom.
#[derive(Clone, Debug)]
enum Texels<T> {
    /// Texels of the image itself.
    Image(Arc<Image>),
    /// Linear fractions of 65535, in grey.
    GreyWords(Vec<u16>),
    Words(Vec<[u16; 3]>),
    Floats(Vec<T>),
}

/// Largest ratio of length to width of an ellipse, to bound the work. Longer ellipses are widened.
const MAX_ANISOTROPY: f32 = 256.0;

/// Linear value of an sRGB-encoded one (IEC 61966-2-1).
fn linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        libm::powf((encoded + 0.055) / 1.055, 2.4)
    }
}

static ENCODED_BYTES: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| linear(byte as f32 / 255.0)));
static LINEAR_BYTES: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| byte as f32 / 255.0));

/// Values of bytes, with or without gamma.
pub fn bytes(gamma: bool) -> &'static [f32; 256] {
    if gamma { &ENCODED_BYTES } else { &LINEAR_BYTES }
}

/// Linear value of a texel. As in pbrt-v3, luminance is taken of the encoded colour.
fn decoded<T: Value>(color: Vec3, gamma: bool) -> T {
    let value = T::of(color);
    if gamma { value.each(linear) } else { value }
}

/// Texel coordinate wrapped into `0..size`. `None` outside of an image that ends in black.
#[inline]
pub fn wrapped(coordinate: i32, size: i32, wrap: Wrap) -> Option<i32> {
    match wrap {
        Wrap::Repeat if size & (size - 1) == 0 => Some(coordinate & (size - 1)),
        Wrap::Repeat => Some(coordinate.rem_euclid(size)),
        Wrap::Clamp => Some(coordinate.clamp(0, size - 1)),
        Wrap::Black => (0..size).contains(&coordinate).then_some(coordinate),
    }
}

/// Texel below and left of a point in texture coordinates, and the fraction of the way to the next texels. Points
/// that are not finite count as 0.
#[inline]
pub fn footprint(st: Vec2, size: IVec2) -> (IVec2, Vec2) {
    let at = st * size.as_vec2() - 0.5;
    let at = if at.is_finite() { at } else { Vec2::ZERO };
    let low = at.floor();
    (low.as_ivec2(), at - low)
}

/// Width and height of an image.
pub fn size_of(image: &Image) -> IVec2 {
    IVec2::new(image.width as i32, image.height as i32)
}

impl<T: Value> Pyramid<T> {
    /// Builds the levels, in the current rayon pool.
    pub fn new(image: &Arc<Image>, wrap: Wrap, gamma: bool) -> Self {
        let size = size_of(image);
        let texels = match &image.pixels {
            Pixels::Grey8(_) => Texels::Image(Arc::clone(image)),
            Pixels::Rgb8(_) if T::IS_COLOR => Texels::Image(Arc::clone(image)),
            Pixels::Rgb8(pixels) => {
                let color = |p: &[u8; 3]| Vec3::from(p.map(f32::from)) / 255.0;
                Texels::Floats(
                    pixels
                        .par_iter()
                        .map(|p| decoded(color(p), gamma))
                        .collect(),
                )
            }
            Pixels::Rgb32(_) if T::IS_COLOR && !gamma => Texels::Image(Arc::clone(image)),
            Pixels::Rgb32(pixels) => {
                let pixels = pixels.par_iter();
                Texels::Floats(pixels.map(|&p| decoded(p.into(), gamma)).collect())
            }
        };
        let mut pyramid = Self {
            levels: vec![Level { size, texels }],
            wrap,
            decode: bytes(gamma),
            longest: size.max_element() as f32,
        };
        pyramid.build(&image.pixels);
        pyramid
    }

    fn build(&mut self, pixels: &Pixels) {
        let mut size = self.levels[0].size;
        let mut finer: Option<Vec<T>> = None;
        while size != IVec2::ONE {
            let next = (size / 2).max(IVec2::ONE);
            let texel = |x: i32, y: i32| match &finer {
                Some(texels) => texels[(y * size.x + x) as usize],
                None => self.stored(0, x, y),
            };
            let (columns, rows) = (shares(size.x, next.x), shares(size.y, next.y));
            let averages: Vec<T> = rows
                .par_iter()
                .flat_map_iter(|row| {
                    columns.iter().map(move |column| {
                        let mut sum = T::grey(0.0);
                        for (y, of_row) in (row.first..).zip(row.weights) {
                            for (x, of_column) in (column.first..).zip(column.weights) {
                                let weight = of_row * of_column;
                                if weight != 0.0 {
                                    sum = sum + texel(x, y) * weight;
                                }
                            }
                        }
                        sum
                    })
                })
                .collect();
            let word = |value: f32| (value * 65535.0 + 0.5) as u16;
            let texels = match pixels {
                Pixels::Grey8(_) => {
                    let grey = |value: &T| word(value.channels()[0]);
                    Texels::GreyWords(averages.iter().map(grey).collect())
                }
                Pixels::Rgb8(_) if T::IS_COLOR => {
                    let color = |value: &T| value.channels().map(word);
                    Texels::Words(averages.iter().map(color).collect())
                }
                _ => Texels::Floats(averages.clone()),
            };
            self.levels.push(Level { size: next, texels });
            finer = Some(averages);
            size = next;
        }
    }

    /// Texel of a level by its place in memory.
    #[inline]
    fn stored(&self, level: usize, x: i32, y: i32) -> T {
        let level = &self.levels[level];
        let index = y as usize * level.size.x as usize + x as usize;
        let fraction = |word: u16| f32::from(word) * (1.0 / 65535.0);
        match &level.texels {
            Texels::Image(image) => match &image.pixels {
                Pixels::Grey8(bytes) => T::grey(self.decode[usize::from(bytes[index])]),
                Pixels::Rgb8(bytes) => {
                    T::of(bytes[index].map(|b| self.decode[usize::from(b)]).into())
                }
                Pixels::Rgb32(colors) => T::of(colors[index].into()),
            },
            Texels::GreyWords(words) => T::grey(fraction(words[index])),
            Texels::Words(words) => T::of(words[index].map(fraction).into()),
            Texels::Floats(values) => values[index],
        }
    }

    /// Texel by its place in texture space, whose origin is at the bottom left.
    #[inline]
    fn texel(&self, level: usize, s: i32, t: i32) -> T {
        let size = self.levels[level].size;
        match (wrapped(s, size.x, self.wrap), wrapped(t, size.y, self.wrap)) {
            (Some(x), Some(y)) => self.stored(level, x, size.y - 1 - y),
            _ => T::grey(0.0),
        }
    }

    /// The one texel of the coarsest level.
    fn mean(&self) -> T {
        self.stored(self.levels.len() - 1, 0, 0)
    }

    /// Image averaged over the footprint of a pixel. Without a footprint, interpolated in the finest level.
    pub fn lookup(&self, at: &Coordinates, filter: TextureFilter) -> T {
        let [mut long, mut short] = at.steps;
        if long == Vec2::ZERO && short == Vec2::ZERO || !(long + short).is_finite() {
            return self.bilinear(0, at.st);
        }
        let max_anisotropy = match filter {
            TextureFilter::Trilinear => {
                let width = 2.0 * long.abs().max(short.abs()).max_element();
                return self.between(self.level_of(width), |level| self.bilinear(level, at.st));
            }
            TextureFilter::Ewa { max_anisotropy } if max_anisotropy >= 1.0 => {
                max_anisotropy.min(MAX_ANISOTROPY)
            }
            TextureFilter::Ewa { .. } => 1.0,
        };
        if long.length_squared() < short.length_squared() {
            std::mem::swap(&mut long, &mut short);
        }
        let (length, mut width) = (long.length(), short.length());
        if width * max_anisotropy < length && width > 0.0 {
            let wider = length / (width * max_anisotropy);
            short *= wider;
            width *= wider;
        }
        if width == 0.0 {
            return self.bilinear(0, at.st);
        }
        self.between(self.level_of(width), |level| {
            self.ellipse(level, at.st, long, short)
        })
    }

    /// Level whose texels, along the longer side, have this width.
    fn level_of(&self, width: f32) -> f32 {
        libm::log2f(width * self.longest).max(0.0)
    }

    /// Linear interpolation between two levels.
    fn between(&self, level: f32, value: impl Fn(usize) -> T) -> T {
        let last = self.levels.len() - 1;
        // Negated, so that NaN has the mean.
        if !(level < last as f32) {
            return self.mean();
        }
        let fine = level as usize;
        let share = level - fine as f32;
        if share == 0.0 {
            return value(fine);
        }
        let coarse = if fine + 1 == last {
            self.mean()
        } else {
            value(fine + 1)
        };
        value(fine) * (1.0 - share) + coarse * share
    }

    /// Bilinear interpolation between the four nearest texels of a level.
    #[inline]
    fn bilinear(&self, level: usize, st: Vec2) -> T {
        let (low, part) = footprint(st, self.levels[level].size);
        let (s, t) = (low.x, low.y);
        // Saturates 2^31 texels away only.
        let (right, above) = (s.saturating_add(1), t.saturating_add(1));
        self.texel(level, s, t) * ((1.0 - part.x) * (1.0 - part.y))
            + self.texel(level, s, above) * ((1.0 - part.x) * part.y)
            + self.texel(level, right, t) * (part.x * (1.0 - part.y))
            + self.texel(level, right, above) * (part.x * part.y)
    }

    /// Mean of the texels in an ellipse with these axes, weighted by a Gaussian (Heckbert 1989, *Fundamentals of
    /// Texture Mapping and Image Warping*, section 3.5.8).
    fn ellipse(&self, level: usize, st: Vec2, long: Vec2, short: Vec2) -> T {
        let size = self.levels[level].size.as_vec2();
        let center = st * size - 0.5;
        let (long, short) = (long * size, short * size);
        // a s² + b s t + c t² is 1 on the ellipse, which is never narrower than a texel.
        let a = long.y * long.y + short.y * short.y + 1.0;
        let b = -2.0 * (long.x * long.y + short.x * short.y);
        let c = long.x * long.x + short.x * short.x + 1.0;
        let area = a * c - 0.25 * b * b;
        let (a, b, c) = (a / area, b / area, c / area);
        let determinant = 4.0 * a * c - b * b;
        let half =
            2.0 * Vec2::new((determinant * c).sqrt(), (determinant * a).sqrt()) / determinant;
        if !center.is_finite() || !half.is_finite() {
            return self.mean();
        }
        let low = (center - half).ceil().as_ivec2();
        let high = (center + half).floor().as_ivec2();
        let gaussian: &[f32; 128] = &GAUSSIAN;
        let (mut sum, mut weights) = (T::grey(0.0), 0.0);
        for y in low.y..=high.y {
            let t = y as f32 - center.y;
            for x in low.x..=high.x {
                let s = x as f32 - center.x;
                let squared = a * s * s + b * s * t + c * t * t;
                if squared < 1.0 {
                    let weight = gaussian[((squared * 128.0) as usize).min(127)];
                    sum = sum + self.texel(level, x, y) * weight;
                    weights += weight;
                }
            }
        }
        if weights > 0.0 {
            sum * (1.0 / weights)
        } else {
            self.bilinear(level, st)
        }
    }
}

/// `exp(-2 r²) - exp(-2)` by r².
static GAUSSIAN: LazyLock<[f32; 128]> = LazyLock::new(|| {
    std::array::from_fn(|i| libm::expf(-2.0 * i as f32 / 127.0) - libm::expf(-2.0))
});

/// Texels of a finer row that a coarser texel covers, with their weights.
struct Shares {
    first: i32,
    weights: [f32; 3],
}

/// Texels among `fine` ones that each of `coarse` texels covers: at most three, since `coarse` is half of `fine`.
fn shares(fine: i32, coarse: i32) -> Vec<Shares> {
    // All lengths are whole numbers in units of 1 / coarse of a fine texel.
    let (fine, coarse) = (i64::from(fine), i64::from(coarse));
    let overlap = |from: i64, to: i64, texel: i64| {
        let covered = to.min((texel + 1) * coarse) - from.max(texel * coarse);
        covered.max(0) as f32 / fine as f32
    };
    (0..coarse)
        .map(|i| {
            let (from, to) = (i * fine, (i + 1) * fine);
            let first = from / coarse;
            Shares {
                first: first as i32,
                weights: [0, 1, 2].map(|j| overlap(from, to, first + j)),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests;
