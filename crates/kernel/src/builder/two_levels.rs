//! The tree of a world with instances: one leaf per instance, among the subtrees over what lies in the world
//! itself.
//!
//! The primitives of the world have a tree already, from any builder. The tree is taken apart into about as many
//! subtrees as there are instances, and those and the instances are put together by the surface area heuristic
//! with bins (Wald 2007), in which an instance weighs as much as entering it and the tree of its object do.
//! The instances are thousands where the primitives are millions, so one thread and plain code suffice.

use alloc::collections::BinaryHeap;
use alloc::vec;
use alloc::vec::Vec;
use core::cmp::Reverse;

use crate::aabb::Aabb;
use crate::geometry::BLOCK;
use crate::geometry::primitives::Primitives;
use crate::math;
use crate::tree::binary::{BinaryKind, BinaryNode, BinaryTree};
use crate::tree::costs::CostModel;

/// From this depth on items are halved by count, so that no input can make the tree deeper than this, plus
/// 30 levels, plus those of a subtree.
const MAX_SAH_DEPTH: usize = 48;

/// Bins per axis.
const BINS: usize = 32;

/// The world is taken apart into at least so many subtrees.
const MIN_SUBTREES: usize = 64;

/// Puts the instances into a tree over the primitives of the world, which may be empty. There are instances.
pub(crate) fn with_instances(world: &BinaryTree, primitives: &Primitives) -> BinaryTree {
    let model = CostModel::default();
    let mut items = subtrees(world, primitives.instances.len().max(MIN_SUBTREES));
    let weights: Vec<f32> = primitives
        .objects
        .iter()
        .map(|object| {
            let below = blocks_weight(object.len() as f32 / BLOCK as f32);
            // So that `blocks_weight` gives the sum for an instance alone.
            math::powf(model.entry + model.node + below, 4.0 / 3.0)
        })
        .collect();
    for (placed, index) in primitives.instances.iter().zip(primitives.len() as u32..) {
        items.push(Item {
            bounds: placed.placement.bounds(),
            weight: weights[placed.object as usize],
            kind: ItemKind::Instance(index),
        });
    }
    let mut tree = BinaryTree::default();
    let mut build = Build {
        world,
        tree: &mut tree,
    };
    build.subtree(&mut items, 0);
    tree
}

/// Cost of so many leaf blocks, as the other builders have it.
fn blocks_weight(blocks: f32) -> f32 {
    let blocks = blocks.max(1.0);
    math::sqrt_f32(blocks * math::sqrt_f32(blocks))
}

/// A subtree or an instance, to be put together with others.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    /// In leaf blocks.
    weight: f32,
    kind: ItemKind,
}

#[derive(Clone, Copy)]
enum ItemKind {
    /// A node of the world's tree with all that is below.
    Subtree(usize),
    /// Index of an instance, as `Primitives::bounds_of` counts them.
    Instance(u32),
}

impl Item {
    fn center(&self, axis: usize) -> f32 {
        // Halves cannot overflow when added.
        0.5 * self.bounds.min[axis] + 0.5 * self.bounds.max[axis]
    }
}

/// Takes a tree apart, the largest boxes first, into `count` subtrees or as many as there are leaves.
fn subtrees(tree: &BinaryTree, count: usize) -> Vec<Item> {
    if tree.nodes.is_empty() {
        return Vec::new();
    }
    let prims = prims_below(tree);
    // The bits of areas, which are not negative, compare as they do. Of equals the first node.
    let entry = |node: usize| (tree.nodes[node].bounds.half_area().to_bits(), Reverse(node));
    let mut open = BinaryHeap::from([entry(0)]);
    let mut leaves = Vec::new();
    while open.len() + leaves.len() < count
        && let Some((_, Reverse(node))) = open.pop()
    {
        match tree.children(node) {
            Some(pair) => open.extend(pair.map(entry)),
            None => leaves.push(node),
        }
    }
    leaves.extend(open.into_iter().map(|(_, Reverse(node))| node));
    leaves.sort_unstable();
    leaves
        .into_iter()
        .map(|node| Item {
            bounds: tree.nodes[node].bounds,
            weight: prims[node].div_ceil(BLOCK as u32) as f32,
            kind: ItemKind::Subtree(node),
        })
        .collect()
}

/// How many primitives are below each node.
fn prims_below(tree: &BinaryTree) -> Vec<u32> {
    let mut prims = vec![0; tree.nodes.len()];
    for node in (0..tree.nodes.len()).rev() {
        prims[node] = match tree.nodes[node].kind {
            BinaryKind::Inner { right } => prims[node + 1] + prims[node + right as usize],
            BinaryKind::Leaf { count, .. } => count,
        };
    }
    prims
}

struct Build<'a> {
    world: &'a BinaryTree,
    tree: &'a mut BinaryTree,
}

