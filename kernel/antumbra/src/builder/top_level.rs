//! The top level of a world whose objects are trees already: wide nodes over boxes, made from scratch for every frame.
//!
//! A node begins as one part of all items. The part with the largest box is divided by the surface area heuristic until
//! there are as many parts as slots. A part of one item becomes the reference of the item, any other part a node.
//! Children are sorted by falling area, or in the order that an earlier top level learned. One thread suffices for tens
//! of thousands of items.

use alloc::vec::Vec;
use core::ops::Range;

use crate::aabb::Aabb;
use crate::builder::binned_sah::Part;
use crate::builder::binned_sah::items::Items;
use crate::builder::cost::ItemWeights;
use crate::tree::node::{Child, ChildKind};
use crate::tree::nodes::Nodes;
use crate::tree::width::Width;

pub(crate) use crate::builder::cost::instance_weight;
pub(crate) use crate::builder::subtrees::take_apart;

/// What a top level is built over: an instance, or a subtree that lies in the world itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TopItem {
    /// Finite and not empty.
    pub bounds: Aabb,
    /// Size of what is below the item, in leaf blocks. Positive.
    pub weight: f32,
    pub child: TopChild,
}

/// What an item refers to.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TopChild {
    /// A node or leaf of the tree.
    Subtree(Child),
    /// Index of an instance among those given.
    Instance(u32),
}

impl TopItem {
    /// Moves the reference to a node back by `by` nodes.
    pub fn move_back(&mut self, by: usize) {
        if let Some((index, child)) = self.node() {
            *child = Child::inner(index + by);
        }
    }

    /// The node that the item refers to, and the reference.
    pub fn node(&mut self) -> Option<(usize, &mut Child)> {
        match &mut self.child {
            TopChild::Subtree(child) => match child.kind() {
                ChildKind::Inner(index) => Some((index, child)),
                _ => None,
            },
            TopChild::Instance(_) => None,
        }
    }
}

/// Nodes over items.
#[derive(Debug)]
pub(crate) struct TopLevel {
    /// In depth-first order; the first is the root and always there.
    pub nodes: Nodes,
    /// The instances in the order in which the nodes refer to them.
    pub instances: Vec<u32>,
    /// Levels of nodes, the root being one.
    pub depth: usize,
    /// The box around all items.
    pub bounds: Aabb,
}

impl TopLevel {
    /// Builds nodes of a width over items. Without items there is an empty root. `ranks` are the places of the items in an order that was
    /// learned; empty if nothing was.
    pub fn new(items: &[TopItem], ranks: &[u32], width: Width) -> Self {
        let weights = ItemWeights(items.iter().map(|item| item.weight).collect());
        let mut parts = Items::new(items.iter().map(|item| item.bounds), &weights);
        let root = parts.all();
        let mut top = Self {
            nodes: Nodes::with_capacity(width, 1 + items.len() / 2),
            instances: Vec::with_capacity(items.len()),
            depth: 1,
            bounds: root.bounds(),
        };
        top.add_node((items, ranks), &mut parts, root, 1);
        top
    }

    /// Largest number of nodes that this many items need.
    pub fn most_nodes(items: usize) -> usize {
        // Every node but an empty or a lone root has two children or more.
        items.saturating_sub(1).max(1)
    }

    /// Appends the node of a part and all that is below, and returns its place.
    fn add_node(
        &mut self,
        (items, ranks): (&[TopItem], &[u32]),
        parts: &mut Items<'_>,
        part: Part,
        level: usize,
    ) -> usize {
        self.depth = self.depth.max(level);
        let place = self.nodes.len();
        self.nodes.push_empty();
        let width = self.nodes.width().lanes();
        for (slot, part) in children(parts, part, ranks, width).into_iter().enumerate() {
            let child = match parts.only(&part).map(|item| items[item].child) {
                Some(TopChild::Subtree(child)) => child,
                Some(TopChild::Instance(index)) => {
                    self.instances.push(index);
                    Child::instance(self.instances.len() - 1)
                }
                None => Child::inner(self.add_node((items, ranks), parts, part, level + 1)),
            };
            self.nodes.get_mut(place).set(slot, child, &part.bounds());
        }
        place
    }
}

