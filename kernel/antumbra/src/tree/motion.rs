//! Motion of a tree: what changes between two keys, and where it is at a time between them.
//!
//! A tree is built over the middle of a span between two keys. Then leaves and boxes are refitted to both keys, and what is
//! between follows: corners of triangles by [`crate::geometry::path::between`], boxes by planes that are linear in time.
//!
//! # Why no box that matters is ever missed
//!
//! With the words of [`crate::geometry::ray_setup`], where `reach` is the largest absolute coordinate at both keys:
//! - A box that holds a corner at both keys holds the exact corner between them at all times. A corner is computed by three
//!   operations, with an error of at most `5 u R`. So is a plane.
//! - A node above a triangle that is hit has `32 u R` to spare, and a static tree uses less than `16.3 u R` of it.
//! - The box of an instance at a time comes from its path, see [`crate::geometry::path`]. Boxes of nodes around it are wider by
//!   [`INSTANCE`] times the scene extent at both keys, more than computing either takes.

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use antumbra_simd::{Lanes, Simd, Width};

use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::motion::SpanKeys;
use crate::geometry::path::{MovingPlacement, between};
use crate::geometry::primitives::PrimKind;
use crate::geometry::sound::is_sound;
use crate::geometry::triangle::{TriangleBlock, Vector};
use crate::geometry::{BLOCK, PrimRef};
use crate::tree::node::{Child, ChildKind, Leaf, Node, NodeRef};
use crate::tree::nodes::Nodes;
use crate::tree::wide::Tree;

/// Sixteen roundings of `f32`.
const INSTANCE: f32 = 1.0 / (1 << 20) as f32;

/// Corners of the triangles of a block at the end of the span, `[axis][corner][lane]`.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(crate) struct BlockMotion {
    corners: [[[f32; BLOCK]; 3]; 3],
}

/// Motion of nodes, blocks and instances during a span. The tree itself is the tree of the start.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    /// For each node of the tree of the world, how far its planes move from the start of the span to its end. Planes of
    /// empty lanes do not. Objects do not change inside.
    pub nodes: Nodes,
    /// For each triangle block of the world.
    pub blocks: Vec<BlockMotion>,
    /// For each instance of the tree; `None` for one that does not move.
    pub placements: Vec<Option<MovingPlacement>>,
}

impl TriangleBlock {
    /// The block at a share of the span; `self` is its start.
    #[inline(always)]
    pub fn between<S: Simd>(&self, simd: S, end: &BlockMotion, share: f32) -> Self {
        let mut block = Self {
            corners: [[[0.0; BLOCK]; 3]; 3],
            geom_ids: self.geom_ids,
            prim_ids: self.prim_ids,
        };
        let share = Vector::<S>::splat(simd, share);
        for axis in 0..3 {
            for corner in 0..3 {
                let start = Vector::<S>::load(simd, &self.corners[axis][corner]);
                let end = Vector::<S>::load(simd, &end.corners[axis][corner]);
                let at = start + share * (end - start);
                at.store(&mut block.corners[axis][corner]);
            }
        }
        block
    }
}

/// The planes of a side of a node at a share of the span in which it moves so far.
#[inline(always)]
pub(crate) fn planes_at<S: Simd + Width<N>, const N: usize>(
    simd: S,
    [start, moves]: [&Node<N>; 2],
    (axis, side): (usize, usize),
    share: <S as Width<N>>::Lanes,
) -> <S as Width<N>>::Lanes {
    type NodeLanes<S, const N: usize> = <S as Width<N>>::Lanes;
    let start = NodeLanes::<S, N>::load(simd, &start.planes[axis][side]);
    let change = NodeLanes::<S, N>::load(simd, &moves.planes[axis][side]);
    share * change + start
}

impl Tree {
    /// Makes a tree that was built over the middle of a span move between its keys.
    ///
    /// # Errors
    /// [`Error::PrimitiveIsGone`] for a triangle that is elsewhere in the middle: the tree is of another scene.
    pub(crate) fn set_motion(&mut self, keys: &SpanKeys) -> Result<(), Error> {
        let top = self.top_nodes();
        let mut motion = Motion {
            nodes: Nodes::with_capacity(self.width(), top),
            blocks: Vec::new(),
            placements: (self.instances.iter())
                .map(|placed| keys.placement(placed.placement.inst_id).cloned())
                .collect(),
        };
        motion.nodes.resize(top);
        motion.blocks = self.moving_blocks(keys)?;
        let mut reach = self.reach;
        let placed = motion
            .placements
            .iter()
            .flatten()
            .flat_map(MovingPlacement::bounds);
        for bounds in placed.chain(
            motion
                .blocks
                .iter()
                .enumerate()
                .flat_map(|(index, end)| block_bounds(&self.blocks.triangles[index], end)),
        ) {
            reach = reach.max(bounds.reach());
        }
        let mut all = alloc::vec![[Aabb::EMPTY; 2]; top];
        for index in (0..top).rev() {
            let len = self.nodes.get(index).len();
            for slot in len..self.width().lanes() {
                let nothing = Aabb::around(&[[0.0; 3]]);
                motion
                    .nodes
                    .get_mut(index)
                    .set(slot, Child::EMPTY, &nothing);
            }
            for slot in 0..len {
                let child = self.nodes.get(index).child(slot);
                let still = self.nodes.get(index).bounds(slot);
                let bounds = match child.kind() {
                    ChildKind::Inner(index) => all[index],
                    ChildKind::Leaf(Leaf {
                        kind: PrimKind::Triangle,
                        index,
                    }) => block_bounds(&self.blocks.triangles[index], &motion.blocks[index]),
                    ChildKind::Leaf(_) => [still; 2],
                    ChildKind::Instance(index) => match &motion.placements[index] {
                        Some(placement) => placement
                            .bounds()
                            .map(|bounds| wider(&bounds, INSTANCE * reach)),
                        None => [still; 2],
                    },
                };
                let [start, end] = bounds;
                self.nodes.get_mut(index).set(slot, child, &start);
                let moves = Aabb {
                    min: core::array::from_fn(|axis| end.min[axis] - start.min[axis]),
                    max: core::array::from_fn(|axis| end.max[axis] - start.max[axis]),
                };
                motion.nodes.get_mut(index).set(slot, child, &moves);
                let [first, last] = &mut all[index];
                (*first, *last) = (first.union(&start), last.union(&end));
            }
        }
        self.bounds = all[0][0].union(&all[0][1]);
        self.reach = self.bounds.reach();
        self.motion = Some(alloc::sync::Arc::new(motion));
        Ok(())
    }