impl Build<'_> {
    /// Appends the subtree over the items, of which there are some.
    fn subtree(&mut self, items: &mut [Item], depth: usize) {
        if let [item] = items {
            return self.item(item);
        }
        let index = self.tree.nodes.len();
        self.tree.nodes.push(BinaryNode {
            bounds: around(items),
            kind: BinaryKind::Inner { right: 0 },
        });
        let middle = split(items, depth);
        let (left, right) = items.split_at_mut(middle);
        self.subtree(left, depth + 1);
        self.tree.nodes[index].kind = BinaryKind::Inner {
            right: (self.tree.nodes.len() - index) as u32,
        };
        self.subtree(right, depth + 1);
    }

    /// Appends one item.
    fn item(&mut self, item: &Item) {
        let (nodes, prims) = (&mut self.tree.nodes, &mut self.tree.prims);
        match item.kind {
            ItemKind::Instance(index) => {
                nodes.push(BinaryNode {
                    bounds: item.bounds,
                    kind: BinaryKind::Leaf {
                        first: prims.len() as u32,
                        count: 1,
                    },
                });
                prims.push(index);
            }
            ItemKind::Subtree(root) => {
                // Depth-first order: the last node of a subtree is the leaf at the end of its right children.
                let mut last = root;
                while let Some([_, right]) = self.world.children(last) {
                    last = right;
                }
                for node in &self.world.nodes[root..=last] {
                    let mut node = *node;
                    if let BinaryKind::Leaf { first, count } = &mut node.kind {
                        let old = *first as usize..(*first + *count) as usize;
                        *first = prims.len() as u32;
                        prims.extend_from_slice(&self.world.prims[old]);
                    }
                    nodes.push(node);
                }
            }
        }
    }
}

fn around(items: &[Item]) -> Aabb {
    items
        .iter()
        .fold(Aabb::EMPTY, |bounds, item| bounds.union(&item.bounds))
}

/// Cost of items in a box.
fn cost(bounds: &Aabb, weight: f32) -> f32 {
    bounds.half_area() * blocks_weight(weight)
}

/// Puts the items of the left side first and returns how many they are; both sides have some.
fn split(items: &mut [Item], depth: usize) -> usize {
    let centers = items.iter().fold(Aabb::EMPTY, |bounds, item| {
        let center = core::array::from_fn(|axis| item.center(axis));
        bounds.union(&Aabb {
            min: center,
            max: center,
        })
    });
    let best = if depth < MAX_SAH_DEPTH {
        best_plane(items, &centers)
    } else {
        None
    };
    match best {
        Some((axis, bin)) => {
            let bins = Bins::new(&centers, axis);
            // Keeps the order of items on each side: the tree depends on nothing else.
            items.sort_by_key(|item| bins.bin(item) >= bin);
            items.partition_point(|item| bins.bin(item) < bin)
        }
        None => {
            let spread = |axis: usize| centers.max[axis] - centers.min[axis];
            let axis = (1..3).fold(0, |best, axis| {
                if spread(axis) > spread(best) {
                    axis
                } else {
                    best
                }
            });
            items.sort_by(|a, b| a.center(axis).total_cmp(&b.center(axis)));
            items.len() / 2
        }
    }
}

/// Where centres fall on an axis.
struct Bins {
    axis: usize,
    origin: f32,
    /// 0 where the centres coincide, or are too far apart or too close for this to be a number.
    scale: f32,
}

impl Bins {
    fn new(centers: &Aabb, axis: usize) -> Self {
        let scale = BINS as f32 / (centers.max[axis] - centers.min[axis]);
        Self {
            axis,
            origin: centers.min[axis],
            scale: if scale < f32::INFINITY { scale } else { 0.0 },
        }
    }

    fn bin(&self, item: &Item) -> usize {
        (((item.center(self.axis) - self.origin) * self.scale) as usize).min(BINS - 1)
    }
}

/// The axis and the first bin of the right side where a split costs least; `None` if there is none between two
/// bins, or the areas are too large to be compared.
fn best_plane(items: &[Item], centers: &Aabb) -> Option<(usize, usize)> {
    let mut best = None;
    let mut best_cost = f32::INFINITY;
    for axis in 0..3 {
        let bins = Bins::new(centers, axis);
        if bins.scale == 0.0 {
            continue;
        }
        let mut contents = [(Aabb::EMPTY, 0.0); BINS];
        for item in items {
            let (bounds, weight) = &mut contents[bins.bin(item)];
            *bounds = bounds.union(&item.bounds);
            *weight += item.weight;
        }
        let mut right_costs = [0.0; BINS];
        let mut right = (Aabb::EMPTY, 0.0);
        for bin in (1..BINS).rev() {
            right = (right.0.union(&contents[bin].0), right.1 + contents[bin].1);
            right_costs[bin] = cost(&right.0, right.1);
        }
        let mut left = (Aabb::EMPTY, 0.0);
        for bin in 1..BINS {
            left = (
                left.0.union(&contents[bin - 1].0),
                left.1 + contents[bin - 1].1,
            );
            let sum = cost(&left.0, left.1) + right_costs[bin];
            // The first and the last bin are never empty, so both sides have some items.
            if sum < best_cost {
                best_cost = sum;
                best = Some((axis, bin));
            }
        }
    }
    best
}
