//! Reinsertion, the thorough builder: takes the tree of binned SAH and moves subtrees to where the boxes
//! around them are smaller. Leaves stay as they are.
//!
//! Source: Bittner, Hapala and Havran (2013), "Fast Insertion-Based Optimization of Bounding Volume
//! Hierarchies", in rounds as in Meister and Bittner (2018), "Parallel Reinsertion for Bounding Volume
//! Hierarchy Optimization". In each round the best new place of every subtree is searched, at the same time
//! and in a tree that does not change; then the moves are made one after the other, those that promise
//! most first. Their moves lock the nodes around them. Here a move is made on trial, and taken back if
//! earlier ones have spoiled it. So the tree does not depend on the number of threads, and no move makes
//! it worse.
//!
//! Less area promises fewer tests, but not in every tree to every kind of ray. `docs/notes/kernel.md` has measurements.

use alloc::vec::Vec;

mod linked_tree;

use crate::aabb::Aabb;
use crate::builder::reinsertion::linked_tree::{LinkedTree, TOP, area};
use crate::monitor::BuildMonitor;
use crate::parallel;
use crate::tree::binary::BinaryTree;

/// Rounds at most; interiors and cities need 5 to 8.
const MAX_ROUNDS: usize = 12;

/// A round that lowers the sum of areas by less than this share of it is the last. Thirty rounds, whatever
/// they gain, are hardly worth their time: see `docs/notes/kernel.md`.
const MIN_GAIN: f64 = 0.001;

/// The most inner nodes that one search looks at, those nearby first. Interiors never need 50, but where long primitives
/// cross each other the number would grow with the scene.
const MAX_VISITS: usize = 64;

/// No further round begins when all searches together have looked at more inner nodes than this times the nodes there are.
/// Interiors and cities need 23 to 61 in all rounds. In a soup of triangles a round takes 62, and the third gains 0.4 %.
const MEAN_VISITS: usize = 100;

/// No move takes a node further from the root than this, which is the bound that binned SAH keeps.
const MAX_DEPTH: usize = 94;

/// Moves between two questions whether to stop: some milliseconds.
const MOVES_PER_QUESTION: usize = 4096;

/// Subtrees for which a thread searches places at one go.
const CHUNK: usize = 256;

/// A tree of the same leaves under better inner nodes. When `monitor` stops it, not all moves are made.
pub(crate) fn improved(tree: &BinaryTree, monitor: &dyn BuildMonitor) -> BinaryTree {
    if tree.nodes.is_empty() {
        return BinaryTree::default();
    }
    let mut linked = LinkedTree::new(tree);
    let mut sum: f64 = tree.nodes.iter().map(|node| area(&node.bounds)).sum();
    let mut visits = 0;
    for _ in 0..MAX_ROUNDS {
        let mut gain = 0.0;
        let (moves, looked_at) = moves(&linked, monitor);
        visits += looked_at;
        for moves in moves.chunks(MOVES_PER_QUESTION) {
            if monitor.cancelled() {
                break;
            }
            for &Move { node, to, .. } in moves {
                gain += linked.reinsert(node, to, MAX_DEPTH);
            }
        }
        sum -= gain;
        if gain <= MIN_GAIN * sum || visits > MEAN_VISITS * linked.len() || monitor.cancelled() {
            break;
        }
    }
    linked.unlinked(&tree.prims)
}

#[derive(Clone, Copy)]
/// A subtree that would be better next to another node.
struct Move {
    node: u32,
    to: u32,
    /// Shrinking of the sum of areas by the move.
    gain: f32,
}

/// The best move of every subtree that has one, those that gain most first, and how many inner nodes the searches looked at.
fn moves(tree: &LinkedTree, monitor: &dyn BuildMonitor) -> (Vec<Move>, usize) {
    let found = parallel::map(tree.len().div_ceil(CHUNK), 1, |chunk| {
        if monitor.cancelled() {
            return (Vec::new(), 0);
        }
        let first = 1 + chunk * CHUNK;
        let (mut open, mut moves, mut visits) = (Vec::new(), Vec::new(), 0);
        for node in first..=tree.len().min(first + CHUNK - 1) {
            let mut search = Search::new(tree, node as u32, &mut open);
            search.search();
            visits += MAX_VISITS - search.visits;
            if search.best.gain > 0.0 {
                moves.push(search.best);
            }
        }
        (moves, visits)
    });
    let visits = found.iter().map(|(_, visits)| visits).sum();
    let mut moves: Vec<_> = found.into_iter().flat_map(|(moves, _)| moves).collect();
    moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.node.cmp(&b.node)));
    (moves, visits)
}

