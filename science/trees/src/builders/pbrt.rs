//! The object splits of pbrt-v3, with its leaf rule.
//!
//! Counts of a study can be compared with the counts of a paper only on trees of the same shape. Ogaki and
//! Derouet-Jourdan (2016) built theirs with pbrt-v3: by the surface area heuristic over 12 buckets along the longest axis
//! of the centres (Pharr, Jakob and Humphreys 2016, section 4.3.2). How small leaves are changed in November 2015, and
//! the paper does not say from which state of pbrt-v3 it started. Both [rules](Rule) are here.

use crate::builders::candidates::center;
use crate::builders::pieces::Piece;
use antumbra::Aabb;
use antumbra::Primitives;
use antumbra::parts::BinaryTree;
use antumbra::parts::binned_subtree;

/// Buckets along the axis.
const BUCKETS: usize = 12;

/// A leaf holds no more primitives, unless their centres coincide.
const MOST: usize = 4;

/// From this depth on binned SAH goes on, which bounds the depth of the tree.
const MAX_DEPTH: u32 = 56;

/// Nodes of fewer primitives are the work of one thread.
const SEQUENTIAL: usize = 4096;

/// When a node becomes a leaf.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rule {
    /// Nodes of at most this many primitives are halved until each has one.
    halved: usize,
    /// Cost of visiting a node, where testing a primitive costs 1.
    visit: f32,
}

impl Rule {
    /// Since November 2015: three or four primitives are a leaf if that costs less than their best split.
    pub const LATER: Self = Self {
        halved: 2,
        visit: 1.0,
    };
    /// Until then: nodes of up to four were halved, so a leaf held one primitive.
    pub const EARLIER: Self = Self {
        halved: 4,
        visit: 0.125,
    };
}

/// Builds the tree. Primitives whose centres coincide share leaves as [`Builder::BinnedSah`](crate::recipe::Builder)
/// makes them.
pub(crate) fn build(primitives: &Primitives, rule: Rule) -> BinaryTree {
    let items: Vec<Item> = (0..primitives.len())
        .map(|index| Item::new(primitives, index))
        .collect();
    if items.is_empty() {
        return BinaryTree::default();
    }
    Plan { primitives, rule }.piece(items, 0).into_tree()
}

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    center: [f32; 3],
    index: u32,
}

impl Item {
    fn new(primitives: &Primitives, index: usize) -> Self {
        let bounds = primitives.bounds_of(index);
        Self {
            center: std::array::from_fn(|axis| center(&bounds, axis)),
            bounds,
            index: index as u32,
        }
    }
}

struct Plan<'a> {
    primitives: &'a Primitives,
    rule: Rule,
}

/// The cheapest split between two buckets.
struct Split {
    cost: f32,
    /// The last bucket on the left.
    last: usize,
}

impl Plan<'_> {
    fn piece(&self, mut items: Vec<Item>, depth: u32) -> Piece {
        let count = items.len();
        let (axis, low, high) = longest(&items);
        if count == 1 || depth >= MAX_DEPTH || low == high {
            return self.leaf(&items, depth);
        }
        let bounds = around(&items);
        let mut right = Vec::new();
        if count > self.rule.halved {
            // A bucket beyond the last is for the highest centre only.
            let bucket = |item: &Item| {
                let offset = (item.center[axis] - low) / (high - low);
                ((BUCKETS as f32 * offset) as usize).min(BUCKETS - 1)
            };
            let split = self.best_split(&items, &bounds, bucket);
            if count <= MOST && split.cost >= count as f32 {
                return self.leaf(&items, depth);
            }
            let (left, rest): (Vec<_>, _) = items.iter().partition(|i| bucket(i) <= split.last);
            // An extent that is no finite number puts all into one bucket.
            if !left.is_empty() && !rest.is_empty() {
                (items, right) = (left, rest);
            }
        }
        if right.is_empty() {
            items.sort_by(|a, b| a.center[axis].total_cmp(&b.center[axis]));
            right = items.split_off(count / 2);
        }
        let is_large = count > SEQUENTIAL;
        Piece::of_parts(bounds, [items, right], is_large, |items| {
            self.piece(items, depth + 1)
        })
    }

    fn leaf(&self, items: &[Item], depth: u32) -> Piece {
        let prims: Vec<u32> = items.iter().map(|item| item.index).collect();
        Piece::from(binned_subtree(self.primitives, &prims, depth))
    }

    fn best_split(&self, items: &[Item], whole: &Aabb, bucket: impl Fn(&Item) -> usize) -> Split {
        let mut buckets = [(Aabb::EMPTY, 0u32); BUCKETS];
        for item in items {
            let (bounds, count) = &mut buckets[bucket(item)];
            *bounds = bounds.union(&item.bounds);
            *count += 1;
        }
        let weight = |part: &[(Aabb, u32)]| {
            let empty = (Aabb::EMPTY, 0);
            let sum = |all: (Aabb, u32), one: &(Aabb, u32)| (all.0.union(&one.0), all.1 + one.1);
            let (bounds, count) = part.iter().fold(empty, sum);
            if count == 0 {
                return 0.0;
            }
            count as f32 * bounds.half_area()
        };
        let cost = |last: usize| {
            let (left, right) = buckets.split_at(last + 1);
            self.rule.visit + (weight(left) + weight(right)) / whole.half_area()
        };
        let splits = (0..BUCKETS - 1).map(|last| Split {
            cost: cost(last),
            last,
        });
        let cheaper = |a: Split, b: Split| if b.cost < a.cost { b } else { a };
        splits.reduce(cheaper).expect("more than one bucket")
    }
}

