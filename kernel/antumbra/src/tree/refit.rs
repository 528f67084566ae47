//! Refit: leaf blocks and boxes recomputed for primitives that moved, with all nodes, slots and lanes as they are.
//!
//! Leaf blocks first, then nodes from below. Nodes of a subtree follow each other, so large trees are cut into subtrees
//! that threads work on at the same time.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use super::leaves::{first_block, on_each_kind};
use super::node::{Child, ChildKind, Leaf};
use super::nodes::NodesMut;
use super::wide::Tree;
use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::moved::Moved;
use crate::geometry::primitives::PrimKind;
use crate::parallel::for_each;
use crate::tree::costs::CostModel;

/// Blocks that are written at one go.
const BLOCKS: usize = 1024;

/// Subtrees of at most so many nodes are the work of one thread.
const NODES: usize = 2048;

/// Nodes and leaf blocks of one tree among the nodes and blocks of a world.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct TreePlaces {
    pub nodes: Range<usize>,
    /// By [`PrimKind`].
    pub blocks: [Range<usize>; PrimKind::COUNT],
}

impl TreePlaces {
    /// The place of a single leaf: no nodes, and its block.
    pub fn of_leaf(Leaf { kind, index }: Leaf) -> Self {
        let mut places = Self::default();
        places.blocks[kind as usize] = index..index + 1;
        places
    }
}

impl Tree {
    /// Places of everything, but for the block that empty slots refer to.
    pub(crate) fn all_places(&self) -> TreePlaces {
        let lens = self.blocks.lens();
        TreePlaces {
            nodes: 0..self.nodes.len(),
            blocks: core::array::from_fn(|kind| first_block(PrimKind::ALL[kind])..lens[kind]),
        }
    }

    /// Fails unless every primitive of a tree is still there and sound.
    pub(crate) fn check_moved(&self, places: &TreePlaces, moved: &Moved<'_>) -> Result<(), Error> {
        let mut ranges = places.blocks.iter();
        on_each_kind!(self, blocks => if let Some(range) = ranges.next() {
            moved.check(&blocks[range.clone()])?;
        });
        Ok(())
    }

    /// Refits trees at these places, which do not overlap and ascend. What moved has been checked. The bounds of the
    /// whole are left to the caller.
    pub(crate) fn refit(&mut self, trees: &[(TreePlaces, Moved<'_>)]) {
        let mut leaves: Vec<_> = trees
            .iter()
            .map(|(places, _)| LeafBounds::new(places))
            .collect();
        on_each_kind!(mut self, blocks => refill(blocks, trees, &mut leaves));
        let mut nodes = Pieces::new(self.nodes.as_mut());
        let jobs = leaves.iter().map(|leaves| Job {
            nodes: nodes.take(&leaves.places.nodes),
            leaves,
        });
        for_each(jobs.collect(), Job::run);
    }

    /// Cost of a random line through the box of a tree at these places, which has no instances.
    pub(crate) fn sah_at(&self, places: &TreePlaces) -> f64 {
        let bounds = self.nodes.get(places.nodes.start).all_bounds();
        self.sah_of(places.nodes.clone(), &bounds, &CostModel::default(), &[])
    }
}

/// A slice of which pieces are taken, one behind the other.
struct Pieces<T> {
    rest: Option<T>,
    taken: usize,
}

impl<T: SplitAt> Pieces<T> {
    fn new(all: T) -> Self {
        Self {
            rest: Some(all),
            taken: 0,
        }
    }

    /// The next piece, which begins at or after the end of the last one.
    fn take(&mut self, range: &Range<usize>) -> T {
        let rest = self.rest.take().expect("put back below");
        let (_, rest) = rest.split(range.start - self.taken);
        let (piece, rest) = rest.split(range.len());
        self.rest = Some(rest);
        self.taken = range.end;
        piece
    }
}

/// What pieces are taken of.
trait SplitAt: Sized {
    fn split(self, middle: usize) -> (Self, Self);
}

impl<T> SplitAt for &mut [T] {
    fn split(self, middle: usize) -> (Self, Self) {
        self.split_at_mut(middle)
    }
}

impl SplitAt for NodesMut<'_> {
    fn split(self, middle: usize) -> (Self, Self) {
        self.split_at(middle)
    }
}

/// A tree whose leaf blocks are refitted.
struct Job<'a> {
    nodes: NodesMut<'a>,
    leaves: &'a LeafBounds<'a>,
}

impl Job<'_> {
    fn run(mut self) {
        let first = self.leaves.places.nodes.start;
        let mut subtrees = Vec::new();
        let mut above = Vec::new();
        cut(&self.nodes, first, &mut subtrees, &mut above);
        let mut pieces = Pieces::new(self.nodes.reborrow());
        let jobs = subtrees
            .into_iter()
            .map(|range| (first + range.start, pieces.take(&range)));
        for_each(jobs.collect(), |(first, mut nodes): (_, NodesMut<'_>)| {
            for node in (0..nodes.len()).rev() {
                refit_node(&mut nodes, first, node, self.leaves);
            }
        });
        for node in above.into_iter().rev() {
            refit_node(&mut self.nodes, first, node, self.leaves);
        }
    }
}

