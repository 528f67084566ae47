//! [`Window`], the rectangle of pixels that an image has.

use std::fmt;

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
    /// Window that covers a whole picture. Sizes beyond `i32::MAX`, which [`Image`](crate::Image) rejects, saturate.
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

    /// The pixels that another window has, too; perhaps none.
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        }
    }

    /// Returns true if the pixel (x, y) lies inside.
    pub fn contains(&self, x: i32, y: i32) -> bool {
        (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y)
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { x0, y0, x1, y1 } = self;
        write!(f, "[{x0}, {x1}) x [{y0}, {y1})")
    }
}

/// Length of `start..end`, which may exceed `i32::MAX`.
pub(crate) fn extent(start: i32, end: i32) -> usize {
    if start < end {
        end.abs_diff(start) as usize
    } else {
        0
    }
}
