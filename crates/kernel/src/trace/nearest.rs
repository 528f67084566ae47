//! Primitives near a point: nodes in order of distance, nothing missed.
//!
//! # Why no primitive that matters is ever missed
//! A box is left out when it is farther away than what is sought, by more than all rounding. In the world the distances of
//! primitives are off by some `2⁻⁵⁰` of the coordinates, see [`crate::geometry::nearest`], and the margin is `2⁻⁴⁰` of
//! them. Distances to boxes are worked out in `f32` from differences of `f32` and are off by a few roundings of
//! themselves, which a factor makes good. In an instance the point is brought into the object. Two points of the object are
//! at most as far apart as in the world, times the norm of the inverse transform, so with that factor on the limit a box
//! can be left out there. Its margin is `2⁻²⁰` of the coordinates, since the point is rounded to `f32`.

use alloc::collections::BTreeSet;
use alloc::vec::Vec;

use antumbra_simd::{Simd, Width, WithSimd};

use crate::geometry::PrimRef;
use crate::geometry::instance::{Affine, dot};
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::nearest::{Near, Place, eigen};
use crate::geometry::quad::quad_of;
use crate::math;
use crate::ray::INVALID_ID;
use crate::tree::leaves::on_leaf;
use crate::tree::node::{Child, ChildKind, Node};
use crate::tree::wide::WideTree;

/// A primitive and where it is nearest to a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub near: Near,
    pub id: PrimRef,
    pub inst_id: u32,
}

impl Candidate {
    /// By distance, then by ids.
    pub fn precedes(&self, other: &Self) -> bool {
        let rank = |one: &Self| (one.near.distance2, one.ids());
        rank(self) < rank(other)
    }

    /// Instance, geometry, primitive.
    pub fn ids(&self) -> [u32; 3] {
        [self.inst_id, self.id.geom_id, self.id.prim_id]
    }
}

/// What is sought.
pub(crate) trait Seeker {
    /// Nothing farther away than this matters any more.
    fn limit(&self) -> f64;

    /// Takes a primitive, which may be too far away, or given twice.
    fn offer(&mut self, candidate: Candidate);
}

/// The nearest primitive within a distance.
#[derive(Debug)]
pub(crate) struct Nearest {
    within2: f64,
    limit: f64,
    pub best: Option<Candidate>,
}

impl Nearest {
    pub fn new(distance: f64) -> Self {
        Self {
            within2: distance * distance,
            limit: distance,
            best: None,
        }
    }
}

impl Seeker for Nearest {
    fn limit(&self) -> f64 {
        self.limit
    }

    fn offer(&mut self, candidate: Candidate) {
        let better = match &self.best {
            Some(best) => candidate.precedes(best),
            None => candidate.near.distance2 <= self.within2,
        };
        if better {
            self.limit = math::sqrt(candidate.near.distance2).next_up();
            self.best = Some(candidate);
        }
    }
}

/// All primitives within a distance.
#[derive(Debug)]
pub(crate) struct Within {
    within2: f64,
    limit: f64,
    found: Vec<Candidate>,
}

impl Within {
    pub fn new(distance: f64) -> Self {
        Self {
            within2: distance * distance,
            limit: distance,
            found: Vec::new(),
        }
    }

    /// Each primitive once, the nearest first.
    pub fn sorted(mut self) -> Vec<Candidate> {
        self.found.sort_by(|a, b| {
            let (near, far) = (a.near.distance2, b.near.distance2);
            near.total_cmp(&far).then(a.ids().cmp(&b.ids()))
        });
        self.found.dedup_by_key(|candidate| candidate.ids());
        // The nearer half of a quad stands for the quad.
        let mut quads = BTreeSet::new();
        self.found.retain(|Candidate { id, inst_id, .. }| {
            quad_of(id.prim_id).is_none_or(|(quad, _)| quads.insert([*inst_id, id.geom_id, quad]))
        });
        self.found
    }
}

impl Seeker for Within {
    fn limit(&self) -> f64 {
        self.limit
    }

    fn offer(&mut self, candidate: Candidate) {
        if candidate.near.distance2 <= self.within2 {
            self.found.push(candidate);
        }
    }
}

/// A point in a tree: the world, or an object as an instance places it.
struct Space<'a> {
    place: Place<'a>,
    inst_id: u32,
    /// The point among the boxes of the tree.
    point: [f32; 3],
    /// Largest distance among the boxes for a distance of 1 in the world, at least 1 part in a million too large.
    scale: f64,
    /// Added to distances among the boxes.
    margin: f64,
}

impl<'a> Space<'a> {
    fn world(point: [f32; 3], reach: f32) -> Self {
        let largest = point.iter().fold(reach, |largest, x| largest.max(x.abs()));
        Self {
            place: Place {
                point: point.map(f64::from),
                affine: None,
            },
            inst_id: INVALID_ID,
            point,
            scale: 1.0 + 1e-6,
            margin: f64::from(largest) / (1u64 << 40) as f64,
        }
    }

    /// The point in an object whose scene extent is `reach`.
    fn object(place: Place<'a>, affine: &Affine, inst_id: u32, reach: f32) -> Self {
        let absolute = |affine: &Affine| Affine {
            rows: affine.rows.map(|row| row.map(f64::abs)),
        };
        // There is an inverse: instances without one were dropped.
        let inverse = affine.inverse().unwrap_or(Affine {
            rows: [[f64::INFINITY; 4]; 3],
        });
        let scale = norm(&inverse) * (1.0 + 1e-6);
        let largest = |v: [f64; 3]| v.into_iter().fold(0.0, f64::max);
        let reach = f64::from(reach);
        let around_point = largest(absolute(&inverse).point(place.point.map(f64::abs)));
        let around_corners = largest(absolute(affine).point([reach; 3]));
        Self {
            inst_id,
            point: inverse.point(place.point).map(|x| x as f32),
            scale,
            margin: (around_point + reach) / (1u64 << 20) as f64
                + scale * around_corners / (1u64 << 40) as f64,
            place,
        }
    }

