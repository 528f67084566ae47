//! Leaf splitting: leaves that many training rays reach are divided where that spares more than it costs.
//!
//! Builders stop when primitives fit a leaf block. But a few large leaves of a scene, such as the leaves of a floor or
//! a lamp's shade, are entered by a good part of all rays, and most of these pass between the primitives. Dividing
//! those few leaves hardly takes memory. `docs/notes/kernel.md` has measurements.

use alloc::vec;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::geometry::BLOCK;
use crate::geometry::primitives::Primitives;
use crate::learn::tree_log::{NodeCounts, TreeLog};
use crate::tree::binary::{BinaryKind, BinaryNode, BinaryTree};

/// Leaves are candidates if this many times as many rays come to them as to a leaf in the mean. Other leaves do not
/// repay a second leaf block, nor the time to search for a split.
const HEAVY: f32 = 4.0;
/// Cost of a leaf block in nodes, however many lanes are in use: see `docs/src/performance.md`.
const BLOCK_COST: f32 = 2.0;
/// Cost of one more child in nodes: its share of the node that is full earlier because of it.
const SLOT_COST: f32 = 0.125;

/// A binary tree with some leaves split, and where its nodes come from.
pub(crate) struct SplitLeaves {
    pub tree: BinaryTree,
    /// Per node, the node of the old tree that it was, or the leaf that it is a part of.
    pub origins: Vec<u32>,
    /// Per node, its area relative to that old node. Rays are taken to come here in this proportion.
    pub shares: Vec<f32>,
    /// Per place of [`BinaryTree::prims`], the place where the primitive was.
    pub places: Vec<u32>,
}

impl SplitLeaves {
    /// Splits leaves of a tree of at least one node. `visits` returns how many rays come to a node.
    pub fn new(primitives: &Primitives, tree: &BinaryTree, visits: impl Fn(usize) -> f32) -> Self {
        let leaves = || (0..tree.nodes.len()).filter(|&node| tree.children(node).is_none());
        let sum: f64 = leaves().map(|leaf| f64::from(visits(leaf))).sum();
        let heavy = HEAVY * (sum / leaves().count() as f64) as f32;
        let mut split = Self {
            tree: BinaryTree {
                nodes: Vec::with_capacity(tree.nodes.len()),
                prims: Vec::with_capacity(tree.prims.len()),
                identity: tree.identity.clone(),
                ..BinaryTree::default()
            },
            origins: Vec::with_capacity(tree.nodes.len()),
            shares: Vec::with_capacity(tree.nodes.len()),
            places: Vec::with_capacity(tree.prims.len()),
        };
        // Where the nodes of the old tree are in the new one.
        let mut moved = Vec::with_capacity(tree.nodes.len());
        for (index, node) in tree.nodes.iter().enumerate() {
            moved.push(split.tree.nodes.len() as u32);
            let parts = match node.kind {
                BinaryKind::Leaf { first, count } if visits(index) > heavy => {
                    Division::new(primitives, tree, node, first..first + count)
                }
                _ => None,
            };
            match (parts, node.kind) {
                (Some(parts), _) => split.push_parts(tree, index, parts),
                (None, BinaryKind::Inner { .. }) => split.push(index, 1.0, *node),
                (None, BinaryKind::Leaf { first, count }) => {
                    let kind = split.leaf(tree, first..first + count);
                    split.push(index, 1.0, BinaryNode { kind, ..*node });
                }
            }
        }
        for (index, node) in tree.nodes.iter().enumerate() {
            if let BinaryKind::Inner { right } = node.kind {
                let right = moved[index + right as usize] - moved[index];
                split.tree.nodes[moved[index] as usize].kind = BinaryKind::Inner { right };
            }
        }
        split
    }

    fn push(&mut self, origin: usize, share: f32, node: BinaryNode) {
        self.tree.nodes.push(node);
        self.origins.push(origin as u32);
        self.shares.push(share);
    }

