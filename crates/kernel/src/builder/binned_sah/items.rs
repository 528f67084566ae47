//! Boxes that others divide by the heuristic: items of a top level down to single ones, and parts of primitives.

use alloc::vec::Vec;

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};

use super::planes::{Extent, Planes};
use super::{MAX_SAH_DEPTH, Measure, Part, divide};
use crate::aabb::Aabb;
use crate::builder::cost::Weigh;

/// Depth at which the root of a top level counts. A top level stands above subtrees that are deep themselves, so its items
/// are halved by count from 48 levels on.
pub(crate) const TOP_LEVEL: u32 = MAX_SAH_DEPTH - 48;

/// Boxes in the order in which parts divide them.
pub(crate) struct Items<'a, W> {
    isa: Isa,
    planes: Vec<Planes>,
    weigh: &'a W,
}

impl<'a, W: Weigh> Items<'a, W> {
    /// Items in these boxes, which are finite and not empty.
    pub fn new(boxes: impl Iterator<Item = Aabb>, weigh: &'a W) -> Self {
        let planes = boxes.zip(0u32..);
        Self {
            isa: Isa::best(),
            planes: planes
                .map(|(bounds, item)| Planes::new(&bounds, item))
                .collect(),
            weigh,
        }
    }

    /// All items, for a subtree whose root is at some depth.
    pub fn all(&self, depth: u32) -> Part {
        Part {
            first: 0,
            count: self.planes.len(),
            depth,
            extent: Dispatch::<8>::dispatch(self.isa, Measure(&self.planes)),
        }
    }

    /// Divides a part of two items or more. Both halves have some.
    pub fn halves(&mut self, part: &Part) -> [Part; 2] {
        let items = &mut self.planes[part.first..][..part.count];
        Dispatch::<8>::dispatch(self.isa, Divide(items, part, self.weigh))
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

struct Divide<'a, W>(&'a mut [Planes], &'a Part, &'a W);

impl<W: Weigh> WithSimd<8> for Divide<'_, W> {
    type Output = [Part; 2];
    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) -> [Part; 2] {
        divide(simd, self.0, self.1, self.2)
    }
}
