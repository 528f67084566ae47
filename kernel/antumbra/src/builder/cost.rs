//! Cost of a subtree, estimated before it is built.

use alloc::vec::Vec;
use core::ops::AddAssign;

use crate::aabb::Aabb;
use crate::builder::binned_sah::planes::Planes;
use crate::geometry::BLOCK;
use crate::math;
use crate::tree::costs::CostModel;

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
pub struct Cost {
    table: [f32; TABLE + 1],
}

impl Default for Cost {
    fn default() -> Self {
        let mut table = [0.0; TABLE + 1];
        for (count, weight) in table.iter_mut().enumerate() {
            *weight = Self::weight(count);
        }
        Self { table }
    }
}

impl Cost {
    fn weight(count: usize) -> f32 {
        let whole = count.div_ceil(BLOCK) * BLOCK;
        let blocks = (count.max(BLOCK) + whole.max(BLOCK)) as f32 / (2 * BLOCK) as f32;
        of_blocks(blocks)
    }

    /// The estimate for `count` primitives in a box.
    pub fn of_box(&self, bounds: &Aabb, count: usize) -> f32 {
        bounds.half_area() * self.weight_of(count)
    }

    /// Weight of `count` primitives.
    #[inline(always)]
    pub fn weight_of(&self, count: usize) -> f32 {
        match self.table.get(count) {
            Some(weight) => *weight,
            None => Self::weight(count),
        }
    }
}

/// Weight of this many leaf blocks.
fn of_blocks(blocks: f32) -> f32 {
    math::sqrt_f32(blocks * math::sqrt_f32(blocks))
}

/// What a search for splits adds up on each side, and what the sum weighs.
pub(crate) trait Weigh {
    type Sum: Copy + Default + AddAssign;

    /// Largest number of items in a leaf.
    const LEAF: usize;

    /// What an item adds to the sum of its side.
    fn item(&self, item: &Planes) -> Self::Sum;

    /// Weight of a sum.
    fn weight(&self, sum: Self::Sum) -> f32;

    /// The estimate for items in a box; infinite or NaN when there are none, or when the area is too large.
    #[inline(always)]
    fn of(&self, bounds: &Planes, sum: Self::Sum) -> f32 {
        bounds.half_area() * self.weight(sum)
    }
}

/// Primitives, which are counted.
impl Weigh for Cost {
    type Sum = u32;

    const LEAF: usize = BLOCK;

    #[inline(always)]
    fn item(&self, _: &Planes) -> u32 {
        1
    }

    #[inline(always)]
    fn weight(&self, count: u32) -> f32 {
        self.weight_of(count as usize)
    }
}

/// Items of a top level: instances and subtrees. Each has its own weight in leaf blocks, by its index.
pub(crate) struct ItemWeights(pub Vec<f32>);

impl Weigh for ItemWeights {
    type Sum = f32;

    const LEAF: usize = 1;

    #[inline(always)]
    fn item(&self, item: &Planes) -> f32 {
        self.0[item.index() as usize]
    }

    #[inline(always)]
    fn weight(&self, blocks: f32) -> f32 {
        of_blocks(blocks)
    }
}

/// Weight of an instance in leaf blocks: of entering the object and of its primitives.
pub(crate) fn instance_weight(primitives: usize) -> f32 {
    let model = CostModel::default();
    let below = of_blocks((primitives as f32 / BLOCK as f32).max(1.0));
    // The inverse of `of_blocks`, which gives the sum for an instance by itself.
    math::powf(model.entry + model.node + below, 4.0 / 3.0)
}
