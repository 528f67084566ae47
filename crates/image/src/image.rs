//! [`Image`], linear RGB in 32-bit floats, and its data [`Window`].

use std::fmt;
use std::path::Path;

use crate::{Allowance, Display, Error, Rgb8Image, format};

/// Rectangle of pixels: `x0 <= x < x1`, `y0 <= y < y1`.
///
/// (0, 0) is the top left pixel of the full picture, and y points down. Bounds are signed, because files may hold
/// pixels outside the picture (overscan).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Window {
    /// First column.
    pub x0: i32,
    /// First row.
    pub y0: i32,
    /// End of the columns, one past the last.
    pub x1: i32,
    /// End of the rows, one past the last.
    pub y1: i32,
}

impl Window {
    /// Window that covers a whole picture. Sizes beyond `i32::MAX`, which [`Image`] rejects, saturate.
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

    /// Returns true if the window contains no pixel.
    pub fn is_empty(&self) -> bool {
        self.area() == 0
    }

    /// Returns true if the pixel (x, y) lies inside.
    pub fn contains(&self, x: i32, y: i32) -> bool {
        (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y)
    }
}

/// Whether files of this name hold linear values.
fn is_linear(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    !["png", "jpg", "jpeg"]
        .iter()
        .any(|name| extension.eq_ignore_ascii_case(name))
}

/// Length of `start..end`, which may exceed `i32::MAX`.
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

/// Picture in linear RGB.
///
/// `width` and `height` are the size of the full picture in pixels. Pixels cover the data
/// [`window`](Self::window), which is the whole picture unless it was cropped. Pixels are stored row by row, top row
/// first. An image has at least one pixel. Values may be NaN or infinite.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    width: usize,
    height: usize,
    window: Window,
    pixels: Vec<[f32; 3]>,
}

impl Image {
    /// Makes an image of `window.area()` pixels, row by row, top row first.
    ///
    /// The window may reach beyond the full picture or lie outside it.
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

    /// Makes an image from `pixel(x, y)`, which is called row by row, top row first.
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

    /// Data window: the part of the picture that the pixels cover.
    pub fn window(&self) -> Window {
        self.window
    }

    /// Pixels of the window, row by row, top row first.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// Pixels of the window for changes in place, row by row, top row first.
    pub fn pixels_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.pixels
    }

    /// Pixels of the window by value, row by row, top row first.
    pub fn into_pixels(self) -> Vec<[f32; 3]> {
        self.pixels
    }

    /// Pixel at (x, y) of the full picture; `None` outside the window.
    pub fn get(&self, x: i32, y: i32) -> Option<[f32; 3]> {
        self.window.contains(x, y).then(|| {
            let (column, row) = (extent(self.window.x0, x), extent(self.window.y0, y));
            self.pixels[row * self.window.width() + column]
        })
    }

    /// Mean of each channel over the window.
    ///
    /// Values are added in `f64` and in storage order, so that equal pixels give equal bits. A NaN or infinity makes
    /// the mean of its channel NaN or infinite.
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

    /// Pixels of the window for a display, each channel converted by [`srgb8`](crate::srgb8).
    pub fn to_srgb8(&self) -> Rgb8Image {
        let pixels = self.pixels.iter().map(|pixel| pixel.map(crate::srgb8));
        Rgb8Image::covering(self.window.width(), self.window.height(), pixels.collect())
    }

    /// Reads an image file. The extension of its name chooses the format, in upper or lower case.
    ///
    /// # Errors
    /// [`Error::UnknownFormat`], [`Error::Unsupported`] for a format that cannot be read as an `Image`,
    /// [`Error::Read`] or [`Error::Decode`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::read_within(path, &Allowance::unlimited())
    }

    /// Reads an image file as [`Image::read`], within the memory that is allowed.
    ///
    /// File, pixels and what a decoder needs beside them are taken from the allowance before they are allocated. The
    /// pixels stay taken.
    ///
    /// # Errors
    /// As [`Image::read`]. [`Error::Decode`] if the memory does not suffice.
    pub fn read_within(path: impl AsRef<Path>, allowance: &Allowance) -> Result<Self, Error> {
        format::read(path.as_ref(), allowance)
    }

    /// Reads an image from the bytes of a file. The extension of `path` chooses the format; errors name the path.
    ///
    /// # Errors
    /// As [`Image::read`], except [`Error::Read`].
    pub fn parse(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, Error> {
        format::parse(bytes, path.as_ref())
    }

    /// Writes an image file. The extension of its name chooses the format, in upper or lower case.
    ///
    /// Equal images give equal bytes. The file is replaced as a whole or not at all, as by
    /// [`atomic_write`](crate::atomic_write).
    ///
    /// # Errors
    /// [`Error::UnknownFormat`], [`Error::Encode`] or [`Error::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        format::write(self, path.as_ref())
    }

    /// Writes an image as [`Image::write`] does, with these values for displays. An EXR file keeps its linear values.
    ///
    /// # Errors
    /// As [`Image::write`].
    pub fn write_for(&self, path: impl AsRef<Path>, display: &Display) -> Result<(), Error> {
        if display.is_plain() || is_linear(path.as_ref()) {
            return self.write(path);
        }
        self.shown(display).write(path)
    }

    /// Writes a PNG file of 16-bit sRGB values.
    ///
    /// # Errors
    /// As [`Image::write`]. [`Error::Unsupported`] for other formats.
    pub fn write_png16(&self, path: impl AsRef<Path>, display: &Display) -> Result<(), Error> {
        format::write_png16(&self.shown(display), path.as_ref())
    }

    /// The picture under an exposure and a tone curve, in linear values of a display.
    pub fn shown(&self, display: &Display) -> Self {
        let pixels = self.pixels.iter().map(|&pixel| display.apply(pixel));
        Self {
            pixels: pixels.collect(),
            ..*self
        }
    }

    /// Size for messages: the full picture, and the window if it differs.
    pub(crate) fn describe_size(&self) -> String {
        let size = format!("{} x {}", self.width, self.height);
        if self.window == Window::full(self.width, self.height) {
            size
        } else {
            format!("{size} (data window {})", self.window)
        }
    }
}
