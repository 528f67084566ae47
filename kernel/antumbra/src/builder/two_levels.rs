//! The tree of a world with instances: one leaf per instance, among the subtrees over what lies in the world
//! itself.
//!
//! The primitives of the world have a tree already, from any builder. The tree is taken apart into about as many
//! subtrees as there are instances. Those and the instances are put together by the surface area heuristic, in which an
//! instance weighs as much as entering it and the tree of its object do.

use alloc::vec;
use alloc::vec::Vec;

use crate::aabb::Aabb;
use crate::builder::binned_sah::Part;
use crate::builder::binned_sah::items::Items;
use crate::builder::cost::{ItemWeights, instance_weight};
use crate::builder::subtrees::take_apart;
use crate::geometry::BLOCK;
use crate::geometry::primitives::Primitives;
use crate::tree::binary::{BinaryKind, BinaryNode, BinaryTree};

/// The world is taken apart into at least this many subtrees.
const MIN_SUBTREES: usize = 64;

/// Puts the instances into a tree over the primitives of the world, which may be empty. There are instances.
pub(crate) fn with_instances(world: &BinaryTree, primitives: &Primitives) -> BinaryTree {
    let mut items = Vec::new();
    let mut weights = Vec::new();
    if let Some(root) = world.nodes.first() {
        let with_bounds = |node: usize| (node, world.nodes[node].bounds);
        let children = |node: usize| Some(world.children(node)?.map(with_bounds));
        let prims = prims_below(world);
        let count = primitives.instances.len().max(MIN_SUBTREES);
        for (node, bounds) in take_apart((0, root.bounds), count, children) {
            items.push((bounds, ItemKind::Subtree(node)));
            weights.push(prims[node].div_ceil(BLOCK as u32) as f32);
        }
    }
    let objects = primitives.objects.iter();
    let of_objects: Vec<_> = objects
        .map(|object| instance_weight(object.len()))
        .collect();
    for (placed, index) in primitives.instances.iter().zip(primitives.len() as u32..) {
        items.push((placed.placement.bounds(), ItemKind::Instance(index)));
        weights.push(of_objects[placed.object as usize]);
    }
    let weights = ItemWeights(weights);
    let mut parts = Items::new(items.iter().map(|item| item.0), &weights);
    let root = parts.all();
    let mut build = Build {
        world,
        items: &items,
        tree: BinaryTree::default(),
    };
    build.subtree(&mut parts, &root);
    build.tree
}

/// What is put together with others.
#[derive(Clone, Copy)]
enum ItemKind {
    /// A node of the world's tree with all that is below.
    Subtree(usize),
    /// Index of an instance, as `Primitives::bounds_of` counts them.
    Instance(u32),
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
    items: &'a [(Aabb, ItemKind)],
    tree: BinaryTree,
}

impl Build<'_> {
    /// Appends the subtree over a part of the items, of which there are some.
    fn subtree(&mut self, parts: &mut Items<'_>, part: &Part) {
        if let Some(item) = parts.only(part) {
            return self.item(item);
        }
        let index = self.tree.nodes.len();
        self.tree.nodes.push(BinaryNode {
            bounds: part.bounds(),
            kind: BinaryKind::Inner { right: 0 },
        });
        let [left, right] = parts.halves(part);
        self.subtree(parts, &left);
        self.tree.nodes[index].kind = BinaryKind::Inner {
            right: (self.tree.nodes.len() - index) as u32,
        };
        self.subtree(parts, &right);
    }

    /// Appends one item.
    fn item(&mut self, item: usize) {
        let (nodes, prims) = (&mut self.tree.nodes, &mut self.tree.prims);
        let (bounds, kind) = self.items[item];
        match kind {
            ItemKind::Instance(index) => {
                nodes.push(BinaryNode {
                    bounds,
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