    /// Appends the primitives of these places of the old tree.
    fn leaf(&mut self, tree: &BinaryTree, places: impl Iterator<Item = u32>) -> BinaryKind {
        let first = self.places.len() as u32;
        for place in places {
            self.places.push(place);
            self.tree.prims.push(tree.prims[place as usize]);
        }
        let count = self.places.len() as u32 - first;
        BinaryKind::Leaf { first, count }
    }

    fn push_parts(&mut self, tree: &BinaryTree, leaf: usize, division: Division) {
        let whole = tree.nodes[leaf].bounds.half_area();
        for part in division.parts {
            let kind = match part.kind {
                BinaryKind::Inner { .. } => part.kind,
                BinaryKind::Leaf { first, count } => {
                    let places = &division.places[first as usize..][..count as usize];
                    self.leaf(tree, places.iter().copied())
                }
            };
            let share = part.bounds.half_area() / whole;
            self.push(leaf, share, BinaryNode { kind, ..part });
        }
    }

    /// Counts of the nodes by the training log of the old tree. Parts are taken to be entered by their area. They are hit as
    /// often as their primitives, but no more often than entered or than the leaf was.
    pub fn counts(&self, old: &NodeCounts, log: &TreeLog) -> NodeCounts {
        let mut counts = NodeCounts {
            entered: Vec::with_capacity(self.origins.len()),
            hits: vec![0.0; self.origins.len()],
        };
        for (&origin, share) in self.origins.iter().zip(&self.shares) {
            counts.entered.push(old.entered[origin as usize] * share);
        }
        // Children before their parents.
        for node in (0..self.origins.len()).rev() {
            let whole = old.hits[self.origins[node] as usize];
            let below = match self.tree.nodes[node].kind {
                _ if self.shares[node] == 1.0 => whole,
                BinaryKind::Leaf { first, count } => {
                    let places = &self.places[first as usize..][..count as usize];
                    let hits = places.iter().map(|&place| log.prim_hits()[place as usize]);
                    hits.sum()
                }
                BinaryKind::Inner { right } => {
                    counts.hits[node + 1] + counts.hits[node + right as usize]
                }
            };
            counts.hits[node] = below.min(whole).min(counts.entered[node]);
        }
        counts
    }

    /// How often the log has seen the primitive at each place hit.
    pub fn prim_hits(&self, log: &TreeLog) -> Vec<f32> {
        let places = self.places.iter();
        places
            .map(|&place| log.prim_hits()[place as usize])
            .collect()
    }
}

/// A leaf divided into parts.
struct Division {
    /// Depth first; leaves own ranges of `places`.
    parts: Vec<BinaryNode>,
    places: [u32; BLOCK],
}

impl Division {
    /// The cheapest division that split after split leads to; `None` if it is cheaper to leave the leaf as it is.
    fn new(
        primitives: &Primitives,
        tree: &BinaryTree,
        leaf: &BinaryNode,
        range: core::ops::Range<u32>,
    ) -> Option<Self> {
        let len = range.len();
        let mut items = [Item::EMPTY; BLOCK];
        for (item, place) in items.iter_mut().zip(range) {
            let bounds = primitives.bounds_of(tree.prims[place as usize] as usize);
            *item = Item { bounds, place };
        }
        let items = &mut items[..len];
        let area = leaf.bounds.half_area();
        // Where a builder has split triangles the box is smaller than theirs: that is left as it is.
        if len < 2 || around(items) != leaf.bounds || !(area > 0.0 && area.is_finite()) {
            return None;
        }
        let mut parts = Vec::with_capacity(2 * BLOCK);
        divide(items, 0, &mut parts);
        let mut places = [0; BLOCK];
        for (place, item) in places.iter_mut().zip(&*items) {
            *place = item.place;
        }
        (parts.len() > 1).then_some(Self { parts, places })
    }
}

/// A primitive of a leaf.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    place: u32,
}

impl Item {
    const EMPTY: Self = Self {
        bounds: Aabb::EMPTY,
        place: 0,
    };

    /// Twice the centre on an axis.
    fn center(&self, axis: usize) -> f32 {
        self.bounds.min[axis] + self.bounds.max[axis]
    }
}