/// Writes the blocks of one kind of several trees again, and the boxes around them.
fn refill<B: LeafBlock>(
    blocks: &mut [B],
    trees: &[(TreePlaces, Moved<'_>)],
    leaves: &mut [LeafBounds<'_>],
) {
    let mut pieces = Pieces::new(blocks);
    let mut jobs = Vec::new();
    for ((places, moved), leaves) in trees.iter().zip(leaves) {
        let range = &places.blocks[B::KIND as usize];
        let bounds = &mut leaves.blocks[B::KIND as usize];
        *bounds = vec![Aabb::EMPTY; range.len()];
        let blocks = pieces.take(range).chunks_mut(BLOCKS);
        jobs.extend(
            blocks
                .zip(bounds.chunks_mut(BLOCKS))
                .map(|job| (job, moved)),
        );
    }
    for_each(jobs, |((blocks, bounds), moved)| {
        for (block, bounds) in blocks.iter_mut().zip(bounds) {
            *bounds = block.refill(moved);
        }
    });
}

/// Boxes around the leaf blocks of a tree.
struct LeafBounds<'a> {
    places: &'a TreePlaces,
    /// By [`PrimKind`].
    blocks: [Vec<Aabb>; PrimKind::COUNT],
}

impl<'a> LeafBounds<'a> {
    fn new(places: &'a TreePlaces) -> Self {
        Self {
            places,
            blocks: Default::default(),
        }
    }

    fn of(&self, Leaf { kind, index }: Leaf) -> Aabb {
        let kind = kind as usize;
        self.blocks[kind][index - self.places.blocks[kind].start]
    }
}

/// Recomputes the boxes of a node. The boxes of its children are already new. `first` is the place of the first of
/// `nodes` in the tree.
fn refit_node(nodes: &mut NodesMut<'_>, first: usize, node: usize, leaves: &LeafBounds<'_>) {
    for slot in 0..nodes.get(node).len() {
        let child = nodes.get(node).child(slot);
        let bounds = match child.kind() {
            ChildKind::Inner(index) => nodes.get(index - first).all_bounds(),
            ChildKind::Leaf(leaf) => leaves.of(leaf),
            // Trees with instances are not refitted.
            ChildKind::Instance(_) => nodes.get(node).bounds(slot),
        };
        nodes.get_mut(node).set(slot, child, &bounds);
    }
}

/// Cuts a tree, or what is left of one that was taken apart, into subtrees that are small enough, and the nodes above
/// them, both in ascending order. Indices count from the first of `nodes`, which is at `first` in the tree.
fn cut(
    nodes: &NodesMut<'_>,
    first: usize,
    subtrees: &mut Vec<Range<usize>>,
    above: &mut Vec<usize>,
) {
    // Only a tree from elsewhere may have another order of nodes; one thread then refits it all.
    let (roots, most) = match roots_of(nodes, first) {
        Some(roots) => (roots, NODES),
        None => (vec![0], nodes.len()),
    };
    // Subtrees to be looked at, the first one last.
    let mut open = up_to(roots, nodes.len());
    while let Some(range) = open.pop() {
        if range.len() <= most {
            subtrees.push(range);
            continue;
        }
        above.push(range.start);
        let children = nodes.get(range.start).children();
        let mut starts: Vec<_> = children
            .filter_map(|(child, _)| inner(child))
            .map(|index| index - first)
            .collect();
        starts.sort_unstable();
        open.extend(up_to(starts, range.end));
    }
}

/// Ranges from each start to the next, and from the last one to the end; the first one last.
fn up_to(starts: Vec<usize>, end: usize) -> Vec<Range<usize>> {
    let ends = starts.iter().skip(1).copied().chain([end]);
    let mut ranges: Vec<_> = starts.iter().copied().zip(ends).collect();
    ranges.reverse();
    ranges.into_iter().map(|(start, end)| start..end).collect()
}

/// The nodes that no other refers to, if the nodes of every subtree follow each other.
fn roots_of(nodes: &NodesMut<'_>, first: usize) -> Option<Vec<usize>> {
    // Per node, how many nodes are in its subtree, and behind the last of them.
    let mut sizes = vec![(1, 0); nodes.len()];
    let mut is_root = vec![true; nodes.len()];
    let stand_together = (0..nodes.len()).rev().all(|node| {
        let (mut count, mut end) = (1, node + 1);
        for child in nodes
            .get(node)
            .children()
            .filter_map(|(child, _)| inner(child))
        {
            let (below, last) = sizes[child - first];
            is_root[child - first] = false;
            count += below;
            end = end.max(last);
        }
        sizes[node] = (count, end);
        end - node == count
    });
    let roots = (0..nodes.len()).filter(|node| is_root[*node]).collect();
    stand_together.then_some(roots)
}

fn inner(child: Child) -> Option<usize> {
    match child.kind() {
        ChildKind::Inner(index) => Some(index),
        _ => None,
    }
}
