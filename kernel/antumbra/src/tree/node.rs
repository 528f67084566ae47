//! The N-wide node: child boxes as planes, child references, and the rule of slots.
//!
//! A node has `N` *slots*, numbered in the order in which an occlusion query visits them: the occupied
//! ones come first. Slot `s` lives in *lane* `N - 1 - s`. A query compresses the references of the lanes
//! it hit onto its stack in ascending lane order and pops from the top, so the lowest hit slot comes out
//! first without any sorting.
//!
//! # To add a kind of leaf
//! | concern | where |
//! |---|---|
//! | bounds, exact test, nearest point, area, numbers in a file | a file of its own in `geometry/` |
//! | its row among all kinds, with the range of child references | `geometry/primitives/kinds.rs` |
//! | what users give | `Geometry` in `geometry/mod.rs`, `lib.rs` |
//! | a reason to drop one, if it is a new one | `geometry/primitives/dropped.rs` |
//! | version and table of files, if files can hold one | `tree/words.rs`, `docs/src/file-format.md` |
//!
//! Lists of primitives and blocks, references, saved files, refits and all queries follow from the row. Blocks of triangles
//! are a faster path in `trace/step.rs`, `trace/packet/`, `trace/binary.rs` and `trace/leaf_places.rs`.
//!
//! Builders need no change: primitives of different kinds never share a leaf, and boxes are all that matters to them.
//! Logs, orders and collapses see only the numbers, counts and costs of leaves.

use crate::aabb::Aabb;
use crate::geometry::primitives::kinds::for_each_scalar_kind;
use crate::geometry::primitives::{MAX_INSTANCES, PrimKind};

/// Slots of the widest nodes.
pub const MAX_WIDTH: usize = 16;

/// Something for each slot of a node. Those beyond its width are of no meaning.
pub type PerSlot<T> = [T; MAX_WIDTH];

/// Every slot in its place.
pub(crate) const AS_THEY_ARE: PerSlot<u8> = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// Two values of the range of instances mean [`Child::EXIT`] and [`Child::DONE`].
const _: () = assert!(Child::INSTANCE as usize + MAX_INSTANCES == Child::EXIT.0 as usize);

/// A reference to a child, packed into 32 bits.
///
/// Kinds are distinguished by ranges of values, so that one comparison sorts many references at once. The upper four
/// bits name the range, the lower bits count within it.
///
/// | first value | meaning | capacity |
/// |---|---|---|
/// | `0x0000_0000` | inner node | 2³⁰ |
/// | `0x4000_0000` | leaf of triangles | 2²⁹ |
/// | `0x6000_0000` to `0xb000_0000` | leaf of another kind, see [`crate::geometry::primitives::kinds`]; the last ones are free, also for nodes, such as boxes that move | 2²⁸ each |
/// | `0xc000_0000` | leaf of partly transparent triangles | 2²⁹ |
/// | `0xe000_0000` | instance | 2²⁹ - 2 |
///
/// Kinds below [`Child::FIRST_CUTOUTS`] are tested in the ordinary leaf phase of a ray stream. Hits of those from
/// there to [`Child::FIRST_INSTANCE`] are settled by a filter.
///
/// An empty slot refers to triangle block 0, which is empty in every tree, so that following one is
/// harmless.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Child(pub u32);

/// What is in a slot of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChildKind {
    /// Index of a node.
    Inner(usize),
    /// A leaf.
    Leaf(Leaf),
    /// Index of an instance; below it is the tree of its object.
    Instance(usize),
}

/// A leaf: the kind of all its primitives, and the index of its block among the blocks of the kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leaf {
    pub(crate) kind: PrimKind,
    pub(crate) index: usize,
}

