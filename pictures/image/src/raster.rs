//! [`Raster`]: pixels as a file stores them, without conversion.
//!
//! Textures are read this way, because only the lookup knows whether they are sRGB, linear or no colours.

use crate::Error;

/// Largest number of pixels of an image that is read.
pub(crate) const MAX_PIXELS: u64 = 1 << 27;
/// Image with the values of its file, row by row, top row first. There is at least one pixel.
///
/// 8-bit values and floats are kept, and 16-bit values are divided by 65535. No colour space is converted. Alpha is
/// dropped, and palettes are looked up. OpenEXR files give the pixels of their data window.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    width: u32,
    height: u32,
    samples: Samples,
}

/// Values of a [`Raster`], `[pixels]` or `[pixels, 3]`.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Grey values from 0 to 255.
    Grey8(Vec<u8>),
    /// Red, green and blue from 0 to 255.
    Rgb8(Vec<[u8; 3]>),
    /// Red, green and blue, unbounded.
    Rgb32(Vec<[f32; 3]>),
}

impl Samples {
    /// Number of pixels.
    pub fn len(&self) -> usize {
        match self {
            Self::Grey8(values) => values.len(),
            Self::Rgb8(values) => values.len(),
            Self::Rgb32(values) => values.len(),
        }
    }

    /// Bytes of all values.
    pub(crate) fn bytes(&self) -> u64 {
        let bytes = match self {
            Self::Grey8(values) => size_of_val(&values[..]),
            Self::Rgb8(values) => size_of_val(&values[..]),
            Self::Rgb32(values) => size_of_val(&values[..]),
        };
        bytes as u64
    }

    /// Returns true if there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Raster {
    /// Makes an image of `width * height` pixels, row by row, top row first.
    ///
    /// # Errors
    /// [`Error::BadSize`] or [`Error::WrongCount`].
    pub fn new(width: u32, height: u32, samples: Samples) -> Result<Self, Error> {
        let size = [width as usize, height as usize];
        let [valid_width, valid_height] = size.map(|s| (1..=i32::MAX as usize).contains(&s));
        if !valid_width || !valid_height {
            let [width, height] = size;
            return Err(Error::BadSize { width, height });
        }
        let expected = size[0].saturating_mul(size[1]);
        if samples.len() != expected {
            return Err(Error::WrongCount {
                expected,
                found: samples.len(),
            });
        }
        Ok(Self {
            width,
            height,
            samples,
        })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Values, row by row, top row first.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// Values by value, row by row, top row first.
    pub fn into_samples(self) -> Samples {
        self.samples
    }
}

/// Checks the size of an image before anything is allocated.
pub(crate) fn check_size(width: u64, height: u64) -> Result<(), String> {
    let pixels = width.saturating_mul(height);
    if pixels == 0 {
        return Err(format!(
            "the size {width} x {height} is empty; width and height must be at least 1"
        ));
    }
    if pixels > MAX_PIXELS {
        return Err(format!(
            "{width} x {height} pixels are more than the {MAX_PIXELS} allowed"
        ));
    }
    Ok(())
}

/// Checks that a file is long enough for the image that its header declares, at the best compression of its format.
///
/// Called before anything is allocated, so that a few damaged bytes cannot demand all memory. `what` names the unit of
/// `declared` and `most`.
pub(crate) fn check_fits(what: &str, declared: u64, most: u64, file: &[u8]) -> Result<(), String> {
    if declared <= most {
        return Ok(());
    }
    let length = file.len();
    Err(format!(
        "the header declares {declared} {what}, but a file of {length} bytes holds at most {most}; the file is cut \
         short, or its header is wrong"
    ))
}

/// Makes one value of each group of `channels` values.
pub(crate) fn map_pixels<T, U>(values: &[T], channels: usize, value: impl Fn(&[T]) -> U) -> Vec<U> {
    values.chunks_exact(channels).map(value).collect()
}

/// First three values of each group of `channels` values.
pub(crate) fn rgb8(values: &[u8], channels: usize) -> Vec<[u8; 3]> {
    map_pixels(values, channels, |p| [p[0], p[1], p[2]])
}
