//! Rules by which samples enter pixels.

use antumbra_image::Window;
use antumbra_scene::Filter;
use serde::{Deserialize, Serialize};

use super::filter;

/// Serialized form of a [`Window`].
#[derive(Serialize, Deserialize)]
#[serde(remote = "Window")]
pub(super) struct StoredWindow {
    x0: i32,
    y0: i32,
    x1: i32,
    y1: i32,
}

/// Rules by which samples enter pixels.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Rules {
    /// Pixels to render.
    #[serde(with = "StoredWindow")]
    pub window: Window,
    pub(super) filter: Filter,
    pub(super) radius: [f32; 2],
    pub(super) scale: f32,
    pub(super) max_luminance: f32,
    /// Whether the sums of the standard error are kept.
    pub(super) squares: bool,
}

impl Rules {
    /// Rules of a scene's film. `squares` keeps the sums that the standard error needs.
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

    /// Pixels to sample: the window and, with a wide filter, pixels around it, even outside the picture.
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

    /// Pixels of the picture that the samples of a tile reach.
    pub(super) fn reached(&self, tile: Window) -> Window {
        let [rx, ry] = self.radius.map(reach);
        let inside = self.window;
        Window {
            x0: (tile.x0 - rx).max(inside.x0),
            y0: (tile.y0 - ry).max(inside.y0),
            x1: (tile.x1 + rx).min(inside.x1),
            y1: (tile.y1 + ry).min(inside.y1),
        }
    }

    /// Whether every sample weighs 1 and belongs only to its own pixel.
    pub(super) fn weigh_one(&self) -> bool {
        matches!(self.filter, Filter::Box { radius } if radius == [0.5; 2])
    }

    /// Whether two rules are equal bit for bit.
    pub fn equals(&self, other: &Self) -> bool {
        let numbers = |rules: &Self| [rules.scale, rules.max_luminance].map(f32::to_bits);
        (self.window, self.squares) == (other.window, other.squares)
            && self.filter == other.filter
            && numbers(self) == numbers(other)
    }

    /// Whether a picture can be made by these rules. Rules of a damaged file may be invalid.
    pub fn are_valid(&self) -> bool {
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

/// Number of pixels beyond its own that a sample may reach.
fn reach(radius: f32) -> i32 {
    (radius - 0.5).ceil().max(0.0) as i32
}
