//! A tree put together from trees that are built already, for a world whose top level changes.
//!
//! | places of nodes | what |
//! |---|---|
//! | from 0 | the top level, made anew whenever an instance moves |
//! | behind it | empty nodes: room for a larger top level |
//! | behind them | subtrees of the ground, the tree of what lies in the world itself |
//! | behind them | the trees of objects |
//!
//! Objects are copied once, when they join. Their inner references are then indices among all nodes.

use alloc::sync::Arc;
use alloc::vec::Vec;

use antumbra_simd::memory::vec_in_huge_pages;

use super::node::{Child, ChildKind, Leaf, Node};
use super::refit::TreePlaces;
use super::rule::Rule;
use super::wide::{PlacedTree, WideTree};
use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;
use crate::geometry::triangle::TriangleBlock;

/// A wide tree with trees in it that were built before.
impl<const N: usize> WideTree<N> {
    /// A tree over nothing with memory for all of these.
    pub fn with_room_for(trees: &[&Self]) -> Self {
        let sum = |count: fn(&Self) -> usize| trees.iter().map(|tree| count(tree)).sum();
        let mut nodes = vec_in_huge_pages(1 + sum(|tree| tree.nodes.len()));
        nodes.push(Node::EMPTY);
        let mut triangle_blocks = vec_in_huge_pages(1 + sum(|tree| tree.triangle_blocks.len()));
        triangle_blocks.push(TriangleBlock::EMPTY);
        Self {
            nodes,
            triangle_blocks,
            sphere_blocks: Vec::with_capacity(sum(|tree| tree.sphere_blocks.len())),
            cutout_blocks: vec_in_huge_pages(sum(|tree| tree.cutout_blocks.len())),
            user_blocks: Vec::with_capacity(sum(|tree| tree.user_blocks.len())),
            filters: Arc::default(),
            instances: Vec::new(),
            roots: Vec::new(),
            bounds: Aabb::EMPTY,
            reach: 0.0,
            depth: 1,
            pick: Rule::Slots,
        }
    }

    /// Copies a tree without instances behind all others, and tells where it is. Whether it is an object is left to the
    /// caller.
    ///
    /// # Errors
    /// More nodes or leaves than references can name; nothing has changed then.
    pub fn join(&mut self, tree: &Self) -> Result<TreePlaces, Error> {
        let places = self.places_of(tree)?;
        // Triangle block 0 is what empty slots refer to, in every tree.
        let triangle = places.triangles.start - 1;
        let relocated = |child: Child| match child.kind() {
            _ if child == Child::EMPTY => child,
            ChildKind::Inner(index) => Child::inner(places.nodes.start + index),
            ChildKind::Leaf(leaf) => Child::leaf(match leaf {
                Leaf::Triangles(index) => Leaf::Triangles(triangle + index),
                Leaf::Spheres(index) => Leaf::Spheres(places.spheres.start + index),
                Leaf::Cutouts(index) => Leaf::Cutouts(places.cutouts.start + index),
                Leaf::Users(index) => Leaf::Users(places.users.start + index),
            }),
            ChildKind::Instance(_) => unreachable!("objects have no instances"),
        };
        self.nodes
            .extend(tree.nodes.iter().map(|node| node.relocated(relocated)));
        self.triangle_blocks
            .extend_from_slice(&tree.triangle_blocks[1..]);
        self.sphere_blocks.extend_from_slice(&tree.sphere_blocks);
        self.user_blocks.extend_from_slice(&tree.user_blocks);
        if !tree.cutout_blocks.is_empty() {
            let joined = match Arc::get_mut(&mut self.filters) {
                Some(filters) => filters.join(&tree.filters),
                // Somebody else's, of a clone of this tree.
                None => {
                    let mut filters = (*self.filters).clone();
                    let joined = filters.join(&tree.filters);
                    self.filters = Arc::new(filters);
                    joined
                }
            };
            let blocks = tree.cutout_blocks.iter();
            self.cutout_blocks
                .extend(blocks.map(|block| block.joined(joined)));
        }
        Ok(places)
    }

    /// Where a tree will be that joins.
    fn places_of(&self, tree: &Self) -> Result<TreePlaces, Error> {
        let limit = |what, found, limit| {
            if found > limit {
                Err(Error::TooMany { what, found, limit })
            } else {
                Ok(())
            }
        };
        let own = self.all_places();
        let other = tree.all_places();
        let place = |own: usize, other: usize| own..own + other;
        let places = TreePlaces {
            nodes: place(own.nodes.end, other.nodes.end),
            triangles: place(own.triangles.end, other.triangles.end - 1),
            spheres: place(own.spheres.end, other.spheres.end),
            cutouts: place(own.cutouts.end, other.cutouts.end),
            users: place(own.users.end, other.users.end),
        };
        limit("nodes", places.nodes.end, Child::MAX_NODES)?;
        for (kind, end) in [
            (PrimKind::Triangle, places.triangles.end),
            (PrimKind::Sphere, places.spheres.end),
            (PrimKind::Cutout, places.cutouts.end),
            (PrimKind::User, places.users.end),
        ] {
            limit("leaves", end, Child::capacity(kind))?;
        }
        Ok(places)
    }

    /// Moves all nodes from `first` on back by so many places, and puts empty ones in between. References from nodes
    /// before `first` stay as they are.
    pub fn make_room(&mut self, first: usize, by: usize) {
        let mut nodes = vec_in_huge_pages(self.nodes.len() + by);
        nodes.extend_from_slice(&self.nodes[..first]);
        nodes.resize(first + by, Node::EMPTY);
        let relocated = |child: Child| match child.kind() {
            ChildKind::Inner(index) => Child::inner(index + by),
            _ => child,
        };
        nodes.extend(
            self.nodes[first..]
                .iter()
                .map(|node| node.relocated(relocated)),
        );
        self.nodes = nodes;
        for root in &mut self.roots {
            *root += by as u32;
        }
    }

    /// Writes the top level: its nodes, of which there were `before` and for which there is room, and what its instances
    /// refer to.
    pub fn set_top(
        &mut self,
        nodes: &[Node<N>],
        before: usize,
        instances: impl Iterator<Item = PlacedTree>,
    ) {
        self.nodes[..nodes.len()].clone_from_slice(nodes);
        for node in &mut self.nodes[nodes.len()..before.max(nodes.len())] {
            *node = Node::EMPTY;
        }
        self.instances.clear();
        self.instances.extend(instances);
    }

    /// The boxes around all primitives of a tree at these places.
    pub fn prim_bounds(&self, places: &TreePlaces) -> impl Iterator<Item = Aabb> {
        let triangles = prim_bounds(&self.triangle_blocks[places.triangles.clone()]);
        let spheres = prim_bounds(&self.sphere_blocks[places.spheres.clone()]);
        let cutouts = prim_bounds(&self.cutout_blocks[places.cutouts.clone()]);
        let users = prim_bounds(&self.user_blocks[places.users.clone()]);
        triangles.chain(spheres).chain(cutouts).chain(users)
    }
}

/// The boxes around all primitives of some blocks.
fn prim_bounds<B: LeafBlock>(blocks: &[B]) -> impl Iterator<Item = Aabb> {
    let lanes = |block: &B| 0..block.count();
    blocks
        .iter()
        .flat_map(move |block| lanes(block).map(|lane| block.bounds(lane)))
}

impl<const N: usize> Node<N> {
    /// The same boxes with other references. Empty slots stay empty.
    fn relocated(&self, relocated: impl Fn(Child) -> Child) -> Self {
        Self {
            planes: self.planes,
            children: self.children.map(|child| relocated(Child(child)).0),
        }
    }
}