fn around(items: &[Item]) -> Aabb {
    let boxes = items.iter().map(|item| &item.bounds);
    boxes.fold(Aabb::EMPTY, |all, one| all.union(one))
}

/// Appends the cheapest division of some items, the first of which has number `first`, and sorts them accordingly.
/// Returns its cost, times the area.
fn divide(items: &mut [Item], first: u32, parts: &mut Vec<BinaryNode>) -> f32 {
    let index = parts.len();
    let count = items.len() as u32;
    let bounds = around(items);
    let whole = BinaryKind::Leaf { first, count };
    parts.push(BinaryNode {
        bounds,
        kind: whole,
    });
    let area = bounds.half_area();
    let alone = BLOCK_COST * area;
    let Some(middle) = best_split(items) else {
        return alone;
    };
    let (left, right) = items.split_at_mut(middle);
    let mut cost = SLOT_COST * area + divide(left, first, parts);
    parts[index].kind = BinaryKind::Inner {
        right: (parts.len() - index) as u32,
    };
    cost += divide(right, first + middle as u32, parts);
    // Also when something is NaN.
    if !(cost < alone) {
        parts.truncate(index + 1);
        parts[index].kind = whole;
        return alone;
    }
    cost
}

/// Sorts items along the axis, and returns the place, where the areas of the two sides sum up to least; `None` if there
/// are not two, or areas cannot be compared.
fn best_split(items: &mut [Item]) -> Option<usize> {
    let mut best = None;
    let mut least = f32::INFINITY;
    for axis in 0..3 {
        sort(items, axis);
        for middle in 1..items.len() {
            let (left, right) = items.split_at(middle);
            let sum = around(left).half_area() + around(right).half_area();
            if sum < least {
                least = sum;
                best = Some((axis, middle));
            }
        }
    }
    let (axis, middle) = best?;
    sort(items, axis);
    Some(middle)
}

/// Equal centres stay apart by their places, so that the order is one and the same everywhere.
fn sort(items: &mut [Item], axis: usize) {
    items.sort_unstable_by(|a, b| {
        let centers = a.center(axis).total_cmp(&b.center(axis));
        centers.then(a.place.cmp(&b.place))
    });
}

#[cfg(test)]
mod tests {
    use alloc::format;

    use super::*;
    use crate::builder::Builder;
    use crate::geometry::Geometry;
    use crate::geometry::test_primitives::primitives;
    use antumbra_testkit::{Rng, mesh};

    /// Some leaves are heavy, whatever is in them.
    fn visits(node: usize) -> f32 {
        if node % 11 == 3 { 1000.0 } else { 1.0 }
    }

    #[test]
    fn nothing_is_lost_and_split_leaves_cost_less() {
        let seed = 71;
        let mut rng = Rng::new(seed);
        let mut parts_in_all = 0;
        for generate in mesh::ALL {
            let mesh = generate(&mut rng, 600);
            let primitives = primitives(&mesh, 20, &mut rng);
            for builder in Builder::ALL {
                let tree = BinaryTree::build(&primitives, builder);
                if tree.nodes.is_empty() {
                    continue;
                }
                let split = SplitLeaves::new(&primitives, &tree, visits);
                let place = format!("seed {seed} {} {builder}", mesh.name);

                let mut places = split.places.clone();
                places.sort_unstable();
                assert!(places.into_iter().eq(0..tree.prims.len() as u32), "{place}");
                let prims = split.places.iter().map(|&from| tree.prims[from as usize]);
                assert!(prims.eq(split.tree.prims.iter().copied()), "{place}");

                let mut costs = vec![0.0; tree.nodes.len()];
                for (node, &origin) in split.origins.iter().enumerate() {
                    let (now, before) = (&split.tree.nodes[node], &tree.nodes[origin as usize]);
                    let area = now.bounds.half_area();
                    assert!(before.bounds.contains(&now.bounds), "{place} node {node}");
                    match (now.kind, before.kind) {
                        (BinaryKind::Inner { .. }, _) => {
                            let children = split.tree.children(node).expect("an inner node");
                            for child in children {
                                let child = &split.tree.nodes[child].bounds;
                                assert!(now.bounds.contains(child), "{place} node {node}");
                            }
                            costs[origin as usize] += SLOT_COST * area;
                        }
                        (
                            BinaryKind::Leaf { first, count },
                            BinaryKind::Leaf {
                                first: old,
                                count: all,
                            },
                        ) => {
                            for index in first..first + count {
                                let from = split.places[index as usize];
                                assert!((old..old + all).contains(&from), "{place} node {node}");
                            }
                            costs[origin as usize] += BLOCK_COST * area;
                        }
                        _ => panic!("{place}: a leaf that was a node"),
                    }
                }
                for (node, count) in parts(&split, &tree) {
                    if count > 1 {
                        let alone = BLOCK_COST * tree.nodes[node].bounds.half_area();
                        assert!(visits(node) > 1.0, "{place} node {node}");
                        assert!(costs[node] < 1.00001 * alone, "{place} node {node}");
                        parts_in_all += count;
                    }
                }
            }
        }
        assert!(parts_in_all > 100, "{parts_in_all}");
    }

