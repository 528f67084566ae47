//! Primitives near a point: nodes in order of distance, nothing missed.
//!
//! # Why no primitive that matters is ever missed
//! A box is left out when it is farther away than what is sought, by more than all rounding. In the world the distances of
//! primitives are off by some `2⁻⁵⁰` of the coordinates, see [`crate::geometry::nearest`], and the margin is `2⁻⁴⁰` of
//! them. Distances to boxes are computed in `f32` from differences of `f32` and are off by a few roundings of
//! themselves, which a factor makes good. In an instance the point is brought into the object. Two points of the object are
//! at most as far apart as in the world, times the norm of the inverse transform, so with that factor on the limit a box
//! can be left out there. Its margin is `2⁻²⁰` of the coordinates, since the point is rounded to `f32`.
//!
//! A triangle of a leaf is left out when a lower bound of its distance is farther away, by a margin of its own:
//! see [`crate::geometry::near_test`]. All others are measured in double precision, and only that is an answer. Before
//! that, upper bounds of their distances say how far away the nearest one can be.

use alloc::collections::BTreeSet;
use alloc::vec::Vec;

use antumbra_simd::{Lanes, Mask, Scalar, Simd, Width, WithSimd};

use crate::aabb::Aabb;
use crate::geometry::instance::{Affine, dot};
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::near_test::{self, Bounds};
use crate::geometry::nearest::{Near, Place, eigen};
use crate::geometry::primitives::PrimKind;
use crate::geometry::quad::quad_of;
use crate::geometry::triangle::{LanesOf, TriangleBlock, Vector};
use crate::geometry::{BLOCK, PrimRef};
use crate::math;
use crate::ray::INVALID_ID;
use crate::trace::memory::{Memory, Stored};
use crate::trace::pick::Children;
use crate::trace::single::prefetch_leaf;
use crate::trace::stack::{Item, Stack, stack_size};
use crate::trace::step::NodeLanes;
use crate::tree::leaves::on_leaf;
use crate::tree::node::{Child, ChildKind, Leaf};
use crate::tree::wide::WideTree;

/// A primitive and where it is nearest to a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub near: Near,
    pub id: PrimRef,
    pub inst_id: u32,
}

impl Candidate {
    /// Whether this candidate comes before another: by distance, then by ids.
    pub fn precedes(&self, other: &Self) -> bool {
        let rank = |one: &Self| (one.near.distance2, one.ids());
        rank(self) < rank(other)
    }

    pub fn distance(&self) -> f32 {
        math::sqrt(self.near.distance2) as f32
    }

    /// Ids in the order of rank: instance, geometry, primitive.
    pub fn ids(&self) -> [u32; 3] {
        [self.inst_id, self.id.geom_id, self.id.prim_id]
    }
}

/// Collector of near primitives: takes candidates and bounds the search.
pub(crate) trait Seeker {
    /// Nothing farther away than this matters any more.
    fn limit(&self) -> f64;

    /// Some primitive is no farther away than this, which is in the world.
    fn cap(&mut self, distance: f64);

    /// Takes a primitive, which may be too far away, or given twice. Returns whether the limit has shrunk.
    fn offer(&mut self, candidate: Candidate) -> bool;

    /// The seeker, if it only wants to know how far primitives reach.
    fn of_reach(&mut self) -> Option<&mut Reach> {
        None
    }
}

/// The largest coordinate of what is within a distance, user geometry aside.
#[derive(Debug)]
pub(crate) struct Reach {
    pub distance: f64,
    pub reach: f64,
}

impl Reach {
    /// Takes a primitive of a kind, given how to measure it and its box.
    pub fn measure(
        &mut self,
        kind: PrimKind,
        place: &Place<'_>,
        near: impl FnOnce() -> Option<Near>,
        bounds: impl FnOnce() -> Aabb,
    ) {
        let is_there = |near: Near| near.distance2 <= self.distance * self.distance;
        if kind != PrimKind::User && near().is_some_and(is_there) {
            self.reach = self.reach.max(place.reach(&bounds()));
        }
    }
}

impl Seeker for Reach {
    fn limit(&self) -> f64 {
        self.distance
    }

    fn cap(&mut self, _: f64) {}

    fn offer(&mut self, _: Candidate) -> bool {
        false
    }

    fn of_reach(&mut self) -> Option<&mut Self> {
        Some(self)
    }
}

/// The nearest primitive within a distance.
#[derive(Debug)]
pub(crate) struct Nearest {
    within2: f64,
    /// Farther away than this nothing is known.
    guess2: f64,
    limit: f64,
    pub best: Option<Candidate>,
}

