//! The film: size, crop and reconstruction filter of the picture.

use serde::{Deserialize, Serialize};

/// Size and crop of the picture, and how samples become pixels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Film {
    /// Width and height of the full picture in pixels, both at least 1.
    pub resolution: [u32; 2],
    /// `[x_min, x_max, y_min, y_max]` in fractions of the full picture, within 0..=1.
    pub crop_window: [f32; 4],
    /// Reconstruction filter.
    pub filter: Filter,
    /// Every pixel value is multiplied by this at the end.
    pub scale: f32,
    /// Samples whose luminance is above this are scaled down to it; infinite by default.
    pub max_sample_luminance: f32,
    /// Name of the picture as the scene asks for it, if it does.
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
    /// Pixels a picture may have; with more, the picture alone would take several GiB.
    pub const MAX_PIXELS: u64 = 1 << 28;

    /// The pixels inside the crop window: half-open `[x0, x1, y0, y1]`, each bound the ceiling of
    /// resolution times fraction, as pbrt has it.
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

    /// Whether no pixel is inside the crop window.
    pub fn is_empty(&self) -> bool {
        let [x0, x1, y0, y1] = self.pixel_bounds();
        x0 >= x1 || y0 >= y1
    }
}

/// A separable or product reconstruction filter; radii are half-widths in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Filter {
    /// Constant weight.
    Box {
        /// Half-widths in x and y.
        radius: [f32; 2],
    },
    /// Weight falls linearly to 0 at the radius, separably.
    Triangle {
        /// Half-widths in x and y.
        radius: [f32; 2],
    },
    /// `exp(-alpha x²) - exp(-alpha r²)`, separably.
    Gaussian {
        /// Half-widths in x and y.
        radius: [f32; 2],
        /// Rate of falloff.
        alpha: f32,
    },
    /// Mitchell and Netravali (1988), separably.
    Mitchell {
        /// Half-widths in x and y.
        radius: [f32; 2],
        /// Their parameter B.
        b: f32,
        /// Their parameter C.
        c: f32,
    },
    /// Lanczos windowed sinc, separably.
    LanczosSinc {
        /// Half-widths in x and y.
        radius: [f32; 2],
        /// Cycles of the sinc before it is windowed to 0.
        tau: f32,
    },
}

impl Filter {
    /// The largest half-width of a filter, in pixels: every sample is spread over its square.
    pub const MAX_RADIUS: f32 = 64.0;
}

impl Default for Filter {
    fn default() -> Self {
        Self::Box { radius: [0.5, 0.5] }
    }
}
