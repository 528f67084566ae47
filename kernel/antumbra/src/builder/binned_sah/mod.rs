//! Binned SAH, the fast builder: every node is split between two of a few bins per axis, where the surface
//! area heuristic finds it cheapest; near the leaves all splits are compared.
//!
//! Source: Wald (2007), "On fast Construction of SAH-based Bounding Volume Hierarchies". Splitting stops
//! when the primitives fit one leaf block, which is tested at one go. Large nodes are binned and
//! partitioned by many threads in chunks; smaller ones are whole subtrees, each the work of one thread.
//! All work is divided only by counts of primitives, so the tree does not depend on the number of threads; and all
//! arithmetic gives the same bits on every instruction set.

use alloc::vec;
use alloc::vec::Vec;

mod bins;
pub(crate) mod items;
pub(crate) mod planes;
mod sweep;

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};

use crate::builder::binned_sah::bins::{Binning, Bins, Split};
use crate::builder::binned_sah::planes::{CenterBounds, Extent, Planes};
use crate::builder::binned_sah::sweep::{MAX_SWEEP, sweep};
use crate::builder::cost::{Cost, Weigh};
use crate::geometry::BLOCK;
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::monitor::BuildMonitor;
use crate::parallel::{chunk_len, concat, fill, for_each, join, map};
use crate::tree::binary::{BinaryKind, BinaryNode, BinaryTree};

/// From this depth on nodes are halved by count, whatever the heuristic says, so that no input can make
/// the tree (and with it the stacks of traversals) deeper than this plus 30 levels.
const MAX_SAH_DEPTH: u32 = 64;

/// Subtrees smaller than this are built by one thread.
const SEQUENTIAL: usize = 4096;

/// Bins of nodes with many and with fewer primitives.
const MANY_BINS: usize = 32;
const SOME_BINS: usize = 16;

/// Builds the tree. If `monitor` stops it, some leaves have too many primitives.
pub(crate) fn build(primitives: &Primitives, monitor: &dyn BuildMonitor) -> BinaryTree {
    build_on(primitives, Isa::best(), monitor)
}

/// The subtree of [`Builder::BinnedSah`](crate::recipe::Builder) over some of the primitives, which are named by their
/// indices, with its root at some depth.
pub fn subtree(primitives: &Primitives, prims: &[u32], depth: u32) -> BinaryTree {
    let isa = Isa::best();
    let mut items: Vec<_> = prims
        .iter()
        .map(|&prim| Planes::new(&primitives.bounds_of(prim as usize), prim))
        .collect();
    if items.is_empty() {
        return BinaryTree::default();
    }
    let root = Part {
        first: 0,
        count: items.len(),
        depth,
        extent: Dispatch::<8>::dispatch(isa, Measure(&items)),
    };
    let plan = Plan::new(primitives, isa, SEQUENTIAL, &());
    BinaryTree {
        nodes: concat(plan.build(&mut items, root)),
        prims: items.iter().map(Planes::index).collect(),
        ..BinaryTree::default()
    }
}

/// Builds the tree on an instruction set, which makes no difference to it.
fn build_on(primitives: &Primitives, isa: Isa, monitor: &dyn BuildMonitor) -> BinaryTree {
    let count = primitives.len();
    if count == 0 {
        return BinaryTree::default();
    }
    let chunk = chunk_len(count);
    let mut items = fill(count, chunk, |range, slots| {
        for index in range {
            slots.push(match primitives.triangles.get(index) {
                Some(corners) => Planes::of_triangle(corners, index as u32),
                None => Planes::new(&primitives.bounds_of(index), index as u32),
            });
        }
    });
    let extent = map(count.div_ceil(chunk), 1, |place| {
        let items = &items[place * chunk..count.min((place + 1) * chunk)];
        Dispatch::<8>::dispatch(isa, Measure(items))
    });
    let extent = extent.iter().fold(Extent::EMPTY, |all, one| all.union(one));

    let plan = Plan::new(primitives, isa, SEQUENTIAL.max(count / 64), monitor);
    let root = Part {
        first: 0,
        count,
        depth: 0,
        extent,
    };
    let nodes = concat(plan.build(&mut items, root));

    let prims = fill(count, chunk, |range, slots| {
        for item in &items[range] {
            slots.push(item.index());
        }
    });
    BinaryTree {
        nodes,
        prims,
        ..BinaryTree::default()
    }
}

/// Primitives or items that become a subtree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    /// Where its items begin among all items.
    first: usize,
    count: usize,
    /// Depth of its root in the tree.
    depth: u32,
    extent: Extent,
}