impl Nearest {
    pub fn new(distance: f64) -> Self {
        Self {
            within2: distance * distance,
            guess2: f64::INFINITY,
            limit: distance,
            best: None,
        }
    }

    /// Leaves out what is farther away than this: see [`Nearest::is_known`].
    pub fn guess(&mut self, distance: f64) {
        if distance < self.limit {
            self.limit = distance;
            self.guess2 = distance * distance;
        }
    }

    /// Whether the guess was right, so that nothing was left out that matters. Otherwise the search must be repeated
    /// without it.
    pub fn is_known(&self) -> bool {
        self.guess2 >= self.within2
            || self
                .best
                .as_ref()
                .is_some_and(|best| best.near.distance2 <= self.guess2)
    }
}

impl Seeker for Nearest {
    fn limit(&self) -> f64 {
        self.limit
    }

    fn cap(&mut self, distance: f64) {
        self.limit = self.limit.min(distance);
    }

    fn offer(&mut self, candidate: Candidate) -> bool {
        let better = match &self.best {
            Some(best) => candidate.precedes(best),
            None => candidate.near.distance2 <= self.within2,
        };
        if better {
            let distance = math::sqrt(candidate.near.distance2).next_up();
            self.limit = self.limit.min(distance);
            self.best = Some(candidate);
        }
        better
    }
}

/// Collector of all primitives within a distance.
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
        // The nearer half of a quad represents the quad.
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

    fn cap(&mut self, _: f64) {}

    fn offer(&mut self, candidate: Candidate) -> bool {
        if candidate.near.distance2 <= self.within2 {
            self.found.push(candidate);
        }
        false
    }
}

/// Squares of distances in a tree beyond which nothing matters.
#[derive(Clone, Copy)]
struct Limits {
    boxes: f32,
    /// For [lower bounds](Bounds).
    bounds: f32,
    /// Triangles that are no nearer than this do not change the limits.
    reach2: f32,
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
    /// Largest coordinate of the point and the boxes.
    largest: f32,
}

impl<'a> Space<'a> {
    fn world(point: [f32; 3], reach: f32) -> Self {
        let largest = largest(point, reach);
        Self {
            place: Place {
                point: point.map(f64::from),
                affine: None,
            },
            inst_id: INVALID_ID,
            point,
            scale: 1.0 + 1e-6,
            margin: f64::from(largest) / (1u64 << 40) as f64,
            largest,
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
        let most = |v: [f64; 3]| v.into_iter().fold(0.0, f64::max);
        let point = inverse.point(place.point).map(|x| x as f32);
        let largest = largest(point, reach);
        let reach = f64::from(reach);
        let around_point = most(absolute(&inverse).point(place.point.map(f64::abs)));
        let around_corners = most(absolute(affine).point([reach; 3]));
        Self {
            inst_id,
            point,
            scale,
            margin: (around_point + reach) / (1u64 << 20) as f64
                + scale * around_corners / (1u64 << 40) as f64,
            largest,
            place,
        }
    }

    /// The squares of a distance in the world. Squares that `f32` can hold are below infinity, which is the
    /// distance of an empty slot.
    #[inline(always)]
    fn limits(&self, limit: f64) -> Limits {
        let limit = limit * self.scale + self.margin;
        let square = |limit: f64| ((limit * limit) as f32).next_up();
        // Not for NaN.
        if self.largest < near_test::MOST {
            let bound = limit + near_test::MARGIN * f64::from(self.largest);
            Limits {
                boxes: square(limit).min(f32::MAX),
                bounds: square(bound).max(near_test::LEAST),
                reach2: f32::INFINITY,
            }
        } else {
            Limits {
                boxes: square(limit),
                bounds: f32::INFINITY,
                // No distance in single precision means anything.
                reach2: f32::NEG_INFINITY,
            }
        }
    }

    /// Distance in the world that a triangle surely is within: see [`Bounds::most2`].
    #[inline(always)]
    fn reach(&self, most2: f32) -> f64 {
        let margin = near_test::MARGIN * f64::from(self.largest);
        math::sqrt(most2.max(near_test::LEAST).into()) * (1.0 + 1e-6) + margin
    }
}

fn largest(point: [f32; 3], reach: f32) -> f32 {
    point.iter().fold(reach, |largest, x| largest.max(x.abs()))
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
    pub tree: &'a WideTree<'a, N>,
    pub point: [f32; 3],
    pub memory: &'a mut Memory,
    pub seeker: &'a mut dyn Seeker,
}

impl<const N: usize> WithSimd<N> for Search<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let Self { tree, seeker, .. } = self;
        let space = Space::world(self.point, tree.reach);
        let items = u64::at_least(self.memory, stack_size(N, tree.depth));
        walk::<S, N, true>(simd, tree, (Child::ROOT, &space), (items, 0), seeker);
    }
}

