//! A tree from a file collapsed again, for nodes of another width: leaves stay where they are, and so does the order in which
//! an occlusion query comes to them, which was learned.
//!
//! A node with too many children gets nodes between itself and neighbours in its order, those whose common box is smallest.
//! One with room takes in the children of its largest child, as a collapse by areas does (Wald et al. 2008).

use alloc::vec;
use alloc::vec::Vec;

use super::node::{Child, ChildKind};
use super::nodes::Nodes;
use super::wide::Tree;
use super::width::Width;
use crate::aabb::Aabb;

/// Nodes of trees that were collapsed again.
pub(crate) struct Recollapsed {
    pub nodes: Nodes,
    /// The root of each tree, and how many levels of nodes it has.
    pub roots: Vec<(u32, usize)>,
}

/// A child of a new node: one of the tree as it was, or else a new node over those `below`.
struct Item {
    child: Child,
    bounds: Aabb,
    below: Vec<Item>,
}

/// A node to be made.
struct Job {
    items: Vec<Item>,
    level: usize,
    /// The slot that refers to it.
    parent: Option<(usize, usize)>,
}

impl Tree {
    /// The trees below these nodes, one behind the other and behind `first` empty nodes.
    pub(crate) fn recollapse(&self, width: Width, first: usize, roots: &[usize]) -> Recollapsed {
        let mut nodes = Nodes::with_capacity(width, first + self.nodes.len());
        nodes.resize(first);
        let mut made = Vec::with_capacity(roots.len());
        for &root in roots {
            let start = nodes.len() as u32;
            let mut depth = 1;
            let mut jobs = vec![Job {
                items: self.items_of(root),
                level: 1,
                parent: None,
            }];
            while let Some(Job {
                mut items,
                level,
                parent,
            }) = jobs.pop()
            {
                self.fit(&mut items, width.lanes());
                depth = depth.max(level);
                let index = nodes.len();
                let mut node = nodes.push_empty();
                for (slot, item) in items.iter().enumerate() {
                    node.set(slot, item.child, &item.bounds);
                }
                if let Some((parent, slot)) = parent {
                    let mut parent = nodes.get_mut(parent);
                    let bounds = parent.any().bounds(slot);
                    parent.set(slot, Child::inner(index), &bounds);
                }
                // What is visited first is made first.
                for (slot, item) in items.into_iter().enumerate().rev() {
                    if let Some(items) = self.open(item) {
                        jobs.push(Job {
                            items,
                            level: level + 1,
                            parent: Some((index, slot)),
                        });
                    }
                }
            }
            made.push((start, depth));
        }
        Recollapsed { nodes, roots: made }
    }

    /// As many items as a node of so many slots can have, and no more.
    fn fit(&self, items: &mut Vec<Item>, width: usize) {
        while items.len() > width {
            let common = |pair: &[Item]| pair[0].bounds.union(&pair[1].bounds).half_area();
            let areas = items.windows(2).map(common).enumerate();
            let smallest = areas
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .map_or(0, |pair| pair.0);
            let pair = [items.remove(smallest), items.remove(smallest)];
            let bounds = pair[0].bounds.union(&pair[1].bounds);
            let sizes = pair.iter().map(|item| item.below.len().max(1));
            let fits = sizes.sum::<usize>() <= width;
            let parts = pair
                .into_iter()
                .flat_map(|item| match fits && !item.below.is_empty() {
                    true => item.below,
                    false => vec![item],
                });
            let merged = Item {
                child: Child::EMPTY,
                bounds,
                below: parts.collect(),
            };
            items.insert(smallest, merged);
        }
        loop {
            let room = width - items.len() + 1;
            let largest = (items.iter().enumerate())
                .filter(|(_, item)| (1..=room).contains(&self.count(item)))
                .max_by(|a, b| a.1.bounds.half_area().total_cmp(&b.1.bounds.half_area()));
            let Some((place, _)) = largest else {
                return;
            };
            let item = items.remove(place);
            let below = self.open(item).unwrap_or_default();
            items.splice(place..place, below);
        }
    }

    /// How many children an item has; 0 for a leaf.
    fn count(&self, item: &Item) -> usize {
        match item.child.kind() {
            _ if !item.below.is_empty() => item.below.len(),
            ChildKind::Inner(index) => self.nodes.get(index).len(),
            _ => 0,
        }
    }

    /// The children of an item; `None` for a leaf.
    fn open(&self, item: Item) -> Option<Vec<Item>> {
        match item.child.kind() {
            _ if !item.below.is_empty() => Some(item.below),
            ChildKind::Inner(index) => Some(self.items_of(index)),
            _ => None,
        }
    }

    fn items_of(&self, node: usize) -> Vec<Item> {
        let children = self.nodes.get(node).children();
        let item = |(child, bounds)| Item {
            child,
            bounds,
            below: Vec::new(),
        };
        children.map(item).collect()
    }
}