fn around(items: &[Item]) -> Aabb {
    let union = |all: Aabb, item: &Item| all.union(&item.bounds);
    items.iter().fold(Aabb::EMPTY, union)
}

/// The axis along which centres spread most, with the lowest and the highest centre.
fn longest(items: &[Item]) -> (usize, f32, f32) {
    let along = |axis: usize| {
        let centers = items.iter().map(|item| item.center[axis]);
        let (low, high) = (f32::INFINITY, f32::NEG_INFINITY);
        let (low, high) = centers.fold((low, high), |(low, high), x| (low.min(x), high.max(x)));
        (axis, low, high)
    };
    let wider = |a: (usize, f32, f32), b: (usize, f32, f32)| match b.2 - b.1 > a.2 - a.1 {
        true => b,
        false => a,
    };
    [0, 1, 2]
        .map(along)
        .into_iter()
        .reduce(wider)
        .expect("three axes")
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra::Geometry;
    use antumbra::parts::BinaryKind;

    /// Squares across the x axis, each of two triangles, at these places.
    fn squares(places: &[f32], size: f32) -> Primitives {
        let mut corners = Vec::new();
        let mut triangles = Vec::new();
        for x in places {
            let first = corners.len() as u32;
            corners.extend([[*x, 0.0, 0.0], [*x, size, 0.0], [*x, 0.0, size]]);
            triangles.push([first, first + 1, first + 2]);
        }
        Primitives::new(&[Geometry::triangles(&corners[..], triangles)]).expect("finite")
    }

    fn leaves(tree: &BinaryTree) -> Vec<u32> {
        let count = |kind: BinaryKind| match kind {
            BinaryKind::Leaf { count, .. } => Some(count),
            BinaryKind::Inner { .. } => None,
        };
        tree.nodes
            .iter()
            .filter_map(|node| count(node.kind))
            .collect()
    }

    /// Three triangles close together cost less as a leaf, far apart less as two nodes. Two are always halved.
    #[test]
    fn leaves_are_made_where_they_are_cheaper() {
        let close = squares(&[0.0, 0.01, 0.02], 1.0);
        assert_eq!(leaves(&build(&close, Rule::LATER)), [3]);
        assert_eq!(leaves(&build(&close, Rule::EARLIER)), [1, 1, 1]);
        let apart = squares(&[0.0, 10.0, 20.0], 0.01);
        assert_eq!(leaves(&build(&apart, Rule::LATER)), [1, 1, 1]);
        let two = squares(&[0.0, 0.01], 1.0);
        assert_eq!(leaves(&build(&two, Rule::LATER)), [1, 1]);
    }

    #[test]
    fn no_leaf_holds_more_than_four_unless_centres_coincide() {
        let places: Vec<f32> = (0..100).map(|i| (i * i % 83) as f32 * 0.001).collect();
        let tree = build(&squares(&places[..83], 1.0), Rule::LATER);
        let found = leaves(&tree);
        assert_eq!(found.iter().sum::<u32>(), 83);
        let same = build(&squares(&[1.0; 20], 1.0), Rule::LATER);
        assert_eq!(leaves(&same).iter().sum::<u32>(), 20);
    }

    #[test]
    fn coordinates_beyond_the_range_of_areas_are_halved() {
        let tree = build(
            &squares(&[-3e38, 3e38, 1e38, 0.0, 2e38, -1e38], 1e38),
            Rule::LATER,
        );
        assert_eq!(leaves(&tree).iter().sum::<u32>(), 6);
    }
}