/// Visits what is below a child, nearest first. Only in the world are there instances. The stack begins at an item of
/// the memory.
#[inline(always)]
fn walk<S: Simd + Width<N>, const N: usize, const WORLD: bool>(
    simd: S,
    tree: &WideTree<N>,
    (root, space): (Child, &Space<'_>),
    (items, base): (&mut [u64], usize),
    seeker: &mut dyn Seeker,
) {
    let mut limits = space.limits(seeker.limit());
    let mut waiting = Waiting::NONE;
    let mut stack = Stack::new(&mut *items, base);
    let mut next = root;
    loop {
        let improved = match next.kind() {
            ChildKind::Inner(index) => {
                let node = &tree.nodes[index];
                let distances2 = distances2::<N, NodeLanes<S, N>>(simd, &node.planes, space.point);
                let near = distances2.le(NodeLanes::<S, N>::splat(simd, limits.boxes));
                next = u64::push_pop(&mut stack, node, near, distances2);
                if let Some(item) = stack.peek() {
                    prefetch_leaf(simd, tree, item.child());
                }
                continue;
            }
            ChildKind::Leaf(leaf) => match triangles_of(tree, leaf) {
                Some(block) => {
                    if waiting.is_full() {
                        waiting.measure(tree, space, &mut limits, seeker);
                    }
                    let reach2 = waiting.add(simd, block, (next, space.point), limits.bounds);
                    if !WORLD {
                        // How far that is in the world depends on the direction.
                        waiting.measure(tree, space, &mut limits, seeker)
                    } else if reach2 < limits.reach2 {
                        seeker.cap(space.reach(reach2));
                        limits = Limits {
                            reach2,
                            ..space.limits(seeker.limit())
                        };
                        true
                    } else {
                        false
                    }
                }
                None => offer_others(tree, leaf, space, &mut limits, seeker),
            },
            ChildKind::Instance(_) if next == Child::DONE => {
                waiting.measure(tree, space, &mut limits, seeker);
                return;
            }
            ChildKind::Instance(index) => {
                // Above what is left in the world.
                let top = stack.top();
                if WORLD {
                    let placed = &tree.instances[index];
                    let affine = Affine::new(&placed.world_from_object);
                    let place = Place {
                        affine: Some(&affine),
                        ..space.place
                    };
                    let placement = &placed.placement;
                    let inside = Space::object(place, &affine, placement.inst_id, placement.reach);
                    let memory = (&mut *items, top as usize);
                    object(simd, tree, (Child(placed.root), &inside), memory, seeker);
                }
                limits = Limits {
                    reach2: limits.reach2,
                    ..space.limits(seeker.limit())
                };
                stack = Stack::resume(&mut *items, base, top);
                true
            }
        };
        if improved {
            stack.cull(simd, limits.boxes);
        }
        next = stack.pop().child();
    }
}

/// Visits the tree of an object.
#[inline(always)]
fn object<S: Simd + Width<N>, const N: usize>(
    simd: S,
    tree: &WideTree<N>,
    root: (Child, &Space<'_>),
    memory: (&mut [u64], usize),
    seeker: &mut dyn Seeker,
) {
    walk::<S, N, false>(simd, tree, root, memory, seeker);
}

/// Squares of the distances from a point to boxes, given as planes, or a little less.
#[inline(always)]
fn distances2<const L: usize, V: Lanes<L>>(
    token: V::Token,
    planes: &[[[f32; L]; 2]; 3],
    point: [f32; 3],
) -> V {
    let x = outside::<L, V>(token, &planes[0], point[0]);
    let y = outside::<L, V>(token, &planes[1], point[1]);
    let z = outside::<L, V>(token, &planes[2], point[2]);
    x * x + y * y + z * z
}

/// How far a coordinate is outside of intervals.
#[inline(always)]
fn outside<const L: usize, V: Lanes<L>>(token: V::Token, [low, high]: &[[f32; L]; 2], x: f32) -> V {
    let at = V::splat(token, x);
    let below = V::load(token, low) - at;
    let above = at - V::load(token, high);
    // Also 0 for NaN, of a lane without a box.
    below.max(above).max(V::splat(token, 0.0))
}

/// The triangles of a leaf, if it has any.
#[inline(always)]
fn triangles_of<'a, const N: usize>(
    tree: &'a WideTree<'_, N>,
    Leaf { kind, index }: Leaf,
) -> Option<&'a TriangleBlock> {
    match kind {
        PrimKind::Triangle => Some(&tree.blocks.triangles[index]),
        PrimKind::Cutout => Some(&tree.blocks.cutouts[index].triangles),
        _ => None,
    }
}

