//! Refit: leaf blocks and boxes made anew for primitives that moved, with all nodes, slots and lanes as they are.
//!
//! Leaf blocks first, then nodes from below. Nodes of a subtree stand together, so large trees are cut into subtrees that
//! threads work on at the same time.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use super::node::{Child, ChildKind, Leaf, Node};
use super::wide::WideTree;
use crate::aabb::Aabb;
use crate::error::Error;
use crate::geometry::cutout::CutoutBlock;
use crate::geometry::moved::{Moved, Refill};
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::user::UserBlock;
use crate::parallel::for_each;
use crate::tree::costs::CostModel;

/// Blocks that are written at one go.
const BLOCKS: usize = 1024;

/// Subtrees of at most so many nodes are the work of one thread.
const NODES: usize = 2048;

/// Nodes and leaf blocks of one tree among those of a world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TreePlaces {
    pub nodes: Range<usize>,
    pub triangles: Range<usize>,
    pub spheres: Range<usize>,
    pub cutouts: Range<usize>,
    pub users: Range<usize>,
}

impl<const N: usize> WideTree<N> {
    /// Places of everything, but for the block that empty slots refer to.
    pub fn all_places(&self) -> TreePlaces {
        TreePlaces {
            nodes: 0..self.nodes.len(),
            triangles: 1..self.triangle_blocks.len(),
            spheres: 0..self.sphere_blocks.len(),
            cutouts: 0..self.cutout_blocks.len(),
            users: 0..self.user_blocks.len(),
        }
    }

    /// Fails unless every primitive of a tree is still there and sound.
    pub fn check_moved(&self, places: &TreePlaces, moved: &Moved<'_>) -> Result<(), Error> {
        moved.check(&self.triangle_blocks[places.triangles.clone()])?;
        moved.check(&self.sphere_blocks[places.spheres.clone()])?;
        moved.check(&self.cutout_blocks[places.cutouts.clone()])?;
        moved.check(&self.user_blocks[places.users.clone()])
    }

    /// Refits trees at these places, which do not overlap and ascend. What moved has been checked. The bounds of the
    /// whole are left to the caller.
    pub fn refit(&mut self, trees: &[(TreePlaces, Moved<'_>)]) {
        let mut nodes = Pieces::new(&mut self.nodes);
        let mut triangles = Pieces::new(&mut self.triangle_blocks);
        let mut spheres = Pieces::new(&mut self.sphere_blocks);
        let mut cutouts = Pieces::new(&mut self.cutout_blocks);
        let mut users = Pieces::new(&mut self.user_blocks);
        let jobs = trees.iter().map(|(places, moved)| Job {
            nodes: nodes.take(&places.nodes),
            triangles: triangles.take(&places.triangles),
            spheres: spheres.take(&places.spheres),
            cutouts: cutouts.take(&places.cutouts),
            users: users.take(&places.users),
            places,
            moved,
        });
        for_each(jobs.collect(), Job::run);
    }

    /// Cost of a random line through the box of a tree at these places, which has no instances.
    pub fn sah_at(&self, places: &TreePlaces) -> f64 {
        let bounds = self.nodes[places.nodes.start].all_bounds();
        self.sah_of(places.nodes.clone(), &bounds, &CostModel::default(), &[])
    }
}

/// A slice of which pieces are taken, one behind the other.
struct Pieces<'a, T> {
    rest: &'a mut [T],
    taken: usize,
}

impl<'a, T> Pieces<'a, T> {
    fn new(all: &'a mut [T]) -> Self {
        Self {
            rest: all,
            taken: 0,
        }
    }

    /// The next piece, which begins at or after the end of the last one.
    fn take(&mut self, range: &Range<usize>) -> &'a mut [T] {
        let rest = core::mem::take(&mut self.rest);
        let (_, rest) = rest.split_at_mut(range.start - self.taken);
        let (piece, rest) = rest.split_at_mut(range.len());
        self.rest = rest;
        self.taken = range.end;
        piece
    }
}

/// A tree that is refitted.
struct Job<'a, const N: usize> {
    nodes: &'a mut [Node<N>],
    triangles: &'a mut [TriangleBlock],
    spheres: &'a mut [SphereBlock],
    cutouts: &'a mut [CutoutBlock],
    users: &'a mut [UserBlock],
    places: &'a TreePlaces,
    moved: &'a Moved<'a>,
}