/// The leaf of the kind in whose range a reference is. Those in free ranges occur in no tree.
macro_rules! match_ranges {
    ($child:ident $(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {{
        $(
            if $child.0 >> 28 == $first >> 28 {
                return $child.leaf_of(PrimKind::$Kind);
            }
        )*
        $child.leaf_of(PrimKind::Triangle)
    }};
}

impl Child {
    const TRIANGLES: u32 = PrimKind::Triangle.first_child();
    const CUTOUTS: u32 = PrimKind::Cutout.first_child();
    const INSTANCE: u32 = 0xe000_0000;
    /// The first reference to a leaf of another kind. Ranges of 2²⁸ values follow each other.
    const SCALARS: u32 = 0x6000_0000;
    /// Bits of the index in a range of 2²⁹ values.
    const WIDE_INDEX: u32 = (1 << 29) - 1;

    /// Nodes that a tree can have.
    pub const MAX_NODES: usize = Self::TRIANGLES as usize;

    pub const EMPTY: Self = Self(Self::TRIANGLES);
    /// The smallest reference to anything but a node.
    pub const FIRST_OUTER: Self = Self(Self::TRIANGLES);
    /// The smallest reference to a leaf of partly transparent triangles.
    pub const FIRST_CUTOUTS: Self = Self(Self::CUTOUTS);
    /// The smallest reference to an instance.
    pub const FIRST_INSTANCE: Self = Self(Self::INSTANCE);
    /// Nothing is left to visit: what lies at the bottom of a stack. No instance has this index.
    pub const DONE: Self = Self(u32::MAX);
    /// Nothing is left to visit in the instance: what lies below its object's nodes on a stack. No instance has
    /// this index.
    pub const EXIT: Self = Self(u32::MAX - 1);
    pub const ROOT: Self = Self(0);

    /// Leaf blocks of this kind that a tree can have.
    pub const fn capacity(kind: PrimKind) -> usize {
        match kind {
            PrimKind::Triangle | PrimKind::Cutout => 1 << 29,
            _ => 1 << 28,
        }
    }

    pub fn inner(index: usize) -> Self {
        Self(index as u32)
    }

    pub fn leaf(Leaf { kind, index }: Leaf) -> Self {
        Self(index as u32 | kind.first_child())
    }

    pub fn instance(index: usize) -> Self {
        Self(index as u32 | Self::INSTANCE)
    }

    /// Index of a leaf of triangles or cut-outs, or of an instance: of what has a range of 2²⁹ values. Of anything else a
    /// number without meaning.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & Self::WIDE_INDEX) as usize
    }

    /// How a leaf is prefetched: 0 as a leaf of triangles, 2 as one of cut-outs, 1 as any other leaf, 3 as an instance.
    /// Without meaning for inner nodes.
    #[inline(always)]
    pub fn leaf_kind(self) -> usize {
        /// Two bits for every value of the upper three bits of a reference.
        const KINDS: u32 = 0b11_10_01_01_01_00_00_00;
        (KINDS >> (self.0 >> 29 << 1) & 0b11) as usize
    }

    /// Comparisons in the order of how often they decide, where a `match` on the ranges would search them: 1 % of the
    /// instructions of closest hits (AVX2).
    #[inline(always)]
    pub fn kind(self) -> ChildKind {
        if self.0 < Self::TRIANGLES {
            ChildKind::Inner(self.0 as usize)
        } else if self.0 < Self::SCALARS {
            self.leaf_of(PrimKind::Triangle)
        } else if self.0 >= Self::INSTANCE {
            ChildKind::Instance(self.index())
        } else if self.0 >= Self::CUTOUTS {
            self.leaf_of(PrimKind::Cutout)
        } else {
            for_each_scalar_kind!([match_ranges] self)
        }
    }

    #[inline(always)]
    fn leaf_of(self, kind: PrimKind) -> ChildKind {
        let index = (self.0 - kind.first_child()) as usize;
        ChildKind::Leaf(Leaf { kind, index })
    }
}

/// A node of `N` children. Children always have larger indices than their parents.
///
/// Bytes: `24 N` of planes, then `4 N` of references, padded to 64.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node<const N: usize> {
    /// `[axis][side][lane]`: side 0 holds the smallest coordinates of the child boxes, 1 the largest.
    /// Empty lanes are inside out, +∞ to -∞.
    pub planes: [[[f32; N]; 2]; 3],
    /// [`Child`] per lane.
    pub children: [u32; N],
}

impl<const N: usize> Node<N> {
    pub const EMPTY: Self = Self {
        planes: [[[f32::INFINITY; N], [f32::NEG_INFINITY; N]]; 3],
        children: [Child::EMPTY.0; N],
    };

    /// The node whatever its width.
    pub fn any(&self) -> NodeRef<'_> {
        NodeRef {
            planes: self.planes.as_flattened().as_flattened(),
            children: &self.children,
        }
    }

    /// The node whatever its width, to be written.
    pub fn any_mut(&mut self) -> NodeMut<'_> {
        NodeMut {
            planes: self.planes.as_flattened_mut().as_flattened_mut(),
            children: &mut self.children,
        }
    }
}

/// A node of any width, for code that is compiled once: whatever makes, changes or checks trees. Queries take nodes of one width.
#[derive(Clone, Copy)]
pub struct NodeRef<'a> {
    /// `[axis][side][lane]`, as in a [`Node`].
    planes: &'a [f32],
    /// [`Child`] per lane.
    children: &'a [u32],
}