/// Triangles that may be near enough, and wait to be measured in double precision: when all leaves have been
/// visited, few are left that still may be.
struct Waiting {
    len: usize,
    triangles: [Lane; Self::MOST],
}

/// A triangle in a leaf.
#[derive(Clone, Copy)]
struct Lane {
    /// Square of the lower bound of its distance.
    bound2: f32,
    leaf: Child,
    lane: usize,
}

impl Waiting {
    const MOST: usize = 32;
    const NONE: Self = Self {
        len: 0,
        triangles: [Lane {
            bound2: 0.0,
            leaf: Child::EMPTY,
            lane: 0,
        }; Self::MOST],
    };

    /// Whether another block may be too much.
    #[inline(always)]
    fn is_full(&self) -> bool {
        self.len > Self::MOST - BLOCK
    }

    /// Adds the triangles of a leaf that may be near enough. Returns the square of a distance within which one of them
    /// is, but for rounding.
    #[inline(always)]
    fn add<S: Simd>(
        &mut self,
        simd: S,
        block: &TriangleBlock,
        (leaf, point): (Child, [f32; 3]),
        limit2: f32,
    ) -> f32 {
        let corners = block.corners_on(simd, [0, 1, 2]);
        let first = corners[0][0];
        let bounds = Bounds::of::<BLOCK>(simd, &corners, point);
        let near = bounds.least2.le(Vector::<S>::splat(simd, limit2));
        // Empty lanes are NaN.
        let near = (near & first.eq(first)).bits();
        let mut reach2 = f32::INFINITY;
        if near != 0 {
            let (mut least2, mut most2) = ([0.0; BLOCK], [0.0; BLOCK]);
            bounds.least2.store(&mut least2);
            bounds.most2.store(&mut most2);
            for lane in LanesOf::<BLOCK>(near) {
                self.triangles[self.len % Self::MOST] = Lane {
                    bound2: least2[lane],
                    leaf,
                    lane,
                };
                self.len += 1;
                // Not for NaN.
                if most2[lane] < reach2 {
                    reach2 = most2[lane];
                }
            }
        }
        reach2
    }

    /// Measures and forgets the triangles. Returns whether the limits have shrunk.
    #[inline(never)]
    fn measure<const N: usize>(
        &mut self,
        tree: &WideTree<N>,
        space: &Space<'_>,
        limits: &mut Limits,
        seeker: &mut dyn Seeker,
    ) -> bool {
        let mut improved = false;
        // The last ones are likely to be the nearest.
        for lane in self.triangles[..self.len].iter().rev() {
            if lane.bound2 <= limits.bounds
                && let ChildKind::Leaf(leaf) = lane.leaf.kind()
                && let Some(block) = triangles_of(tree, leaf)
                && offer(block, lane.lane, space, seeker)
            {
                *limits = Limits {
                    reach2: limits.reach2,
                    ..space.limits(seeker.limit())
                };
                improved = true;
            }
        }
        self.len = 0;
        improved
    }
}

/// Offers the primitives of a leaf of any kind whose boxes may be near enough.
#[cold]
#[inline(never)]
fn offer_others<const N: usize>(
    tree: &WideTree<N>,
    leaf: Leaf,
    space: &Space<'_>,
    limits: &mut Limits,
    seeker: &mut dyn Seeker,
) -> bool {
    on_leaf!(tree, leaf, block => {
        let planes = block.planes();
        let distances2 = distances2::<BLOCK, <Scalar as Width<BLOCK>>::Lanes>(Scalar, &planes, space.point);
        let mut distances = [0.0; BLOCK];
        distances2.store(&mut distances);
        let mut improved = false;
        for lane in 0..block.count() {
            if distances[lane] <= limits.boxes && offer(block, lane, space, seeker) {
                *limits = Limits {
                    reach2: limits.reach2,
                    ..space.limits(seeker.limit())
                };
                improved = true;
            }
        }
        improved
    })
}

#[inline(always)]
fn offer<B: LeafBlock>(block: &B, lane: usize, space: &Space<'_>, seeker: &mut dyn Seeker) -> bool {
    let near = || block.near(lane, &space.place);
    if let Some(reach) = seeker.of_reach() {
        reach.measure(B::KIND, &space.place, near, || block.bounds(lane));
        return false;
    }
    near().is_some_and(|near| {
        seeker.offer(Candidate {
            near,
            id: block.id(lane),
            inst_id: space.inst_id,
        })
    })
}
