//! Axis-aligned boxes.

/// An axis-aligned box, closed on all sides. `min > max` on any axis means empty.
///
/// Coordinates are not checked. Where one is NaN, comparisons with it count as false.
///
/// ```
/// use antumbra::Aabb;
///
/// let house = Aabb::around(&[[0.0, 0.0, 0.0], [4.0, 2.0, 3.0]]);
/// assert_eq!(house.half_area(), 4.0 * 2.0 + 2.0 * 3.0 + 3.0 * 4.0);
/// assert_eq!(house.union(&Aabb::EMPTY), house);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: [f32; 3],
    /// Largest coordinates.
    pub max: [f32; 3],
}

impl Aabb {
    /// The box that holds nothing and is neutral under [`Aabb::union`].
    pub const EMPTY: Self = Self {
        min: [f32::INFINITY; 3],
        max: [f32::NEG_INFINITY; 3],
    };

    /// The box between two corners, of which `min` has the smaller coordinates.
    #[must_use]
    pub fn new(min: impl Into<[f32; 3]>, max: impl Into<[f32; 3]>) -> Self {
        Self {
            min: min.into(),
            max: max.into(),
        }
    }

    /// The smallest box around the points; empty for none. NaN coordinates are ignored.
    #[inline]
    #[must_use]
    pub fn around(points: &[[f32; 3]]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, point| {
            bounds.union(&Self {
                min: *point,
                max: *point,
            })
        })
    }

    /// The smallest box that holds both. NaN coordinates are ignored if the other box has a number there.
    #[inline]
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: core::array::from_fn(|axis| self.min[axis].min(other.min[axis])),
            max: core::array::from_fn(|axis| self.max[axis].max(other.max[axis])),
        }
    }

    /// Whether the box holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|axis| self.min[axis] > self.max[axis])
    }

    /// Whether `other` lies inside, borders included. The empty box lies inside every box.
    #[must_use]
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty()
            || (0..3)
                .all(|axis| self.min[axis] <= other.min[axis] && other.max[axis] <= self.max[axis])
    }

    /// Half the surface area; 0 for the empty box, infinite when it overflows or a coordinate is NaN.
    #[inline]
    #[must_use]
    pub fn half_area(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        let [x, y, z]: [f32; 3] = core::array::from_fn(|axis| self.max[axis] - self.min[axis]);
        let half_area = x * y + y * z + z * x;
        // ∞ * 0, of a flat box that is too large to measure.
        if half_area.is_nan() {
            f32::INFINITY
        } else {
            half_area
        }
    }

    /// Scene extent, if the box is around a scene: the largest absolute coordinate; 0 for the empty box.
    pub fn reach(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        self.min
            .iter()
            .chain(&self.max)
            .fold(0.0, |extent: f32, x| extent.max(x.abs()))
    }
}