impl NodeRef<'_> {
    /// How many slots there are.
    pub fn width(&self) -> usize {
        self.children.len()
    }

    /// How many slots are occupied; they come first.
    #[allow(
        clippy::len_without_is_empty,
        reason = "only the root of an empty tree is empty"
    )]
    pub fn len(&self) -> usize {
        let occupied = |child: &&u32| **child != Child::EMPTY.0;
        self.children.iter().rev().take_while(occupied).count()
    }

    /// The lane that holds a slot.
    pub(crate) fn lane(&self, slot: usize) -> usize {
        self.width() - 1 - slot
    }

    pub(crate) fn child(&self, slot: usize) -> Child {
        Child(self.children[self.lane(slot)])
    }

    /// The box of a slot; inside out where the slot is empty.
    pub fn bounds(&self, slot: usize) -> Aabb {
        let width = self.width();
        let plane =
            |axis: usize, side: usize| self.planes[(2 * axis + side + 1) * width - 1 - slot];
        Aabb {
            min: core::array::from_fn(|axis| plane(axis, 0)),
            max: core::array::from_fn(|axis| plane(axis, 1)),
        }
    }

    /// What is in an occupied slot.
    pub fn kind(&self, slot: usize) -> ChildKind {
        self.child(slot).kind()
    }

    /// The occupied slots with their boxes.
    pub(crate) fn children(self) -> impl Iterator<Item = (Child, Aabb)> {
        (0..self.len()).map(move |slot| (self.child(slot), self.bounds(slot)))
    }

    /// The box around all children.
    pub fn all_bounds(&self) -> Aabb {
        (0..self.len()).fold(Aabb::EMPTY, |all, slot| all.union(&self.bounds(slot)))
    }

    /// Half the surface areas of the boxes of all slots, occupied or not.
    pub fn areas(&self) -> PerSlot<f32> {
        let mut areas = [0.0; MAX_WIDTH];
        for (slot, area) in areas.iter_mut().enumerate().take(self.width()) {
            *area = self.bounds(slot).half_area();
        }
        areas
    }
}

/// A [`NodeRef`] to be written.
pub(crate) struct NodeMut<'a> {
    planes: &'a mut [f32],
    children: &'a mut [u32],
}

impl NodeMut<'_> {
    pub fn set(&mut self, slot: usize, child: Child, bounds: &Aabb) {
        let width = self.children.len();
        let lane = width - 1 - slot;
        for axis in 0..3 {
            self.planes[2 * axis * width + lane] = bounds.min[axis];
            self.planes[(2 * axis + 1) * width + lane] = bounds.max[axis];
        }
        self.children[lane] = child.0;
    }

    /// Makes it the same as another node of its width.
    pub fn copy(&mut self, other: NodeRef<'_>) {
        self.planes.copy_from_slice(other.planes);
        self.children.copy_from_slice(other.children);
    }

    /// Puts the child of slot `slots[i]` into slot `i`.
    pub fn permute(&mut self, slots: &[u8]) {
        let mut moved = [(Child::EMPTY, Aabb::EMPTY); MAX_WIDTH];
        for (moved, &from) in moved.iter_mut().zip(slots) {
            *moved = (
                self.any().child(from.into()),
                self.any().bounds(from.into()),
            );
        }
        for (slot, (child, bounds)) in moved.iter().enumerate().take(slots.len()) {
            self.set(slot, *child, bounds);
        }
    }

    /// Replaces what the occupied slots refer to.
    pub fn relocate(&mut self, relocated: impl Fn(Child) -> Child) {
        for child in self.children.iter_mut() {
            if *child != Child::EMPTY.0 {
                *child = relocated(Child(*child)).0;
            }
        }
    }

    pub fn any(&self) -> NodeRef<'_> {
        NodeRef {
            planes: self.planes,
            children: self.children,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_come_back_as_they_were_made() {
        for &kind in PrimKind::ALL {
            for index in [0, 1, 12_345, Child::capacity(kind) - 1] {
                let leaf = Leaf { kind, index };
                let child = Child::leaf(leaf);
                assert_eq!(child.kind(), ChildKind::Leaf(leaf));
                assert!(child.0 >= Child::FIRST_OUTER.0 && child.0 < Child::FIRST_INSTANCE.0);
                let is_cutout = child.0 >= Child::FIRST_CUTOUTS.0;
                assert_eq!(is_cutout, kind == PrimKind::Cutout);
                let expected = match kind {
                    PrimKind::Triangle => 0,
                    PrimKind::Cutout => 2,
                    _ => 1,
                };
                assert_eq!(child.leaf_kind(), expected);
            }
        }
        for index in [0, 7, Child::MAX_NODES - 1] {
            assert_eq!(Child::inner(index).kind(), ChildKind::Inner(index));
        }
        for index in [0, 7, MAX_INSTANCES - 1] {
            let child = Child::instance(index);
            assert_eq!(child.kind(), ChildKind::Instance(index));
            assert!(child.0 >= Child::FIRST_INSTANCE.0 && child.0 < Child::EXIT.0);
            assert_eq!(child.leaf_kind(), 3);
        }
        let (kind, index) = (PrimKind::Triangle, 0);
        assert_eq!(Child::leaf(Leaf { kind, index }), Child::EMPTY);
    }
}
