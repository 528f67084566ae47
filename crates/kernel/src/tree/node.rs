//! The N-wide node: child boxes as planes, child references, and the rule of slots.
//!
//! A node has `N` *slots*, numbered in the order in which an occlusion query visits them: the occupied
//! ones come first. Slot `s` lives in *lane* `N - 1 - s`. A query compresses the references of the lanes
//! it hit onto its stack in ascending lane order and pops from the top, so the lowest hit slot comes out
//! first without any sorting.

use crate::aabb::Aabb;

/// A reference to a child, packed into 32 bits.
///
/// | bits 31 to 29 | meaning | bits 28..0 |
/// |---|---|---|
/// | 0 x x | inner node | index into the nodes, bits 30..0 |
/// | 1 0 0 | leaf of triangles | index into the triangle blocks |
/// | 1 0 1 | leaf of spheres | index into the sphere blocks |
/// | 1 1 0 | leaf of partly transparent triangles | index into the cut-out blocks |
/// | 1 1 1 | instance | index into the instances |
///
/// An empty slot refers to triangle block 0, which is empty in every tree, so that following one is
/// harmless.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Child(pub u32);

/// What an occupied slot refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChildKind {
    /// Index of a node.
    Inner(usize),
    Leaf(Leaf),
    /// Index of an instance; below it is the tree of its object.
    Instance(usize),
}

/// Which block a leaf is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Leaf {
    /// Index of a triangle block.
    Triangles(usize),
    /// Index of a sphere block.
    Spheres(usize),
    /// Index of a cut-out block.
    Cutouts(usize),
}

impl Child {
    const OUTER: u32 = 1 << 31;
    const KIND: u32 = 0b111 << 29;
    const TRIANGLES: u32 = 0b100 << 29;
    const SPHERES: u32 = 0b101 << 29;
    const CUTOUTS: u32 = 0b110 << 29;
    const INSTANCE: u32 = 0b111 << 29;
    const INDEX: u32 = !Self::KIND;

    pub const EMPTY: Self = Self(Self::TRIANGLES);
    /// The smallest reference to anything but a node, to a leaf of partly transparent triangles, and to an instance.
    pub const FIRST_OUTER: Self = Self(Self::OUTER);
    pub const FIRST_CUTOUTS: Self = Self(Self::CUTOUTS);
    pub const FIRST_INSTANCE: Self = Self(Self::INSTANCE);
    /// Nothing is left to visit: what lies at the bottom of a stack. No instance has this index.
    pub const DONE: Self = Self(u32::MAX);
    /// Nothing is left to visit in the instance: what lies below its object's nodes on a stack. No instance has
    /// this index.
    pub const EXIT: Self = Self(u32::MAX - 1);
    pub const ROOT: Self = Self(0);

    pub fn inner(index: usize) -> Self {
        Self(index as u32)
    }

    pub fn leaf(leaf: Leaf) -> Self {
        match leaf {
            Leaf::Triangles(index) => Self(index as u32 | Self::TRIANGLES),
            Leaf::Spheres(index) => Self(index as u32 | Self::SPHERES),
            Leaf::Cutouts(index) => Self(index as u32 | Self::CUTOUTS),
        }
    }

    pub fn instance(index: usize) -> Self {
        Self(index as u32 | Self::INSTANCE)
    }

    /// The index, of whatever this is but an inner node.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & Self::INDEX) as usize
    }

    /// Which kind of leaf this is: bits 30 and 29 of what is not an inner node.
    #[inline(always)]
    pub fn leaf_kind(self) -> usize {
        (self.0 >> 29 & 0b11) as usize
    }

    #[inline(always)]
    pub fn kind(self) -> ChildKind {
        let index = self.index();
        if self.0 & Self::OUTER == 0 {
            return ChildKind::Inner(self.0 as usize);
        }
        match self.0 & Self::KIND {
            Self::TRIANGLES => ChildKind::Leaf(Leaf::Triangles(index)),
            Self::SPHERES => ChildKind::Leaf(Leaf::Spheres(index)),
            Self::CUTOUTS => ChildKind::Leaf(Leaf::Cutouts(index)),
            _ => ChildKind::Instance(index),
        }
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

    /// The lane that holds a slot, and the slot that a lane holds.
    #[inline(always)]
    pub const fn lane(slot: usize) -> usize {
        N - 1 - slot
    }

    pub fn set(&mut self, slot: usize, child: Child, bounds: &Aabb) {
        let lane = Self::lane(slot);
        for axis in 0..3 {
            self.planes[axis][0][lane] = bounds.min[axis];
            self.planes[axis][1][lane] = bounds.max[axis];
        }
        self.children[lane] = child.0;
    }

    pub fn child(&self, slot: usize) -> Child {
        Child(self.children[Self::lane(slot)])
    }

    pub fn bounds(&self, slot: usize) -> Aabb {
        let lane = Self::lane(slot);
        Aabb {
            min: core::array::from_fn(|axis| self.planes[axis][0][lane]),
            max: core::array::from_fn(|axis| self.planes[axis][1][lane]),
        }
    }

    /// Around all children.
    pub fn all_bounds(&self) -> Aabb {
        (0..self.len()).fold(Aabb::EMPTY, |all, slot| all.union(&self.bounds(slot)))
    }

    /// How many slots are occupied; they come first.
    pub fn len(&self) -> usize {
        (0..N)
            .take_while(|&slot| self.child(slot) != Child::EMPTY)
            .count()
    }

    /// Puts the child of slot `slots[i]` into slot `i`.
    pub fn permute(&mut self, slots: &[u8; N]) {
        let old = self.clone();
        for (slot, &from) in slots.iter().enumerate() {
            self.set(slot, old.child(from as usize), &old.bounds(from as usize));
        }
    }
}
