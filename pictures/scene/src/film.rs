//! The film: size, crop and reconstruction filter of the picture.

use serde::{Deserialize, Serialize};

/// Size and crop window of the picture, and how samples become pixels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Film {
    /// Width and height of the full picture in pixels, both at least 1.
    pub resolution: [u32; 2],
    /// Crop window `[x_min, x_max, y_min, y_max]` in fractions of the full picture, within 0..=1.
    pub crop_window: [f32; 4],
    /// Reconstruction filter, which weighs samples by their distance from the centre of a pixel.
    pub filter: Filter,
    /// Factor of every pixel value, applied at the end.
    pub scale: f32,
    /// Largest luminance of a sample; brighter samples are scaled down to it. Infinite by default.
    pub max_sample_luminance: f32,
    /// File name that the scene names; `None` leaves it to the program.
    pub file_name: Option<String>,
}

impl Default for Film {
    fn default() -> Self {
        Self {
            resolution: [1280, 720],
            crop_window: [0.0, 1.0, 0.0, 1.0],
            filter: Filter::default(),
            scale: 1.0,
            max_sample_luminance: f32::INFINITY,
            file_name: None,
        }
    }
}

impl Film {
    /// Largest number of pixels of a picture. Larger pictures would take several GiB by themselves.
    pub const MAX_PIXELS: u64 = 1 << 28;

    /// Pixels inside the crop window, `[x0, x1, y0, y1]` with `x1` and `y1` exclusive.
    ///
    /// Each bound is the ceiling of resolution times fraction, as in pbrt, clamped to the picture.
    pub fn pixel_bounds(&self) -> [u32; 4] {
        let bound =
            |fraction: f32, size: u32| ((size as f32 * fraction).ceil().max(0.0) as u32).min(size);
        let [x0, x1, y0, y1] = self.crop_window;
        let [width, height] = self.resolution;
        [
            bound(x0, width),
            bound(x1, width),
            bound(y0, height),
            bound(y1, height),
        ]
    }

    /// Returns true if no pixel is inside the crop window.
    pub fn is_empty(&self) -> bool {
        let [x0, x1, y0, y1] = self.pixel_bounds();
        x0 >= x1 || y0 >= y1
    }
}

/// Reconstruction filter: the product of one function of x and one of y. Radii are half-widths in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Filter {
    /// Constant weight.
    Box {
        /// Half-widths in x and y.
        radius: [f32; 2],
    },
    /// Weight that falls linearly to 0 at the radius.
    Triangle {
        /// Half-widths in x and y.
        radius: [f32; 2],
    },
    /// Weight `exp(-alpha x²) - exp(-alpha r²)`.
    Gaussian {
        /// Half-widths in x and y.
        radius: [f32; 2],
        /// Rate of falloff.
        alpha: f32,
    },
    /// Cubic filter of Mitchell and Netravali (1988).
    Mitchell {
        /// Half-widths in x and y.
        radius: [f32; 2],
        /// Parameter B of the paper.
        b: f32,
        /// Parameter C of the paper.
        c: f32,
    },
    /// Sinc with a Lanczos window.
    LanczosSinc {
        /// Half-widths in x and y.
        radius: [f32; 2],
        /// Cycles of the sinc before it is windowed to 0.
        tau: f32,
    },
}

impl Filter {
    /// Largest half-width of a filter in pixels. The cost of a sample grows with the square of the half-width.
    pub const MAX_RADIUS: f32 = 64.0;
}

impl Default for Filter {
    fn default() -> Self {
        Self::Box { radius: [0.5, 0.5] }
    }
}