    /// Checks that the boxes of the world hold what is below them at both keys, if anything moves.
    pub(crate) fn check_motion(&self) -> Result<(), String> {
        let Some(motion) = self.motion.as_deref() else {
            return Ok(());
        };
        // Adding a rounded difference may miss a plane by a rounding of the scene extent.
        let slack = 4.0 * f32::EPSILON * self.reach;
        let keys = [0, 1];
        for (index, node) in self.nodes.iter().take(self.top_nodes()).enumerate() {
            for slot in 0..node.len() {
                let own = keys.map(|key| self.slot_bounds(motion, (index, slot), key));
                let below = match node.child(slot).kind() {
                    ChildKind::Inner(child) => keys.map(|key| {
                        let slots = 0..self.nodes.get(child).len();
                        slots.fold(Aabb::EMPTY, |all, slot| {
                            all.union(&self.slot_bounds(motion, (child, slot), key))
                        })
                    }),
                    ChildKind::Leaf(Leaf {
                        kind: PrimKind::Triangle,
                        index,
                    }) => block_bounds(&self.blocks.triangles[index], &motion.blocks[index]),
                    ChildKind::Instance(index) => match &motion.placements[index] {
                        Some(placement) => placement.bounds(),
                        None => own,
                    },
                    ChildKind::Leaf(_) => own,
                };
                for key in keys {
                    if !wider(&own[key], slack).contains(&below[key]) {
                        return Err(format!(
                            "slot {slot} of node {index} does not hold what is below at key {key}: {:?}, {:?}",
                            own[key], below[key]
                        ));
                    }
                }
            }
        }
        Ok(())
    }

    /// The box of a slot of a node at a key.
    fn slot_bounds(&self, motion: &Motion, (node, slot): (usize, usize), key: usize) -> Aabb {
        let start = self.nodes.get(node).bounds(slot);
        let moves = motion.nodes.get(node).bounds(slot);
        let at = |start: f32, change: f32| start + key as f32 * change;
        Aabb {
            min: core::array::from_fn(|axis| at(start.min[axis], moves.min[axis])),
            max: core::array::from_fn(|axis| at(start.max[axis], moves.max[axis])),
        }
    }

    /// Brings the triangle blocks of the world to the start of a span, and returns their end.
    fn moving_blocks(&mut self, keys: &SpanKeys) -> Result<Vec<BlockMotion>, Error> {
        let top = self.nodes.iter().take(self.top_nodes());
        let children = top.flat_map(NodeRef::children);
        let of_world = children.filter_map(|(child, _)| match child.kind() {
            ChildKind::Leaf(Leaf {
                kind: PrimKind::Triangle,
                index,
            }) => Some(index + 1),
            _ => None,
        });
        // Blocks of the world come before blocks of objects.
        let count = of_world.max().unwrap_or(0);
        let mut ends = Vec::with_capacity(count);
        for block in &mut self.blocks.triangles[..count] {
            let mut end = BlockMotion {
                corners: block.corners,
            };
            for lane in 0..block.count() {
                let id = block.id(lane);
                if let Some([first, last]) = keys.corners(id) {
                    let middle = [0, 1, 2].map(|i| between(&first[i], &last[i], 0.5));
                    if is_sound(&middle) && middle != block.triangle(lane) {
                        let PrimRef { geom_id, prim_id } = id;
                        return Err(Error::PrimitiveIsGone { geom_id, prim_id });
                    }
                    block.set(lane, &first, id);
                    for axis in 0..3 {
                        for corner in 0..3 {
                            end.corners[axis][corner][lane] = last[corner][axis];
                        }
                    }
                }
            }
            ends.push(end);
        }
        Ok(ends)
    }
}

/// Boxes around the triangles of a block at both keys.
fn block_bounds(start: &TriangleBlock, end: &BlockMotion) -> [Aabb; 2] {
    let mut bounds = [Aabb::EMPTY; 2];
    for lane in 0..start.count() {
        let last: [[f32; 3]; 3] = core::array::from_fn(|corner| {
            core::array::from_fn(|axis| end.corners[axis][corner][lane])
        });
        bounds[0] = bounds[0].union(&Aabb::around(&start.triangle(lane)));
        bounds[1] = bounds[1].union(&Aabb::around(&last));
    }
    bounds
}

fn wider(bounds: &Aabb, by: f32) -> Aabb {
    Aabb {
        min: bounds.min.map(|x| (x - by).next_down()),
        max: bounds.max.map(|x| (x + by).next_up()),
    }
}