impl Part {
    /// The two halves that a split makes of it.
    #[inline(always)]
    fn halves(&self, middle: usize, extents: [Extent; 2]) -> [Self; 2] {
        let [left, right] = extents;
        let depth = self.depth + 1;
        [
            Self {
                first: self.first,
                count: middle,
                depth,
                extent: left,
            },
            Self {
                first: self.first + middle,
                count: self.count - middle,
                depth,
                extent: right,
            },
        ]
    }

    /// Measures the extents of centres as well, except of parts that will be leaves.
    #[inline(always)]
    fn divided<S: Simd, W: Weigh>(
        &self,
        simd: S,
        items: &[Planes],
        middle: usize,
        bounds: [Planes; 2],
    ) -> [Self; 2] {
        let (left, right) = items.split_at(middle);
        let sides = [left, right];
        let mut extents = [Extent::EMPTY; 2];
        for side in 0..2 {
            extents[side].bounds = bounds[side];
            if sides[side].len() > W::LEAF {
                extents[side].centers = CenterBounds::of(simd, sides[side]);
            }
        }
        self.halves(middle, extents)
    }
}

/// Constants of the whole tree.
struct Plan<'a> {
    monitor: &'a dyn BuildMonitor,
    isa: Isa,
    /// Parts of at most this many primitives are the work of one thread.
    sequential: usize,
    /// Where the later kinds of primitives begin, see [`Planes::key`].
    kinds: [f32; PrimKind::COUNT - 1],
    cost: Cost,
}

impl<'a> Plan<'a> {
    fn new(
        primitives: &Primitives,
        isa: Isa,
        sequential: usize,
        monitor: &'a dyn BuildMonitor,
    ) -> Self {
        Self {
            monitor,
            isa,
            sequential,
            kinds: primitives
                .kind_starts()
                .map(|index| Planes::key(index as u32)),
            cost: Cost::default(),
        }
    }

    /// Where a kind begins that is not the first one inside; `None` if all are of one kind.
    #[inline(always)]
    fn other_kind(&self, bounds: &Planes) -> Option<f32> {
        let mut starts = self.kinds.into_iter();
        starts.find(|start| !bounds.on_one_side_of(*start))
    }

    /// The subtree over `items`, in pieces that are to follow each other: children are found by relative places, so
    /// they can be moved as they are.
    fn build(&self, items: &mut [Planes], part: Part) -> Vec<Vec<BinaryNode>> {
        if self.monitor.cancelled() {
            let bounds = part.extent.bounds.bounds();
            let (first, count) = (part.first as u32, part.count as u32);
            let kind = BinaryKind::Leaf { first, count };
            return vec![vec![BinaryNode { bounds, kind }]];
        }
        if part.count <= self.sequential {
            let subtree = Subtree {
                plan: self,
                items,
                part,
            };
            return vec![Dispatch::<8>::dispatch(self.isa, subtree)];
        }
        let [left, right] = self.split(items, &part);
        let (left_items, right_items) = items.split_at_mut(left.count);
        let (left, right) = join(
            || self.build(left_items, left),
            || self.build(right_items, right),
        );
        let left_len: usize = left.iter().map(Vec::len).sum();
        let parent = BinaryNode {
            bounds: part.extent.bounds.bounds(),
            kind: BinaryKind::Inner {
                right: (1 + left_len) as u32,
            },
        };
        let mut pieces = vec![vec![parent]];
        pieces.extend(left);
        pieces.extend(right);
        pieces
    }

    /// Splits a part with all threads.
    fn split(&self, items: &mut [Planes], part: &Part) -> [Part; 2] {
        let isa = self.isa;
        let chunk = chunk_len(items.len());
        let split = if part.depth < MAX_SAH_DEPTH {
            let binning = Binning::new(&part.extent.centers);
            let mut bins = vec![Bins::empty(); items.len().div_ceil(chunk)];
            let jobs = items.chunks(chunk).zip(&mut bins);
            for_each(jobs.collect(), |(items, bins)| {
                Dispatch::<8>::dispatch(isa, Fill(items, &binning, bins, &self.cost));
            });
            let (first, others) = bins.split_at_mut(1);
            others.iter().for_each(|other| first[0].add(other));
            Dispatch::<8>::dispatch(isa, Choose(&first[0], &binning, &self.cost))
        } else {
            None
        };
        let Some(split) = split else {
            return Dispatch::<8>::dispatch(isa, Halve(items, part));
        };

        let mut sides = vec![(0, [CenterBounds::EMPTY; 2]); items.len().div_ceil(chunk)];
        let jobs = items.chunks_mut(chunk).zip(&mut sides);
        for_each(jobs.collect(), |(items, sides)| {
            *sides = Dispatch::<8>::dispatch(isa, Partition(items, &split));
        });
        let lefts: Vec<usize> = sides.iter().map(|(left, _)| *left).collect();
        let middle = swap_misplaced(items, chunk, &lefts);
        let mut extents = [Extent::EMPTY; 2];
        for (_, [left, right]) in &sides {
            extents[0].centers = extents[0].centers.union(left);
            extents[1].centers = extents[1].centers.union(right);
        }
        extents[0].bounds = split.left_bounds;
        extents[1].bounds = split.right_bounds;
        part.halves(middle, extents)
    }
}

