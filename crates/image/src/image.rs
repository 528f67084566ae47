//! The image type: linear RGB in 32-bit floats, with the data window of a crop.

use std::fmt;
use std::path::Path;

use crate::{Error, Rgb8Image, format};

/// A rectangle of pixels: `x0 <= x < x1`, `y0 <= y < y1`, with (0, 0) the top left pixel of the full
/// picture and y pointing down.
///
/// Signed, since files may hold pixels outside the picture (overscan).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Window {
    /// First column.
    pub x0: i32,
    /// First row.
    pub y0: i32,
    /// One past the last column.
    pub x1: i32,
    /// One past the last row.
    pub y1: i32,
}

impl Window {
    /// The window that covers a whole picture. Sizes beyond `i32::MAX`, which [`Image`] refuses, saturate.
    pub fn full(width: usize, height: usize) -> Self {
        let end = |size| i32::try_from(size).unwrap_or(i32::MAX);
        Self {
            x0: 0,
            y0: 0,
            x1: end(width),
            y1: end(height),
        }
    }

    /// Number of columns; 0 if `x1 <= x0`.
    pub fn width(&self) -> usize {
        extent(self.x0, self.x1)
    }

    /// Number of rows; 0 if `y1 <= y0`.
    pub fn height(&self) -> usize {
        extent(self.y0, self.y1)
    }

    /// Number of pixels, saturating at `usize::MAX`.
    pub fn area(&self) -> usize {
        self.width().saturating_mul(self.height())
    }

    /// Whether the window holds no pixel.
    pub fn is_empty(&self) -> bool {
        self.area() == 0
    }

    /// Whether the pixel (x, y) lies inside.
    pub fn contains(&self, x: i32, y: i32) -> bool {
        (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y)
    }
}

/// Length of `start..end`, which may be longer than an `i32` can say.
fn extent(start: i32, end: i32) -> usize {
    if start < end {
        end.abs_diff(start) as usize
    } else {
        0
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { x0, y0, x1, y1 } = self;
        write!(f, "[{x0}, {x1}) x [{y0}, {y1})")
    }
}

/// A picture in linear RGB.
///
/// `width` and `height` are the size of the full picture in pixels. The pixels cover its data
/// [`window`](Self::window): the whole picture unless it was cropped. They are stored row by row, top
/// row first. There is always at least one pixel. Values may be anything, NaN and infinities included.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    window: Window,
    pixels: Vec<[f32; 3]>,
}

impl Image {
    /// An image from its parts; `pixels` holds `window.area()` values, row by row, top row first.
    ///
    /// The window may reach beyond the full picture or even miss it.
    ///
    /// # Errors
    /// [`Error::BadSize`], [`Error::EmptyWindow`] or [`Error::WrongCount`].
    pub fn new(
        width: usize,
        height: usize,
        window: Window,
        pixels: Vec<[f32; 3]>,
    ) -> Result<Self, Error> {
        let valid = 1..=i32::MAX as usize;
        if !valid.contains(&width) || !valid.contains(&height) {
            return Err(Error::BadSize { width, height });
        }
        if window.is_empty() {
            return Err(Error::EmptyWindow { window });
        }
        if pixels.len() != window.area() {
            return Err(Error::WrongCount {
                expected: window.area(),
                found: pixels.len(),
            });
        }
        Ok(Self {
            width,
            height,
            window,
            pixels,
        })
    }

    /// An image whose pixels are `pixel(x, y)`, called row by row, top row first.
    ///
    /// # Errors
    /// As [`Image::new`].
    pub fn from_fn(
        width: usize,
        height: usize,
        window: Window,
        mut pixel: impl FnMut(i32, i32) -> [f32; 3],
    ) -> Result<Self, Error> {
        let mut pixels = Vec::new();
        for y in window.y0..window.y1 {
            pixels.extend((window.x0..window.x1).map(|x| pixel(x, y)));
        }
        Self::new(width, height, window, pixels)
    }

    /// Width of the full picture in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height of the full picture in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The part of the picture the pixels cover.
    pub fn window(&self) -> Window {
        self.window
    }

    /// The pixels of the window, row by row, top row first.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// The pixels of the window, to be changed in place.
    pub fn pixels_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.pixels
    }

    /// The pixels of the window, taken out of the image.
    pub fn into_pixels(self) -> Vec<[f32; 3]> {
        self.pixels
    }

    /// The pixel at (x, y) of the full picture; `None` outside the window.
    pub fn get(&self, x: i32, y: i32) -> Option<[f32; 3]> {
        self.window.contains(x, y).then(|| {
            let (column, row) = (extent(self.window.x0, x), extent(self.window.y0, y));
            self.pixels[row * self.window.width() + column]
        })
    }

    /// Mean of each channel over the window, added up in `f64` in storage order, so that the same
    /// pixels always give the same bits. A NaN or infinity anywhere shows in its channel.
    pub fn mean(&self) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for pixel in &self.pixels {
            for (sum, &value) in sum.iter_mut().zip(pixel) {
                *sum += f64::from(value);
            }
        }
        sum.map(|sum| sum / self.pixels.len() as f64)
    }

    /// Number of pixels with a NaN or infinity in any channel.
    pub fn non_finite(&self) -> usize {
        let bad = |pixel: &&[f32; 3]| !pixel.iter().all(|value| value.is_finite());
        self.pixels.iter().filter(bad).count()
    }

    /// The pixels of the window for a display: each channel through [`srgb8`](crate::srgb8).
    pub fn to_srgb8(&self) -> Rgb8Image {
        let pixels = self.pixels.iter().map(|pixel| pixel.map(crate::srgb8));
        Rgb8Image::covering(self.window.width(), self.window.height(), pixels.collect())
    }

    /// Reads an image file; the extension of its name, in any case, chooses the format.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`], [`Error::Unsupported`] for a format that is only written,
    /// [`Error::Read`] or [`Error::Decode`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        format::read(path.as_ref())
    }

    /// The same for the bytes of a file; `path` names the format, and is what messages call it.
    ///
    /// # Errors
    /// As [`Image::read`], but for [`Error::Read`].
    pub fn parse(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, Error> {
        format::parse(bytes, path.as_ref())
    }

    /// Writes an image file; the extension of its name, in any case, chooses the format. The same
    /// image always gives the same bytes. The file appears as a whole or not at all, as with
    /// [`atomic_write`](crate::atomic_write).
    ///
    /// # Errors
    /// [`Error::UnknownFormat`], [`Error::Encode`] or [`Error::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        format::write(self, path.as_ref())
    }

    /// Size for messages: full picture, and the window if it is another.
    pub(crate) fn describe_size(&self) -> String {
        let size = format!("{} x {}", self.width, self.height);
        if self.window == Window::full(self.width, self.height) {
            size
        } else {
            format!("{size} (data window {})", self.window)
        }
    }
}