impl<const N: usize> Job<'_, N> {
    fn run(self) {
        let leaves = LeafBounds {
            places: self.places,
            triangles: refill(self.triangles, self.moved),
            spheres: refill(self.spheres, self.moved),
            cutouts: refill(self.cutouts, self.moved),
            users: refill(self.users, self.moved),
        };
        let mut subtrees = Vec::new();
        let mut above = Vec::new();
        cut(
            self.nodes,
            self.places.nodes.start,
            &mut subtrees,
            &mut above,
        );
        let mut pieces = Pieces::new(&mut *self.nodes);
        let jobs = subtrees.into_iter().map(|range| {
            let first = self.places.nodes.start + range.start;
            (first, pieces.take(&range))
        });
        for_each(jobs.collect(), |(first, nodes)| {
            for node in (0..nodes.len()).rev() {
                refit_node(nodes, first, node, &leaves);
            }
        });
        for node in above.into_iter().rev() {
            refit_node(self.nodes, self.places.nodes.start, node, &leaves);
        }
    }
}

/// Writes all blocks anew and returns the boxes around them.
fn refill<B: Refill>(blocks: &mut [B], moved: &Moved<'_>) -> Vec<Aabb> {
    let mut bounds = vec![Aabb::EMPTY; blocks.len()];
    let jobs = blocks.chunks_mut(BLOCKS).zip(bounds.chunks_mut(BLOCKS));
    for_each(jobs.collect(), |(blocks, bounds)| {
        for (block, bounds) in blocks.iter_mut().zip(bounds) {
            *bounds = block.refill(moved);
        }
    });
    bounds
}

/// Boxes around the leaf blocks of a tree.
struct LeafBounds<'a> {
    places: &'a TreePlaces,
    triangles: Vec<Aabb>,
    spheres: Vec<Aabb>,
    cutouts: Vec<Aabb>,
    users: Vec<Aabb>,
}

impl LeafBounds<'_> {
    fn of(&self, leaf: Leaf) -> Aabb {
        match leaf {
            Leaf::Triangles(index) => self.triangles[index - self.places.triangles.start],
            Leaf::Spheres(index) => self.spheres[index - self.places.spheres.start],
            Leaf::Cutouts(index) => self.cutouts[index - self.places.cutouts.start],
            Leaf::Users(index) => self.users[index - self.places.users.start],
        }
    }
}

/// Makes the boxes of a node anew. Those of its children are. `first` is the place of the first of `nodes` in the tree.
fn refit_node<const N: usize>(
    nodes: &mut [Node<N>],
    first: usize,
    node: usize,
    leaves: &LeafBounds<'_>,
) {
    for slot in 0..nodes[node].len() {
        let child = nodes[node].child(slot);
        let bounds = match child.kind() {
            ChildKind::Inner(index) => nodes[index - first].all_bounds(),
            ChildKind::Leaf(leaf) => leaves.of(leaf),
            // Trees with instances are not refitted.
            ChildKind::Instance(_) => nodes[node].bounds(slot),
        };
        nodes[node].set(slot, child, &bounds);
    }
}

/// Cuts a tree into subtrees that are small enough, and the nodes above them, both in ascending order. Indices count from
/// the first of `nodes`, which stands at `first` in the tree.
fn cut<const N: usize>(
    nodes: &[Node<N>],
    first: usize,
    subtrees: &mut Vec<Range<usize>>,
    above: &mut Vec<usize>,
) {
    // Only a tree from elsewhere may have another order of nodes; one thread then refits it all.
    let most = if stand_together(nodes, first) {
        NODES
    } else {
        nodes.len()
    };
    // Subtrees to be looked at, the first one last.
    let whole = 0..nodes.len();
    let mut open = vec![whole];
    while let Some(range) = open.pop() {
        if range.len() <= most {
            subtrees.push(range);
            continue;
        }
        above.push(range.start);
        let mut starts: Vec<_> = (0..N)
            .filter_map(|slot| inner(nodes[range.start].child(slot)))
            .map(|index| index - first)
            .collect();
        starts.sort_unstable();
        let ends = starts.iter().skip(1).copied().chain([range.end]);
        let children: Vec<_> = starts.iter().copied().zip(ends).collect();
        open.extend(children.into_iter().rev().map(|(start, end)| start..end));
    }
}

/// Whether the nodes of every subtree stand together.
fn stand_together<const N: usize>(nodes: &[Node<N>], first: usize) -> bool {
    // Per node, how many nodes are in its subtree, and behind the last of them.
    let mut sizes = vec![(1, 0); nodes.len()];
    (0..nodes.len()).rev().all(|node| {
        let (mut count, mut end) = (1, node + 1);
        for slot in 0..N {
            if let Some(child) = inner(nodes[node].child(slot)) {
                let (below, last) = sizes[child - first];
                count += below;
                end = end.max(last);
            }
        }
        sizes[node] = (count, end);
        end - node == count
    })
}

fn inner(child: Child) -> Option<usize> {
    match child.kind() {
        ChildKind::Inner(index) => Some(index),
        _ => None,
    }
}