/// Makes one partition of partitioned chunks, of which chunk `i` begins with `lefts[i]` items of the left
/// side: swaps the right items before the middle with the left items behind it. Returns the middle.
fn swap_misplaced(items: &mut [Planes], chunk: usize, lefts: &[usize]) -> usize {
    let middle: usize = lefts.iter().sum();
    let (mut front, mut back) = (Vec::new(), Vec::new());
    let mut rest = items;
    let mut place = 0;
    for &left in lefts {
        let (chunk_items, others) = rest.split_at_mut(chunk.min(rest.len()));
        rest = others;
        let (left_items, right_items) = chunk_items.split_at_mut(left);
        let left_before = middle.saturating_sub(place).min(left);
        back.push(&mut left_items[left_before..]);
        place += left;
        let right_before = middle.saturating_sub(place).min(right_items.len());
        place += right_items.len();
        front.push(&mut right_items[..right_before]);
    }
    // Both lists hold equally many items in all, but their pieces differ in length.
    let mut pairs = Vec::new();
    let mut back = back.into_iter();
    let mut to: &mut [Planes] = &mut [];
    for mut from in front {
        while !from.is_empty() {
            if to.is_empty() {
                let Some(next) = back.next() else { break };
                to = next;
                continue;
            }
            let len = from.len().min(to.len());
            let (from_now, from_later) = from.split_at_mut(len);
            let (to_now, to_later) = core::mem::take(&mut to).split_at_mut(len);
            pairs.push((from_now, to_now));
            (from, to) = (from_later, to_later);
        }
    }
    for_each(pairs, |(a, b)| a.swap_with_slice(b));
    middle
}

/// Halves a part by count, along the axis on which its centres spread most.
#[inline(always)]
fn halve<S: Simd, W: Weigh>(simd: S, items: &mut [Planes], part: &Part) -> [Part; 2] {
    let centers = &part.extent.centers;
    let mut axis = 0;
    for other in 1..3 {
        if centers.spread(other) > centers.spread(axis) {
            axis = other;
        }
    }
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| {
        a.center(axis)
            .total_cmp(&b.center(axis))
            .then(a.index().cmp(&b.index()))
    });
    let (left, right) = items.split_at(middle);
    let bounds = [Planes::around(simd, left), Planes::around(simd, right)];
    part.divided::<S, W>(simd, items, middle, bounds)
}

/// A subtree for one thread.
struct Subtree<'a> {
    plan: &'a Plan<'a>,
    items: &'a mut [Planes],
    part: Part,
}

impl WithSimd<8> for Subtree<'_> {
    type Output = Vec<BinaryNode>;

    /// A loop with a stack, because a recursive function cannot be inlined and so not be compiled for
    /// the instruction set.
    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) -> Vec<BinaryNode> {
        let Self {
            plan,
            items,
            part: root,
        } = self;
        // Most leaves are more than half full.
        let mut nodes: Vec<BinaryNode> = Vec::with_capacity(root.count / 2);
        // Parts to be built, those standing first in the tree on top, with the parent of which they are
        // the right child.
        let mut open = Vec::with_capacity(MAX_SAH_DEPTH as usize + 32);
        open.push((root, None));
        while let Some((part, right_child_of)) = open.pop() {
            let index = nodes.len();
            if let Some(parent) = right_child_of {
                let parent: usize = parent;
                nodes[parent].kind = BinaryKind::Inner {
                    right: (index - parent) as u32,
                };
            }
            let bounds = part.extent.bounds.bounds();
            let other_kind = plan.other_kind(&part.extent.bounds);
            if part.count <= BLOCK && other_kind.is_none() {
                let kind = BinaryKind::Leaf {
                    first: part.first as u32,
                    count: part.count as u32,
                };
                nodes.push(BinaryNode { bounds, kind });
                continue;
            }
            let kind = BinaryKind::Inner { right: 0 };
            nodes.push(BinaryNode { bounds, kind });

            let items = &mut items[part.first - root.first..][..part.count];
            let [left, right] = if let Some(first) = other_kind
                && part.count <= BLOCK
            {
                // A leaf holds one kind.
                items.sort_unstable_by_key(Planes::index);
                let middle = items.partition_point(|item| item.0[3] < first);
                let (left, right) = items.split_at(middle);
                let bounds = [Planes::around(simd, left), Planes::around(simd, right)];
                part.divided::<S, Cost>(simd, items, middle, bounds)
            } else {
                divide(simd, items, &part, &plan.cost)
            };
            open.push((right, Some(index)));
            open.push((left, None));
        }
        nodes
    }
}

