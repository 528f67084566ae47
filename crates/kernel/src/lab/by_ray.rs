//! Orders that depend on the ray: by the distance of boxes, or by the direction of the ray, from a table of permutations
//! beside the nodes.

use alloc::format;
use alloc::vec::Vec;

use antumbra_simd::{Lanes, Mask};

use super::saved::is_permutation;
use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::ray_setup::{RaySetup, max};
use crate::tree::node::Node;
use crate::tree::words::{Sink, Words};

/// How an occlusion query picks the next child by the ray.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ByRay {
    /// By the distance at which boxes are entered, nearest first.
    Distance,
    /// By the distance at which boxes are left, farthest first.
    Far,
    /// By one of several orders that a node has, chosen by the signs of the ray's direction.
    Direction(DirectedOrder),
}

impl ByRay {
    /// The lanes of node `index` that `ray` hit, the one to be visited first at the end, and how many they are. `mask`
    /// are these lanes, `entry` the distances at which their boxes are entered.
    #[inline(always)]
    pub fn lanes<const N: usize, L: Lanes<N>>(
        &self,
        (index, node): (usize, &Node<N>),
        ray: &RaySetup,
        mask: L::Mask,
        entry: L,
    ) -> ([u32; N], usize) {
        let all: [u32; N] = core::array::from_fn(|lane| lane as u32);
        let mut lanes = [0; N];
        let count = match self {
            Self::Distance => {
                let mut pairs = [0; N];
                let count = entry.compress_sorted(mask, &all, &mut pairs);
                for lane in 0..N {
                    lanes[lane] = pairs[lane] as u32;
                }
                count
            }
            Self::Far => {
                let count = mask.compress(&all, &mut lanes);
                sort_by_end(ray, node, &mut lanes[..count]);
                count
            }
            Self::Direction(order) => {
                let bits = mask.bits();
                let mut count = 0;
                for &lane in order.lanes::<N>(index, ray.octant()) {
                    // Written whether hit or not, and overwritten by the next one if not.
                    lanes[count % N] = u32::from(lane);
                    count += (bits >> lane & 1) as usize;
                }
                count
            }
        };
        (lanes, count)
    }

    /// Bytes of the rule beside the tree.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Distance | Self::Far => 0,
            Self::Direction(order) => order.bytes(),
        }
    }

    /// Writes the number of the rule, and its tables.
    pub fn write(&self, sink: &mut Sink<'_>) {
        match self {
            Self::Distance => sink.word(1),
            Self::Far => sink.word(3),
            Self::Direction(order) => {
                sink.word(2);
                order.write(sink);
            }
        }
    }

    /// Rule `number`, 1 to 3, as [`ByRay::write`] wrote it, for a tree of this many nodes.
    pub fn read(
        words: &mut Words<'_>,
        number: u32,
        nodes: usize,
        width: usize,
    ) -> Result<Self, Error> {
        match number {
            1 => Ok(Self::Distance),
            2 => DirectedOrder::read(words, nodes, width).map(Self::Direction),
            _ => Ok(Self::Far),
        }
    }
}

/// Several orders for each node: one for each of the eight octants of directions, or one for each sign of the direction
/// on an axis that every node chooses for itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct DirectedOrder {
    /// Orders per node: 2 or 8.
    orders: usize,
    /// Per node, which bit of the octant is the lowest that decides.
    shifts: Vec<u8>,
    /// Per node and order, as many lanes as a node has, the one to be visited first at the end: as they are
    /// pushed.
    lanes: Vec<u8>,
}

impl DirectedOrder {
    /// Memory for two or eight orders of this many nodes.
    pub fn with_capacity(orders: usize, nodes: usize, width: usize) -> Self {
        Self {
            orders,
            shifts: Vec::with_capacity(nodes),
            lanes: Vec::with_capacity(nodes * orders * width),
        }
    }

    /// Adds the next node: its orders, each a permutation of its slots, first the one to be visited first. If there
    /// are two, the sign on `axis` decides; of eight, the octant, and `axis` is 0.
    pub fn push<const N: usize>(&mut self, axis: usize, orders: impl Iterator<Item = [u8; N]>) {
        self.shifts.push(axis as u8);
        for slots in orders {
            let lanes = slots.iter().rev().map(|slot| N as u8 - 1 - slot);
            self.lanes.extend(lanes);
        }
    }

    /// The lanes of a node in the order in which the children that are hit are to be pushed.
    #[inline(always)]
    pub fn lanes<const N: usize>(&self, node: usize, octant: usize) -> &[u8; N] {
        let which = octant >> self.shifts[node] & (self.orders - 1);
        &self.lanes.as_chunks().0[node * self.orders + which]
    }

    /// Writes all orders, node by node.
    fn write(&self, sink: &mut Sink<'_>) {
        sink.word(self.orders as u32);
        sink.bytes(&self.shifts);
        sink.bytes(&self.lanes);
    }

    /// Orders for this number of nodes, as [`DirectedOrder::write`] wrote them.
    fn read(words: &mut Words<'_>, nodes: usize, width: usize) -> Result<Self, Error> {
        let orders = words.word()? as usize;
        let most_shift = match orders {
            2 => 2,
            8 => 0,
            _ => return Err(words.error(format!("no node has {orders} orders"))),
        };
        let shifts = words.bytes(nodes)?;
        let lanes = words.bytes(nodes.saturating_mul(orders * width))?;
        if shifts.iter().any(|shift| *shift > most_shift)
            || !lanes.chunks(width).all(is_permutation)
        {
            return Err(words.error("a node has no order"));
        }
        Ok(Self {
            orders,
            shifts,
            lanes,
        })
    }

    pub fn bytes(&self) -> usize {
        self.shifts.len() + self.lanes.len()
    }
}

/// Distance at which a ray leaves a box, wherever it ends itself.
fn left_at(ray: &RaySetup, bounds: &Aabb) -> f32 {
    let [rdir, _, offset] = &ray.slabs;
    let far = |axis: usize| match ray.negative(axis) {
        true => bounds.min[axis],
        false => bounds.max[axis],
    };
    (0..3).fold(f32::INFINITY, |leave, axis| {
        -max(offset[axis] - far(axis) * rdir[axis], -leave)
    })
}

/// Sorts lanes so that the box that is left last comes last; of equal ones the box of the lower slot.
fn sort_by_end<const N: usize>(ray: &RaySetup, node: &Node<N>, lanes: &mut [u32]) {
    let mut ends = [0.0; N];
    for &lane in lanes.iter() {
        ends[lane as usize] = left_at(ray, &node.bounds(N - 1 - lane as usize));
    }
    // Stable, and lanes ascend: equal ones stay so.
    lanes.sort_by(|a, b| ends[*a as usize].total_cmp(&ends[*b as usize]));
}
