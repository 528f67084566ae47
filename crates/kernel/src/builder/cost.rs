//! Cost of a subtree, estimated before it is built.

use crate::aabb::Aabb;
use crate::builder::binned_sah::planes::Planes;
use crate::geometry::BLOCK;
use crate::math;

/// Counts up to this are looked up, because roots are slow.
const TABLE: usize = 256;

/// The surface area heuristic: area times a weight that grows with the count.
///
/// The textbook weight is the count itself (MacDonald and Booth 1990), as if all that is in a node were
/// tested whenever its box is hit. But below that node are more boxes to stop a ray, and in a wide tree
/// they come almost for free. So here the weight is the number of leaf blocks to the power of 3/4. One block weighs
/// as much as a full one. Beyond that the count of blocks is half way between the fraction and the whole number.
/// `docs/notes/kernel.md` compares these choices.
#[derive(Clone)]
pub(crate) struct Cost {
    table: [f32; TABLE + 1],
}

impl Cost {
    pub fn new() -> Self {
        let mut table = [0.0; TABLE + 1];
        for (count, weight) in table.iter_mut().enumerate() {
            *weight = Self::weight(count);
        }
        Self { table }
    }

    fn weight(count: usize) -> f32 {
        let whole = count.div_ceil(BLOCK) * BLOCK;
        let blocks = (count.max(BLOCK) + whole.max(BLOCK)) as f32 / (2 * BLOCK) as f32;
        math::sqrt_f32(blocks * math::sqrt_f32(blocks))
    }

    /// The estimate for so many primitives in a box; infinite or NaN when there are none, or when the
    /// area is too large.
    #[inline(always)]
    pub fn of(&self, bounds: &Planes, count: usize) -> f32 {
        bounds.half_area() * self.weight_of(count)
    }

    /// The estimate for a box of another form.
    pub fn of_box(&self, bounds: &Aabb, count: usize) -> f32 {
        bounds.half_area() * self.weight_of(count)
    }

    /// Weight of so many primitives.
    #[inline(always)]
    pub fn weight_of(&self, count: usize) -> f32 {
        match self.table.get(count) {
            Some(weight) => *weight,
            None => Self::weight(count),
        }
    }
}