/// Splits a part with one thread.
#[inline(always)]
fn divide<S: Simd, W: Weigh>(simd: S, items: &mut [Planes], part: &Part, weigh: &W) -> [Part; 2] {
    if part.depth >= MAX_SAH_DEPTH {
        halve::<S, W>(simd, items, part)
    } else if part.count <= MAX_SWEEP {
        sweep_split(simd, items, part, weigh)
    } else if part.count <= 256 {
        split::<S, W, SOME_BINS>(simd, items, part, weigh)
    } else {
        split::<S, W, MANY_BINS>(simd, items, part, weigh)
    }
}

/// Splits by the heuristic; by count when no split between bins is possible.
#[inline(always)]
fn split<S: Simd, W: Weigh, const B: usize>(
    simd: S,
    items: &mut [Planes],
    part: &Part,
    weigh: &W,
) -> [Part; 2] {
    let binning = Binning::<B>::new(&part.extent.centers);
    let mut bins = Bins::empty();
    if B == MANY_BINS {
        bins.fill_alternating(simd, items, &binning, weigh);
    } else {
        bins.fill(simd, items, &binning, weigh);
    }
    let Some(split) = bins.best_split(simd, &binning, weigh) else {
        return halve::<S, W>(simd, items, part);
    };
    let middle = split.partition(simd, items);
    let bounds = [split.left_bounds, split.right_bounds];
    part.divided::<S, W>(simd, items, middle, bounds)
}

/// Splits by the heuristic between any two primitives; by count when the heuristic cannot distinguish them.
#[inline(always)]
fn sweep_split<S: Simd, W: Weigh>(
    simd: S,
    items: &mut [Planes],
    part: &Part,
    weigh: &W,
) -> [Part; 2] {
    let Some(split) = sweep(simd, items, &part.extent.centers, weigh) else {
        return halve::<S, W>(simd, items, part);
    };
    let bounds = [split.left_bounds, split.right_bounds];
    part.divided::<S, W>(simd, items, split.middle, bounds)
}

struct Measure<'a>(&'a [Planes]);

impl WithSimd<8> for Measure<'_> {
    type Output = Extent;
    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) -> Extent {
        Extent::of(simd, self.0)
    }
}

struct Fill<'a>(
    &'a [Planes],
    &'a Binning<MANY_BINS>,
    &'a mut Bins<Cost, MANY_BINS>,
    &'a Cost,
);

impl WithSimd<8> for Fill<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) {
        self.2.fill_alternating(simd, self.0, self.1, self.3);
    }
}

struct Choose<'a>(&'a Bins<Cost, MANY_BINS>, &'a Binning<MANY_BINS>, &'a Cost);

impl WithSimd<8> for Choose<'_> {
    type Output = Option<Split>;
    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) -> Option<Split> {
        self.0.best_split(simd, self.1, self.2)
    }
}

struct Partition<'a>(&'a mut [Planes], &'a Split);

impl WithSimd<8> for Partition<'_> {
    type Output = (usize, [CenterBounds; 2]);
    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) -> Self::Output {
        let middle = self.1.partition(simd, self.0);
        let (left, right) = self.0.split_at(middle);
        let left_centers = CenterBounds::of(simd, left);
        (middle, [left_centers, CenterBounds::of(simd, right)])
    }
}

struct Halve<'a>(&'a mut [Planes], &'a Part);

impl WithSimd<8> for Halve<'_> {
    type Output = [Part; 2];
    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) -> [Part; 2] {
        halve::<S, Cost>(simd, self.0, self.1)
    }
}

#[cfg(test)]
mod tests;