    /// How many nodes every old one has become.
    fn parts(split: &SplitLeaves, tree: &BinaryTree) -> impl Iterator<Item = (usize, usize)> {
        let mut counts = vec![0; tree.nodes.len()];
        for &origin in &split.origins {
            counts[origin as usize] += 1;
        }
        counts.into_iter().enumerate()
    }

    /// Two triangles in opposite corners of a leaf, and two that nearly coincide in another.
    #[test]
    fn only_leaves_in_two_places_are_split_and_only_where_many_rays_come() {
        let triangle = |x: f32| [[x, x, x], [x + 1.0, x, x], [x, x + 1.0, x]];
        let positions: Vec<[f32; 3]> = [0.0, 50.0, 2000.0, 2000.125]
            .into_iter()
            .flat_map(triangle)
            .collect();
        let indices: Vec<[u32; 3]> = (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let geometry = [Geometry::triangles(&positions[..], &indices[..])];
        let primitives = Primitives::new(&geometry).expect("indices in range");
        let leaf = |range: core::ops::Range<u32>| BinaryNode {
            bounds: range.clone().fold(Aabb::EMPTY, |all, index| {
                all.union(&primitives.bounds_of(index as usize))
            }),
            kind: BinaryKind::Leaf {
                first: range.start,
                count: range.len() as u32,
            },
        };
        let (apart, together) = (leaf(0..2), leaf(2..4));
        let tree = BinaryTree {
            nodes: vec![
                BinaryNode {
                    bounds: apart.bounds.union(&together.bounds),
                    kind: BinaryKind::Inner { right: 2 },
                },
                apart,
                together,
            ],
            prims: (0..4).collect(),
            ..BinaryTree::default()
        };
        let is_divided = |leaf: usize, range| {
            Division::new(&primitives, &tree, &tree.nodes[leaf], range).is_some()
        };
        assert!(is_divided(1, 0..2) && !is_divided(2, 2..4));
        // Of two leaves none has four times as many rays as they have in the mean.
        let split = SplitLeaves::new(&primitives, &tree, |node| [9.0, 9.0, 0.0][node]);
        assert_eq!(split.tree.nodes.len(), 3);
    }

    /// Boxes that are smaller than their primitives stay as they are.
    #[test]
    fn leaves_of_split_triangles_are_left_alone() {
        let mut rng = Rng::new(72);
        let mesh = mesh::soup(&mut rng, 8);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let primitives = Primitives::new(&geometry).expect("indices in range");
        let tree = BinaryTree::build(&primitives, Builder::BinnedSah);
        let [mut leaf] = tree.nodes[..] else {
            panic!("one leaf");
        };
        leaf.bounds.max[0] -= 0.01;
        assert!(Division::new(&primitives, &tree, &leaf, 0..8).is_none());
    }
}