    /// Square of the distance from which on boxes are left out; infinite if that is too much for `f32`.
    #[inline(always)]
    fn limit2(&self, limit: f64) -> f32 {
        let limit = limit * self.scale + self.margin;
        ((limit * limit) as f32).next_up()
    }
}

/// The largest factor by which a linear map makes vectors longer.
fn norm(affine: &Affine) -> f64 {
    let columns: [[f64; 3]; 3] =
        core::array::from_fn(|column| core::array::from_fn(|row| affine.rows[row][column]));
    let (values, _) = eigen(columns.map(|a| columns.map(|b| dot(a, b))));
    math::sqrt(values.into_iter().fold(0.0, f64::max))
}

/// Visits everything in a tree that may be near enough to a point, which is finite.
pub(crate) struct Search<'a, const N: usize> {
    pub tree: &'a WideTree<N>,
    pub point: [f32; 3],
    pub stack: &'a mut Vec<u64>,
    pub seeker: &'a mut dyn Seeker,
}

impl<const N: usize> WithSimd<N> for Search<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, _: S) {
        let space = Space::world(self.point, self.tree.reach);
        self.stack.clear();
        walk::<N, true>(self.tree, Child::ROOT, &space, self.stack, self.seeker);
    }
}

/// Visits what is below a child, nearest first. Only in the world are there instances.
#[inline(always)]
fn walk<const N: usize, const WORLD: bool>(
    tree: &WideTree<N>,
    root: Child,
    space: &Space<'_>,
    stack: &mut Vec<u64>,
    seeker: &mut dyn Seeker,
) {
    let bottom = stack.len();
    stack.push(root.0.into());
    while stack.len() > bottom
        && let Some(item) = stack.pop()
    {
        let distance2 = f32::from_bits((item >> 32) as u32);
        let limit2 = space.limit2(seeker.limit());
        if distance2 > limit2 {
            continue;
        }
        match Child(item as u32).kind() {
            ChildKind::Inner(index) => push(&tree.nodes[index], space.point, limit2, stack),
            ChildKind::Leaf(leaf) => {
                on_leaf!(tree, leaf, block => offer_block(block, space, limit2, seeker));
            }
            ChildKind::Instance(index) => {
                if WORLD {
                    let placed = &tree.instances[index];
                    let affine = Affine::new(&placed.world_from_object);
                    let place = Place {
                        affine: Some(&affine),
                        ..space.place
                    };
                    let placement = &placed.placement;
                    let inside = Space::object(place, &affine, placement.inst_id, placement.reach);
                    let root = Child::inner(placed.root as usize);
                    object(tree, root, &inside, stack, seeker);
                }
            }
        }
    }
}

/// Visits an object. Not inlined: what is in objects is far more than the call costs.
#[inline(always)]
fn object<const N: usize>(
    tree: &WideTree<N>,
    root: Child,
    space: &Space<'_>,
    stack: &mut Vec<u64>,
    seeker: &mut dyn Seeker,
) {
    walk::<N, false>(tree, root, space, stack, seeker);
}

/// Pushes the children that are near enough, the nearest last.
#[inline(always)]
fn push<const N: usize>(node: &Node<N>, point: [f32; 3], limit2: f32, stack: &mut Vec<u64>) {
    let distances2 = distances2(&node.planes, point);
    let first = stack.len();
    for lane in 0..N {
        if distances2[lane] <= limit2 && node.children[lane] != Child::EMPTY.0 {
            let item = u64::from(distances2[lane].to_bits()) << 32 | u64::from(node.children[lane]);
            let mut place = stack.len();
            stack.push(item);
            while place > first && stack[place - 1] < item {
                stack[place] = stack[place - 1];
                place -= 1;
            }
            stack[place] = item;
        }
    }
}

/// Squares of the distances from a point to boxes, given as planes, or a little less.
#[inline(always)]
fn distances2<const L: usize>(planes: &[[[f32; L]; 2]; 3], point: [f32; 3]) -> [f32; L] {
    let mut sums = [0.0; L];
    for axis in 0..3 {
        let [low, high] = &planes[axis];
        for lane in 0..L {
            let below = low[lane] - point[axis];
            let above = point[axis] - high[lane];
            let outside = if below > above { below } else { above };
            // Also NaN, of a lane without a box.
            let outside = if outside > 0.0 { outside } else { 0.0 };
            sums[lane] += outside * outside;
        }
    }
    sums
}

/// Offers the primitives of a block that may be near enough.
#[inline(always)]
fn offer_block<B: LeafBlock>(block: &B, space: &Space<'_>, limit2: f32, seeker: &mut dyn Seeker) {
    let distances2 = distances2(&block.planes(), space.point);
    for lane in 0..block.count() {
        if distances2[lane] <= limit2 {
            offer(block, lane, space, seeker);
        }
    }
}

#[inline(never)]
fn offer<B: LeafBlock>(block: &B, lane: usize, space: &Space<'_>, seeker: &mut dyn Seeker) {
    if let Some(near) = block.near(lane, &space.place) {
        seeker.offer(Candidate {
            near,
            id: block.id(lane),
            inst_id: space.inst_id,
        });
    }
}