/// Looks for the best place of a subtree, by branch and bound. In single precision: what is gained in truth
/// is found out when the move is made.
struct Search<'a> {
    tree: &'a LinkedTree,
    /// Bounds of the subtree.
    bounds: Aabb,
    area: f32,
    best: Move,
    /// Nodes below which there may be better places, each with what is gained down there before the subtree
    /// gets a parent: what taking it out saves, less the growth of the nodes that it will be below.
    open: &'a mut Vec<(u32, f32)>,
    /// Inner nodes that the search may still visit.
    visits: usize,
}

impl<'a> Search<'a> {
    fn new(tree: &'a LinkedTree, node: u32, open: &'a mut Vec<(u32, f32)>) -> Self {
        let bounds = *tree.bounds(node);
        Self {
            tree,
            bounds,
            area: half_area(&bounds),
            best: Move {
                node,
                to: TOP,
                gain: 0.0,
            },
            open,
            visits: MAX_VISITS,
        }
    }

    /// Finds the best move. It gains nothing if the subtree is best where it is.
    ///
    /// The way to a new place goes up to some node and down on its other side. Nodes on the way up shrink,
    /// those on the way down grow, and all others stay as they are.
    fn search(&mut self) {
        let tree = self.tree;
        let node = self.best.node;
        let (mut below, mut pivot) = (node, tree.parent(node));
        // What taking the subtree out saves below the pivot, and the box of what else is there.
        let mut saved = 0.0;
        let mut rest = Aabb::EMPTY;
        while pivot != TOP
            && let Some(inner) = tree.inner(pivot)
        {
            let area = half_area(tree.bounds(pivot));
            if below == node {
                // The parent vanishes.
                saved = area;
            }
            let other = 1 - tree.side(pivot, below);
            self.look_at(inner.children[other], &inner.bounds[other], saved);
            self.look_below();
            rest = union(&rest, &inner.bounds[other]);
            if below != node {
                saved += area - half_area(&rest);
                self.offer(pivot, saved - area);
            }
            (below, pivot) = (pivot, tree.parent(pivot));
        }
    }

    /// Considers all places that are still open.
    fn look_below(&mut self) {
        while let Some((node, gain)) = self.open.pop() {
            // A new parent around the subtree is needed wherever it goes.
            if gain - self.area > self.best.gain
                && self.visits > 0
                && let Some(inner) = self.tree.inner(node)
            {
                self.visits -= 1;
                for side in 0..2 {
                    self.look_at(inner.children[side], &inner.bounds[side], gain);
                }
            }
        }
    }

    /// Considers the place next to a node, and leaves those below it open.
    #[inline(always)]
    fn look_at(&mut self, node: u32, bounds: &Aabb, gain: f32) {
        let both = half_area(&union(bounds, &self.bounds));
        self.offer(node, gain - both);
        let gain_below = gain - (both - half_area(bounds));
        if gain_below - self.area > self.best.gain {
            self.open.push((node, gain_below));
        }
    }

    /// Considers a place. Gains that are NaN, because areas are infinite, do not count.
    #[inline(always)]
    fn offer(&mut self, to: u32, gain: f32) {
        if gain > self.best.gain {
            self.best.to = to;
            self.best.gain = gain;
        }
    }
}

/// [`Aabb::union`] of boxes without NaN: most of the time is spent here.
#[inline(always)]
fn union(a: &Aabb, b: &Aabb) -> Aabb {
    let mut all = *a;
    for axis in 0..3 {
        if b.min[axis] < a.min[axis] {
            all.min[axis] = b.min[axis];
        }
        if b.max[axis] > a.max[axis] {
            all.max[axis] = b.max[axis];
        }
    }
    all
}

/// [`Aabb::half_area`] of a box that is not empty; infinite or NaN when it overflows.
#[inline(always)]
fn half_area(bounds: &Aabb) -> f32 {
    let x = bounds.max[0] - bounds.min[0];
    let y = bounds.max[1] - bounds.min[1];
    let z = bounds.max[2] - bounds.min[2];
    x * y + y * z + z * x
}

#[cfg(test)]
mod tests;
