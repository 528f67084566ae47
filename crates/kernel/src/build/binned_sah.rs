//! Binned SAH: every node is split between two of a few bins per axis, where the surface area heuristic
//! finds it cheapest.
//!
//! Source: Wald (2007), "On fast Construction of SAH-based Bounding Volume Hierarchies". Splitting stops
//! when the primitives fit one leaf block, which is tested at one go. The work is divided by counts of
//! primitives alone, so the tree does not depend on the number of threads.

use super::binary::{BinaryKind, BinaryNode, BinaryTree, join};
use crate::aabb::Aabb;
use crate::geometry::BLOCK;
use crate::primitives::Primitives;

/// Bins per axis.
const BINS: usize = 32;

/// From this depth on nodes are halved by count, whatever the heuristic says, so that no input can make
/// the tree (and with it recursion and traversal stacks) deeper than this plus 30 levels.
const MAX_SAH_DEPTH: usize = 64;

/// Subtrees smaller than this are built by one thread.
const SEQUENTIAL: usize = 4096;

/// What the builder keeps of a primitive.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    index: u32,
    is_sphere: bool,
}

impl Item {
    /// The centre, by halves that cannot overflow when added.
    fn center(&self, axis: usize) -> f32 {
        0.5 * self.bounds.min[axis] + 0.5 * self.bounds.max[axis]
    }
}

/// Builds the tree.
pub(super) fn build(primitives: &Primitives) -> BinaryTree {
    let mut items: Vec<Item> = (0..primitives.len())
        .map(|index| Item {
            bounds: primitives.bounds_of(index),
            index: index as u32,
            is_sphere: primitives.is_sphere(index),
        })
        .collect();
    let mut nodes = Vec::new();
    if !items.is_empty() {
        // A block's worth of items per leaf at least halves nodes against one item per leaf.
        nodes.reserve(items.len() / 2);
        let sequential = SEQUENTIAL.max(items.len() / 64);
        split(&mut items, 0, 0, sequential, &mut nodes);
    }
    BinaryTree {
        nodes,
        prims: items.iter().map(|item| item.index).collect(),
    }
}

/// Appends the subtree over `items` to `nodes`. `first` is where `items` begin among all of them.
fn split(
    items: &mut [Item],
    first: usize,
    depth: usize,
    sequential: usize,
    nodes: &mut Vec<BinaryNode>,
) {
    let bounds = items
        .iter()
        .fold(Aabb::EMPTY, |all, item| all.union(&item.bounds));
    let same_kind = items
        .iter()
        .all(|item| item.is_sphere == items[0].is_sphere);
    if items.len() <= BLOCK && same_kind {
        let kind = BinaryKind::Leaf {
            first: first as u32,
            count: items.len() as u32,
        };
        nodes.push(BinaryNode { bounds, kind });
        return;
    }
    let middle = if items.len() <= BLOCK {
        // A leaf holds one kind.
        partition(items, |item| !item.is_sphere)
    } else if depth < MAX_SAH_DEPTH {
        sah_partition(items)
    } else {
        median_partition(items)
    };

    let parent = nodes.len();
    nodes.push(BinaryNode {
        bounds,
        kind: BinaryKind::Inner { right: 0 },
    });
    let (left, right) = items.split_at_mut(middle);
    let right_first = first + middle;
    let right_index;
    if left.len() + right.len() > sequential {
        let mut right_nodes = Vec::new();
        join(
            || split(left, first, depth + 1, sequential, nodes),
            || split(right, right_first, depth + 1, sequential, &mut right_nodes),
        );
        // Children are found by relative places, so subtrees can be moved as they are.
        right_index = nodes.len();
        nodes.append(&mut right_nodes);
    } else {
        split(left, first, depth + 1, sequential, nodes);
        right_index = nodes.len();
        split(right, right_first, depth + 1, sequential, nodes);
    }
    nodes[parent].kind = BinaryKind::Inner {
        right: (right_index - parent) as u32,
    };
}

/// Reorders `items` so that those for which `is_left` holds come first; returns how many they are.
fn partition(items: &mut [Item], is_left: impl Fn(&Item) -> bool) -> usize {
    let mut middle = 0;
    for index in 0..items.len() {
        if is_left(&items[index]) {
            items.swap(index, middle);
            middle += 1;
        }
    }
    middle
}

/// Halves the items by count, along the axis on which their centres spread most.
fn median_partition(items: &mut [Item]) -> usize {
    let centers = center_bounds(items);
    let spread = |axis: usize| centers.max[axis] - centers.min[axis];
    let axis = (0..3)
        .max_by(|&a, &b| spread(a).total_cmp(&spread(b)))
        .unwrap_or(0);
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.center(axis)
            .total_cmp(&b.center(axis))
            .then(a.index.cmp(&b.index))
    });
    middle
}

fn center_bounds(items: &[Item]) -> Aabb {
    items.iter().fold(Aabb::EMPTY, |all, item| {
        let center = core::array::from_fn(|axis| item.center(axis));
        all.union(&Aabb {
            min: center,
            max: center,
        })
    })
}

/// Maps centres to bins along one axis.
#[derive(Clone, Copy)]
struct Binning {
    axis: usize,
    origin: f32,
    scale: f32,
}

impl Binning {
    /// `None` when all centres coincide on the axis, or are too far apart or too close for the scale to
    /// be a number.
    fn new(centers: &Aabb, axis: usize) -> Option<Self> {
        let extent = centers.max[axis] - centers.min[axis];
        let scale = BINS as f32 * 0.99999 / extent;
        let usable = extent > 0.0 && scale.is_finite() && scale > 0.0;
        usable.then_some(Self {
            axis,
            origin: centers.min[axis],
            scale,
        })
    }

    fn bin(&self, item: &Item) -> usize {
        let bin = (item.center(self.axis) - self.origin) * self.scale;
        (bin as usize).min(BINS - 1)
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    count: usize,
}

impl Bin {
    const EMPTY: Self = Self {
        bounds: Aabb::EMPTY,
        count: 0,
    };

    fn add(&mut self, other: &Self) {
        self.bounds = self.bounds.union(&other.bounds);
        self.count += other.count;
    }

    /// Area times leaf blocks: what the subtree costs, up to a factor.
    fn cost(&self) -> f32 {
        self.bounds.half_area() * self.count.div_ceil(BLOCK) as f32
    }
}

/// Splits where area times blocks is least; by count when no split between bins is possible.
fn sah_partition(items: &mut [Item]) -> usize {
    let centers = center_bounds(items);
    let mut best: Option<(f32, Binning, usize)> = None;
    for axis in 0..3 {
        let Some(binning) = Binning::new(&centers, axis) else {
            continue;
        };
        let mut bins = [Bin::EMPTY; BINS];
        for item in items.iter() {
            bins[binning.bin(item)].add(&Bin {
                bounds: item.bounds,
                count: 1,
            });
        }
        let mut right_cost = [0.0; BINS];
        let mut right = Bin::EMPTY;
        for split in (1..BINS).rev() {
            right.add(&bins[split]);
            right_cost[split] = if right.count > 0 {
                right.cost()
            } else {
                f32::INFINITY
            };
        }
        let mut left = Bin::EMPTY;
        for split in 1..BINS {
            left.add(&bins[split - 1]);
            if left.count == 0 {
                continue;
            }
            let cost = left.cost() + right_cost[split];
            if cost < best.map_or(f32::INFINITY, |(best, ..)| best) {
                best = Some((cost, binning, split));
            }
        }
    }
    match best {
        Some((_, binning, split)) => partition(items, |item| binning.bin(item) < split),
        None => median_partition(items),
    }
}
