//! [`Image`], linear RGB in 32-bit floats.

use crate::window::extent;
use crate::{Display, Error, Rgb8Image, Window};

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

    /// The part of the image in a window, as an image of the same size. `None` if the window is empty or has pixels that the
    /// image lacks.
    pub fn cropped(&self, window: Window) -> Option<Self> {
        if self.window.intersection(&window) != window {
            return None;
        }
        let rows = (window.y0..window.y1).flat_map(|y| (window.x0..window.x1).map(move |x| (x, y)));
        let pixels = rows
            .map(|(x, y)| self.get(x, y))
            .collect::<Option<Vec<_>>>()?;
        Self::new(self.width, self.height, window, pixels).ok()
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