/// Divides a part into the children of a node: the lowest ranks first, and among equal ranks the largest box.
fn children(items: &mut Items<'_>, part: Part, ranks: &[u32], width: usize) -> Vec<Part> {
    let mut parts = Vec::with_capacity(width);
    if part.len() > 0 {
        parts.push(part);
    }
    while parts.len() < width
        && let Some(large) = largest(&parts, width + 1..usize::MAX)
    {
        let [left, right] = items.halves(&parts[large]);
        parts[large] = left;
        parts.push(right);
    }
    // Parts whose items all have room need no node of their own.
    while let Some(small) = largest(&parts, 2..width + 2 - parts.len()) {
        let part = parts.swap_remove(small);
        parts.extend(items.singles(&part));
    }
    parts.sort_by(|a, b| b.half_area().total_cmp(&a.half_area()));
    if !ranks.is_empty() {
        parts.sort_by_cached_key(|part| {
            let sum: u64 = items.indices(part).map(|item| u64::from(ranks[item])).sum();
            sum / part.len() as u64
        });
    }
    parts
}

/// Place of the part with the largest box, among the parts that have this many items.
fn largest(parts: &[Part], lens: Range<usize>) -> Option<usize> {
    let mut largest = None;
    let mut largest_area = f32::NEG_INFINITY;
    for (place, part) in parts.iter().enumerate() {
        let area = part.half_area();
        // NaN, of boxes too large to be measured, is taken like any other if nothing else is left.
        if lens.contains(&part.len()) && (largest.is_none() || area > largest_area) {
            (largest, largest_area) = (Some(place), area);
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use alloc::format;
    use alloc::vec;

    use super::*;
    use antumbra_testkit::Rng;

    /// Boxes of a kind, each with its place in the list.
    fn items(count: usize, mut bounds: impl FnMut(usize) -> Aabb) -> Vec<TopItem> {
        let item = |index: usize| TopItem {
            bounds: bounds(index),
            weight: 1.0,
            child: TopChild::Instance(index as u32),
        };
        (0..count).map(item).collect()
    }

    /// Checks that every item is referred to once and that boxes hold what is below them.
    fn check(items: &[TopItem], width: Width, place: &str) -> TopLevel {
        let top = TopLevel::new(items, &[], width);
        assert!(
            top.nodes.len() <= TopLevel::most_nodes(items.len()),
            "{place}"
        );
        let mut found = vec![0; items.len()];
        let mut parents = vec![0; top.nodes.len()];
        for (index, node) in top.nodes.iter().enumerate() {
            for slot in 0..node.len() {
                let below = match node.child(slot).kind() {
                    ChildKind::Inner(child) => {
                        assert!(child > index, "{place}");
                        parents[child] += 1;
                        top.nodes.get(child).all_bounds()
                    }
                    ChildKind::Instance(instance) => {
                        let item = top.instances[instance] as usize;
                        found[item] += 1;
                        items[item].bounds
                    }
                    ChildKind::Leaf(_) => unreachable!("no leaves are given"),
                };
                assert_eq!(node.bounds(slot), below, "{place}");
            }
        }
        assert!(found.iter().all(|count| *count == 1), "{place}");
        assert!(parents[1..].iter().all(|count| *count == 1), "{place}");
        assert!(top.depth <= 48 + 30, "{place}");
        top
    }

    #[test]
    fn everything_is_below_the_root_once() {
        let mut rng = Rng::new(404);
        for count in [0, 1, 2, 3, 4, 5, 16, 17, 18, 40, 300, 5000] {
            let random = items(count, |_| Aabb::around(&[rng.point(1.0), rng.point(1.0)]));
            let equal = items(count, |_| Aabb::around(&[[1.0; 3], [2.0; 3]]));
            let huge = items(count, |index| {
                let x = 1e38 * (index % 3) as f32;
                Aabb::around(&[[-x; 3], [1e30 + x; 3]])
            });
            let nested = items(count, |index| {
                let size = 0.5f32.powi((index % 200) as i32);
                Aabb::around(&[[0.0; 3], [size; 3]])
            });
            for (items, kind) in [
                (random, "random"),
                (equal, "equal"),
                (huge, "huge"),
                (nested, "nested"),
            ] {
                let place = format!("{count} {kind}");
                for width in Width::ALL {
                    check(&items, width, &place);
                }
            }
        }
    }

    /// Nodes are nearly full, which is what makes them few.
    #[test]
    fn slots_are_used() {
        let mut rng = Rng::new(405);
        let items = items(10_000, |_| {
            let [x, y, z] = rng.point(100.0);
            Aabb::around(&[[x, y, z], [x + 1.0, y + 1.0, z + 1.0]])
        });
        let nodes = check(&items, Width::W8, "scattered").nodes.len();
        assert!(nodes < 10_000 / 4, "{nodes} nodes");
    }
}
