//! Items of a top level, which the heuristic divides down to single ones: instances, and subtrees beside them.

use alloc::vec::Vec;

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};

use super::planes::{Extent, Planes};
use super::{MAX_SAH_DEPTH, Measure, Part, divide};
use crate::aabb::Aabb;
use crate::builder::cost::ItemWeights;

/// Items are halved by count from this many levels on. A top level is above subtrees that are deep themselves.
const MAX_SAH_LEVELS: u32 = 48;

/// Boxes of items in the order in which parts divide them.
pub(crate) struct Items<'a> {
    isa: Isa,
    planes: Vec<Planes>,
    weights: &'a ItemWeights,
}

impl<'a> Items<'a> {
    /// Items in these boxes, which are finite and not empty.
    pub fn new(boxes: impl Iterator<Item = Aabb>, weights: &'a ItemWeights) -> Self {
        let planes = boxes.zip(0u32..);
        Self {
            isa: Isa::best(),
            planes: planes
                .map(|(bounds, item)| Planes::new(&bounds, item))
                .collect(),
            weights,
        }
    }

    /// All items.
    pub fn all(&self) -> Part {
        Part {
            first: 0,
            count: self.planes.len(),
            depth: MAX_SAH_DEPTH - MAX_SAH_LEVELS,
            extent: Dispatch::<8>::dispatch(self.isa, Measure(&self.planes)),
        }
    }

    /// Divides a part of two items or more. Both halves have some.
    pub fn halves(&mut self, part: &Part) -> [Part; 2] {
        let items = &mut self.planes[part.first..][..part.count];
        Dispatch::<8>::dispatch(self.isa, Divide(items, part, self.weights))
    }

    /// Every item of a part as a part of its own.
    pub fn singles(&self, part: &Part) -> impl Iterator<Item = Part> {
        let Part {
            first,
            count,
            depth,
            ..
        } = *part;
        (first..first + count).map(move |first| Part {
            first,
            count: 1,
            depth,
            extent: Extent {
                bounds: self.planes[first],
                ..Extent::EMPTY
            },
        })
    }

    /// Indices of the items of a part.
    pub fn indices(&self, part: &Part) -> impl Iterator<Item = usize> {
        let items = &self.planes[part.first..][..part.count];
        items.iter().map(|item| item.index() as usize)
    }

    /// Index of the item of a part; `None` unless there is exactly one.
    pub fn only(&self, part: &Part) -> Option<usize> {
        self.indices(part).next().filter(|_| part.count == 1)
    }
}

impl Part {
    /// How many items there are.
    pub fn len(&self) -> usize {
        self.count
    }

    /// The box around all items.
    pub fn bounds(&self) -> Aabb {
        self.extent.bounds.bounds()
    }

    /// Half the surface area of the box.
    pub fn half_area(&self) -> f32 {
        self.extent.bounds.half_area()
    }
}

struct Divide<'a>(&'a mut [Planes], &'a Part, &'a ItemWeights);

impl WithSimd<8> for Divide<'_> {
    type Output = [Part; 2];
    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) -> [Part; 2] {
        divide(simd, self.0, self.1, self.2)
    }
}
