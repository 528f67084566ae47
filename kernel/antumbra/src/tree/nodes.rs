//! The nodes of a tree, whatever its width: a list for code that is compiled once.

use alloc::vec::Vec;
use core::any::Any;

use antumbra_simd::memory::vec_in_huge_pages;

use super::node::{Node, NodeMut, NodeRef};
use super::width::Width;

/// Nodes of one width.
#[derive(Clone, Debug)]
pub(crate) enum Nodes {
    W4(Vec<Node<4>>),
    W8(Vec<Node<8>>),
    W16(Vec<Node<16>>),
}

/// Some of the nodes of a tree, to be written. Parts of a tree can be written by several threads.
pub(crate) enum NodesMut<'a> {
    W4(&'a mut [Node<4>]),
    W8(&'a mut [Node<8>]),
    W16(&'a mut [Node<16>]),
}

/// Runs the same code on nodes of whichever width they are.
macro_rules! on_nodes {
    ($List:ident, $any:expr, $nodes:ident => $body:expr) => {
        match $any {
            $List::W4($nodes) => $body,
            $List::W8($nodes) => $body,
            $List::W16($nodes) => $body,
        }
    };
}

impl Nodes {
    /// No nodes yet, with memory for this many.
    pub fn with_capacity(width: Width, count: usize) -> Self {
        match width {
            Width::W4 => Self::W4(vec_in_huge_pages(count)),
            Width::W8 => Self::W8(vec_in_huge_pages(count)),
            Width::W16 => Self::W16(vec_in_huge_pages(count)),
        }
    }

    pub fn width(&self) -> Width {
        match self {
            Self::W4(_) => Width::W4,
            Self::W8(_) => Width::W8,
            Self::W16(_) => Width::W16,
        }
    }

    /// All nodes, if that is their width; otherwise none.
    #[inline(always)]
    pub fn of_width<const N: usize>(&self) -> &[Node<N>] {
        let nodes = on_nodes!(Self, self, nodes => (nodes as &dyn Any).downcast_ref());
        nodes.map_or(&[], |nodes: &Vec<Node<N>>| nodes)
    }

    pub fn len(&self) -> usize {
        on_nodes!(Self, self, nodes => nodes.len())
    }

    pub fn bytes(&self) -> usize {
        on_nodes!(Self, self, nodes => size_of_val(&nodes[..]))
    }

    #[inline]
    pub fn get(&self, index: usize) -> NodeRef<'_> {
        on_nodes!(Self, self, nodes => nodes[index].any())
    }

    #[inline]
    pub fn get_mut(&mut self, index: usize) -> NodeMut<'_> {
        on_nodes!(Self, self, nodes => nodes[index].any_mut())
    }

    /// All nodes, children behind their parents.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = NodeRef<'_>> + ExactSizeIterator {
        (0..self.len()).map(|index| self.get(index))
    }

    /// Appends a node without children.
    pub fn push_empty(&mut self) -> NodeMut<'_> {
        let index = self.len();
        self.resize(index + 1);
        self.get_mut(index)
    }

    /// Appends nodes without children, or drops the last ones, until there are `count`.
    pub fn resize(&mut self, count: usize) {
        on_nodes!(Self, self, nodes => nodes.resize(count, Node::EMPTY));
    }

    /// Appends copies of nodes of the same width.
    pub fn extend_from(&mut self, other: &Self) {
        match (self, other) {
            (Self::W4(nodes), Self::W4(other)) => nodes.extend_from_slice(other),
            (Self::W8(nodes), Self::W8(other)) => nodes.extend_from_slice(other),
            (Self::W16(nodes), Self::W16(other)) => nodes.extend_from_slice(other),
            _ => unreachable!("nodes of one width"),
        }
    }

    /// Moves all nodes from `first` on back by so many places, and puts nodes without children in between.
    pub fn make_room(&mut self, first: usize, by: usize) {
        on_nodes!(Self, self, nodes => {
            let mut roomy = vec_in_huge_pages(nodes.len() + by);
            roomy.extend_from_slice(&nodes[..first]);
            roomy.resize(first + by, Node::EMPTY);
            roomy.extend_from_slice(&nodes[first..]);
            *nodes = roomy;
        });
    }

    /// Takes the children of a node away.
    pub fn clear(&mut self, index: usize) {
        on_nodes!(Self, self, nodes => nodes[index] = Node::EMPTY);
    }

    pub fn as_mut(&mut self) -> NodesMut<'_> {
        match self {
            Self::W4(nodes) => NodesMut::W4(nodes),
            Self::W8(nodes) => NodesMut::W8(nodes),
            Self::W16(nodes) => NodesMut::W16(nodes),
        }
    }
}

impl<'a> NodesMut<'a> {
    pub fn len(&self) -> usize {
        on_nodes!(Self, self, nodes => nodes.len())
    }

    #[inline]
    pub fn get(&self, index: usize) -> NodeRef<'_> {
        on_nodes!(Self, self, nodes => nodes[index].any())
    }

    #[inline]
    pub fn get_mut(&mut self, index: usize) -> NodeMut<'_> {
        on_nodes!(Self, self, nodes => nodes[index].any_mut())
    }

    /// The nodes before `middle`, and those from there on.
    pub fn split_at(self, middle: usize) -> (Self, Self) {
        macro_rules! split {
            ($Width:ident, $nodes:ident) => {{
                let (first, second) = $nodes.split_at_mut(middle);
                (Self::$Width(first), Self::$Width(second))
            }};
        }
        match self {
            Self::W4(nodes) => split!(W4, nodes),
            Self::W8(nodes) => split!(W8, nodes),
            Self::W16(nodes) => split!(W16, nodes),
        }
    }

    /// The same nodes, for a while.
    pub fn reborrow(&mut self) -> NodesMut<'_> {
        match self {
            Self::W4(nodes) => NodesMut::W4(nodes),
            Self::W8(nodes) => NodesMut::W8(nodes),
            Self::W16(nodes) => NodesMut::W16(nodes),
        }
    }
}
