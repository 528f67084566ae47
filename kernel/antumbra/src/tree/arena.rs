//! A tree put together from trees that are built already, for a world whose top level changes.
//!
//! | places of nodes | what |
//! |---|---|
//! | from 0 | the top level, made again whenever an instance moves |
//! | behind it | empty nodes: room for a larger top level |
//! | behind them | subtrees of the ground, the tree of what lies in the world itself |
//! | behind them | the trees of objects |
//!
//! Objects are copied once, when they join. Their inner references are then indices among all nodes.

use alloc::sync::Arc;
use core::ops::Range;

use antumbra_simd::memory::vec_in_huge_pages;

use super::leaves::{LeafBlocks, first_block};
use super::node::{Child, ChildKind, Leaf};
use super::nodes::Nodes;
use super::refit::TreePlaces;
use super::wide::{PlacedTree, Tree};
use super::width::Width;
use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::cutout::join::Joined;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;
use crate::geometry::primitives::kinds::for_each_kind;
use crate::geometry::triangle::TriangleBlock;

/// A wide tree with trees in it that were built before.
impl Tree {
    /// A tree over nothing with memory for all of these, which have its width.
    pub(crate) fn with_room_for(width: Width, trees: &[&Self]) -> Self {
        let sum =
            |count: fn(&Self) -> usize| -> usize { trees.iter().map(|tree| count(tree)).sum() };
        let nodes = Nodes::with_capacity(width, 1 + sum(|tree| tree.nodes.len()));
        let mut blocks = LeafBlocks::default();
        macro_rules! make_room {
            ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
                $(blocks.$list = vec_in_huge_pages(1 + sum(|tree| tree.blocks.$list.len()));)*
            };
        }
        for_each_kind!([make_room]);
        blocks.triangles.push(TriangleBlock::EMPTY);
        Self::over_nothing(nodes, blocks)
    }

    /// Copies a tree without instances behind all others, and returns its place. Its filters belong to this object, or
    /// to the ground. The caller adds its root to the roots of objects.
    ///
    /// # Errors
    /// Another width; more nodes or leaves than references can name. Nothing has changed then.
    pub(crate) fn join(&mut self, tree: &Self, object: Option<u32>) -> Result<TreePlaces, Error> {
        if self.width() != tree.width() {
            return Err(Error::OtherWidth {
                expected: self.width().lanes(),
                found: tree.width().lanes(),
            });
        }
        let places = self.places_of(tree)?;
        let relocated = |child: Child| match child.kind() {
            ChildKind::Inner(index) => Child::inner(places.nodes.start + index),
            ChildKind::Leaf(Leaf { kind, index }) => Child::leaf(Leaf {
                kind,
                index: places.blocks[kind as usize].start + index - first_block(kind),
            }),
            ChildKind::Instance(_) => unreachable!("objects have no instances"),
        };
        self.nodes.extend_from(&tree.nodes);
        for index in places.nodes.clone() {
            self.nodes.get_mut(index).relocate(relocated);
        }
        let mut joined = Joined::default();
        if !tree.filters.opacities.is_empty() {
            joined = match Arc::get_mut(&mut self.filters) {
                Some(filters) => filters.join(&tree.filters, object),
                // Somebody else's, of a clone of this tree.
                None => {
                    let mut filters = (*self.filters).clone();
                    let joined = filters.join(&tree.filters, object);
                    self.filters = Arc::new(filters);
                    joined
                }
            };
        }
        macro_rules! join {
            ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
                $(
                    let blocks = &tree.blocks.$list[first_block(PrimKind::$Kind)..];
                    let blocks = blocks.iter().map(|block| block.joined(joined));
                    self.blocks.$list.extend(blocks);
                )*
            };
        }
        for_each_kind!([join]);
        Ok(places)
    }

    /// Places that the nodes and blocks of a tree will have when it joins.
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
        let place = |own: &Range<usize>, other: &Range<usize>| own.end..own.end + other.len();
        let places = TreePlaces {
            nodes: place(&own.nodes, &other.nodes),
            blocks: core::array::from_fn(|kind| place(&own.blocks[kind], &other.blocks[kind])),
        };
        limit("nodes", places.nodes.end, Child::MAX_NODES)?;
        for (&kind, blocks) in PrimKind::ALL.iter().zip(&places.blocks) {
            limit("leaves", blocks.end, Child::capacity(kind))?;
        }
        Ok(places)
    }

    /// Moves all nodes from `first` on back by so many places, and puts empty ones in between. References from nodes
    /// before `first` stay as they are.
    pub(crate) fn make_room(&mut self, first: usize, by: usize) {
        self.nodes.make_room(first, by);
        for index in first + by..self.nodes.len() {
            self.nodes
                .get_mut(index)
                .relocate(|child| match child.kind() {
                    ChildKind::Inner(index) => Child::inner(index + by),
                    _ => child,
                });
        }
        for root in &mut self.roots {
            *root += by as u32;
        }
    }

    /// Writes the top level: its nodes, of which there were `before` and for which there is room, and what its instances
    /// refer to.
    pub(crate) fn set_top(
        &mut self,
        nodes: &Nodes,
        before: usize,
        instances: impl Iterator<Item = PlacedTree>,
    ) {
        for (index, node) in nodes.iter().enumerate() {
            self.nodes.get_mut(index).copy(node);
        }
        for index in nodes.len()..before {
            self.nodes.clear(index);
        }
        self.instances.clear();
        self.instances.extend(instances);
    }

    /// The boxes around all primitives of a tree at these places.
    pub(crate) fn prim_bounds(&self, places: &TreePlaces) -> impl Iterator<Item = Aabb> {
        macro_rules! chain {
            ($(($Kind:ident, $list:ident, $Type:ty, $first:literal))*) => {
                core::iter::empty()$(.chain(prim_bounds(
                    &self.blocks.$list[places.blocks[PrimKind::$Kind as usize].clone()],
                )))*
            };
        }
        for_each_kind!([chain])
    }
}

/// The boxes around all primitives of some blocks.
fn prim_bounds<B: LeafBlock>(blocks: &[B]) -> impl Iterator<Item = Aabb> {
    let lanes = |block: &B| 0..block.count();
    blocks
        .iter()
        .flat_map(move |block| lanes(block).map(|lane| block.bounds(lane)))
}
