//! Packets: rays that go the same way, side by side through the tree.
//!
//! Sixteen consecutive rays whose directions have the same signs and the same largest component, and whose origins and
//! directions are close together, share their way. A frustum around them is tested against all boxes of a node in
//! one go, as a ray would be, and again against the boxes of the triangles of a leaf; each triangle that is left is
//! tested against all rays, with a lane for each. So a node costs sixteen rays as much as one, and what is tested in
//! vain is little as long as they stay together.
//!
//! Rays of other kinds are left over for [`crate::trace::stream`], and so are packets that visit too much, or anything
//! but triangles and nodes: they start from scratch there. Where packets do not pay they are soon hardly tried any more.
//!
//! `rays` says how rays are made ready, and why no box is missed.

use alloc::vec::Vec;

mod beams;
mod fans;
pub(crate) mod group;
mod rays;
pub(crate) mod sheaf;

use antumbra_simd::{Lanes, Mask, Simd, Width, WithSimd};

use crate::geometry::edge_test::{Corners, Edges, Ends, Verdict};
use crate::geometry::leaf_block::LeafBlock;
use crate::geometry::primitives::PrimKind;
use crate::geometry::triangle::{LanesOf, TriangleBlock};
use crate::geometry::triangle_hit::{ShearedTriangle, distances};
use crate::geometry::{BLOCK, PrimRef};
use crate::prim_id::PrimId;
use crate::ray::{Hit, INVALID_ID};
use crate::trace::condition::Condition;
use crate::trace::judge;
use crate::trace::packet::rays::{
    Frustum, LeafRays, PacketRays, RAYS, RayLanes, Row, row, touched,
};
use crate::trace::pick::Children;
use crate::trace::query::{Closest, Occlusion, Query};
use crate::trace::ray_batch::{LocatedHit, RayBatch};
use crate::trace::stack::Stack;
use crate::tree::node::{Child, ChildKind, Leaf};
use crate::tree::wide::WideTree;

/// Fewest rays that make a packet. Fewer are left to others.
const FEW: u32 = 4;

/// Whether packets have paid so far. A packet that does not pay costs about as much as one that does saves, so they
/// are tried as long as half of them do, and otherwise ever more rarely.
#[derive(Clone, Copy, Default)]
struct Luck {
    /// Packets that have paid less those that have not, within limits.
    score: i32,
    /// Groups of rays to pass by before a packet is tried again.
    wait: u32,
}

impl Luck {
    const MOST: i32 = 4;
    /// Every 2⁶th group is tried at least.
    const LEAST: i32 = -6;

    /// Whether to try the next group.
    #[inline(always)]
    fn tries(&mut self) -> bool {
        let tries = self.wait == 0;
        self.wait -= u32::from(!tries);
        tries
    }

    /// Counts a group that has been tried, and whether that paid.
    #[inline(always)]
    fn count(&mut self, paid: bool) {
        let change = if paid { 1 } else { -1 };
        self.score = (self.score + change).clamp(Self::LEAST, Self::MOST);
        self.wait = (1 << (-self.score).max(0)) - 1;
    }
}

/// A packet ready to be traced.
pub(crate) struct Packet<'a, const N: usize> {
    bvh: &'a WideTree<'a, N>,
    rays: &'a PacketRays,
    frustum: &'a Frustum,
    /// Lanes whose rays are traced, as bits.
    lanes: u32,
    batch: &'a RayBatch<'a>,
    /// Index of the ray in lane 0.
    first: usize,
}

impl<const N: usize> Packet<'_, N> {
    /// The lanes, among `lanes`, where a hit on a triangle of a block fulfils the condition of the ray. Reports these
    /// occluders.
    #[cold]
    #[inline(never)]
    fn occluders(
        &self,
        block: &TriangleBlock,
        triangle: usize,
        axes: [usize; 3],
        lanes: u32,
    ) -> u32 {
        let corners = block.corners_of(triangle, axes);
        let PrimRef { geom_id, prim_id } = block.id(triangle).told();
        let id = PrimId {
            inst_id: INVALID_ID,
            geom_id,
            prim_id,
        };
        let mut counting = 0;
        for lane in LanesOf::<RAYS>(lanes) {
            let index = self.first + lane;
            let hit = || {
                let ray = self.rays.sheared(lane, axes);
                let t = ShearedTriangle::new(&corners, &ray).distance(&ray)?;
                let ray = &self.batch.rays[index];
                Some(block.refined_hit(triangle, ray, t).told())
            };
            let occludes = |condition: &Condition<'_>| judge::occludes(id, condition, || true, hit);
            if self.batch.with_condition(index, occludes) {
                self.batch.report_occluder(index, id);
                counting |= 1 << lane;
            }
        }
        counting
    }

    /// Whether a hit of the ray in a lane on a triangle of a block, decided at the distance `t`, fulfils its condition.
    #[cold]
    #[inline(never)]
    fn counts(&self, lane: usize, block: &TriangleBlock, triangle: usize, t: f32) -> bool {
        let index = self.first + lane;
        let found = block.refined_hit(triangle, &self.batch.rays[index], t);
        (self.batch).with_condition(index, |condition| {
            condition.may_count(PrimId::from(found.told())) && judge::counts(&found, condition)
        })
    }
}

/// A query that can be answered in packets.
pub(crate) trait PacketQuery: Query {
    /// Traces a packet and writes the answers of its rays. Returns the lanes whose rays are left undecided. `guess` is
    /// the block of triangles that occluded the packet before, if that may be of use, and is set to the block
    /// that occludes this one.
    fn traverse<S: Simd + Width<N>, const N: usize>(
        simd: S,
        packet: &Packet<'_, N>,
        leaf_rays: &LeafRays<S>,
        stack: &mut [Self::Item],
        answers: &mut [Self::Answer; RAYS],
        guess: &mut Option<u32>,
    ) -> u32;
}

/// Answers the rays that go in packets, and lists the others.
pub(crate) struct Packets<'a, Q: PacketQuery, const N: usize> {
    pub bvh: &'a WideTree<'a, N>,
    /// Memory of a stack for this tree.
    pub stack: &'a mut [Q::Item],
    pub batch: &'a RayBatch<'a>,
    /// One answer for each ray of the batch.
    pub answers: &'a mut [Q::Answer],
    /// Indices of the rays that are left are appended here.
    pub pending: &'a mut Vec<u32>,
}

impl<Q: PacketQuery, const N: usize> WithSimd<N> for Packets<'_, Q, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<N>>(self, simd: S) {
        let Self {
            bvh,
            stack,
            batch,
            answers,
            pending,
        } = self;
        let mut packet_rays = PacketRays::IDLE;
        let mut rows: [Row; RAYS] = [[0.0; 8]; RAYS];
        let (groups, _) = answers.as_chunks_mut::<RAYS>();
        let grouped = groups.len() * RAYS;
        let (mut luck, mut guess) = (Luck::default(), None);
        for (index, answers) in groups.iter_mut().enumerate() {
            let first = (index * RAYS) as u32;
            if !luck.tries() {
                pending.extend(first..first + RAYS as u32);
                continue;
            }
            for lane in 0..RAYS {
                rows[lane] = row(&batch.rays[index * RAYS + lane]);
                answers[lane] = Q::miss();
            }
            packet_rays.set(simd, &rows, bvh.reach);
            let rays = &packet_rays;
            let (mut todo, mut left) = (rays.tame, rays.valid & !rays.tame);
            while todo.count_ones() >= FEW {
                let (likeness, alike) = rays.alike(todo.trailing_zeros());
                let lanes = todo & alike;
                todo &= !lanes;
                if lanes.count_ones() < FEW {
                    left |= lanes;
                    continue;
                }
                let Some(frustum) = &Frustum::around(simd, &rows, lanes, likeness, bvh.reach)
                else {
                    left |= lanes;
                    continue;
                };
                let leaf_rays = LeafRays::new(simd, rays, likeness);
                let packet = Packet {
                    bvh,
                    rays,
                    frustum,
                    lanes,
                    batch,
                    first: index * RAYS,
                };
                left |= Q::traverse::<S, N>(simd, &packet, &leaf_rays, stack, answers, &mut guess);
                if !batch.is_alike() {
                    guess = None;
                }
            }
            left |= todo;
            luck.count(left.count_ones() as usize <= RAYS / 2);
            pending.extend(LanesOf::<RAYS>(left).map(|lane| first + lane as u32));
        }
        pending.extend(grouped as u32..batch.rays.len() as u32);
    }
}

impl PacketQuery for Occlusion {
    #[inline(always)]
    fn traverse<S: Simd + Width<N>, const N: usize>(
        simd: S,
        packet: &Packet<'_, N>,
        leaf_rays: &LeafRays<S>,
        stack: &mut [u32],
        answers: &mut [bool; RAYS],
        guess: &mut Option<u32>,
    ) -> u32 {
        let way = occlude(simd, packet, leaf_rays, stack, guess);
        for lane in 0..RAYS {
            answers[lane] |= way.occluded >> lane & 1 == 1;
        }
        way.left
    }
}

/// Result of a traced packet, as lanes.
struct Occluded {
    occluded: u32,
    /// Rays without an answer, to be traced one by one.
    left: u32,
    /// Boxes of nodes, leaves and triangles tested, in units of a node.
    work: u32,
}

/// Occlusion of a packet. The block of triangles that occluded others before is tested first, and becomes the one that
/// occludes the last of these, if the tree is searched.
#[inline(always)]
fn occlude<S: Simd + Width<N>, const N: usize>(
    simd: S,
    packet: &Packet<'_, N>,
    leaf_rays: &LeafRays<S>,
    stack: &mut [u32],
    guess: &mut Option<u32>,
) -> Occluded {
    let guessed = guessed(simd, packet, leaf_rays, *guess);
    if packet.lanes & !guessed == 0 {
        return Occluded {
            occluded: guessed,
            left: 0,
            work: 0,
        };
    }
    let (way, block) = find_occluders(simd, packet, leaf_rays, stack, packet.lanes & !guessed);
    *guess = block;
    Occluded {
        occluded: way.occluded | guessed,
        ..way
    }
}

/// The rays of a packet that a block of triangles occludes.
#[inline(always)]
fn guessed<S: Simd, const N: usize>(
    simd: S,
    packet: &Packet<'_, N>,
    leaf_rays: &LeafRays<S>,
    block: Option<u32>,
) -> u32 {
    let Some(block) = block else {
        return 0;
    };
    let block = &packet.bvh.blocks.triangles[block as usize];
    let test = packet.frustum.test::<S, BLOCK>(simd);
    let near = touched(simd, &test, block, packet.frustum.tfar).bits();
    packet.lanes & occluded(simd, block, packet, leaf_rays, near, packet.lanes)
}

/// Occlusion of the rays in `lanes`, and the block of triangles that occluded the last of them.
#[inline(always)]
fn find_occluders<S: Simd + Width<N>, const N: usize>(
    simd: S,
    packet: &Packet<'_, N>,
    leaf_rays: &LeafRays<S>,
    stack: &mut [u32],
    lanes: u32,
) -> (Occluded, Option<u32>) {
    /// Work after which the rays go on each for itself.
    const MOST: u32 = 60;

    let &Packet { bvh, frustum, .. } = packet;
    let mut stack = Stack::new(stack, 0);
    let nodes = frustum.test::<S, N>(simd);
    let triangles = frustum.test::<S, BLOCK>(simd);
    let mut active = lanes;
    let mut left = lanes;
    let (mut last, mut work) = (None, 0);
    let mut next = Child::ROOT;
    while work < MOST {
        work += 1;
        match next.kind() {
            ChildKind::Inner(index) => {
                let node = &bvh.nodes[index];
                let (mask, _) = nodes.step(simd, &node.planes, frustum.tfar);
                let count = mask.compress(&node.children, stack.window());
                stack.grow(count);
            }
            ChildKind::Leaf(Leaf {
                kind: PrimKind::Triangle,
                index,
            }) => {
                let block = &bvh.blocks.triangles[index];
                let touched = touched(simd, &triangles, block, frustum.tfar).bits();
                work += touched.count_ones();
                let found = occluded(simd, block, packet, leaf_rays, touched, active);
                if found & active != 0 {
                    last = Some(index as u32);
                }
                active &= !found;
                if active == 0 {
                    left = 0;
                    break;
                }
            }
            ChildKind::Instance(_) if next == Child::DONE => {
                left = 0;
                break;
            }
            ChildKind::Leaf(_) | ChildKind::Instance(_) => break,
        }
        next = Child(stack.pop());
    }
    let way = Occluded {
        occluded: lanes & !active,
        left: left & active,
        work,
    };
    (way, last)
}

/// The rays that some of the triangles of a block occlude, as bits. Rays outside of `active` may be left out.
#[inline(always)]
fn occluded<S: Simd, const N: usize>(
    simd: S,
    block: &TriangleBlock,
    packet: &Packet<'_, N>,
    leaf_rays: &LeafRays<S>,
    triangles: u32,
    active: u32,
) -> u32 {
    let is_conditional = packet.batch.is_conditional();
    let mut occluded = 0;
    for lane in LanesOf::<BLOCK>(triangles) {
        let corners = corners(simd, block, lane, leaf_rays.axes);
        let sheared = leaf_rays.shear.of::<RAYS>(&corners);
        let edges = Edges::new::<RAYS>(&sheared, leaf_rays.shear.per_z());
        let Verdict { sure, possible } = edges.judge::<RAYS>(simd, &leaf_rays.ends);
        let axes = leaf_rays.axes;
        let mut found = sure.bits();
        let doubtful = possible.bits() & active & !(occluded | found);
        if doubtful != 0 {
            found |= settled(block, lane, packet.rays, axes, doubtful);
        }
        if is_conditional {
            found &= active & !occluded;
            if found != 0 {
                found = packet.occluders(block, lane, axes, found);
            }
        }
        occluded |= found;
    }
    occluded
}

/// Rays that hit a triangle, among `lanes`.
#[cold]
#[inline(never)]
fn settled(
    block: &TriangleBlock,
    triangle: usize,
    rays: &PacketRays,
    axes: [usize; 3],
    lanes: u32,
) -> u32 {
    let corners = block.corners_of(triangle, axes);
    let mut hits = 0;
    for lane in LanesOf::<RAYS>(lanes) {
        let ray = rays.sheared(lane, axes);
        let is_hit = ShearedTriangle::new(&corners, &ray)
            .distance(&ray)
            .is_some();
        hits |= u32::from(is_hit) << lane;
    }
    hits
}

impl PacketQuery for Closest {
    #[inline(always)]
    fn traverse<S: Simd + Width<N>, const N: usize>(
        simd: S,
        packet: &Packet<'_, N>,
        leaf_rays: &LeafRays<S>,
        stack: &mut [u64],
        answers: &mut [Option<Hit>; RAYS],
        _: &mut Option<u32>,
    ) -> u32 {
        /// Nodes and leaves after which the rays go on each for itself.
        const MAX_STEPS: usize = 100;

        let &Packet {
            bvh,
            frustum,
            lanes,
            batch,
            first,
            ..
        } = packet;
        let mut best = BestOfLanes::new(simd, leaf_rays.ends.tfar, lanes);
        let mut stack = Stack::<u64>::new(stack, 0);
        let nodes = frustum.test::<S, N>(simd);
        let triangles = frustum.test::<S, BLOCK>(simd);
        let mut next = Child::ROOT;
        for _ in 0..MAX_STEPS {
            match next.kind() {
                ChildKind::Inner(index) => {
                    let node = &bvh.nodes[index];
                    let (mask, entry) = nodes.step(simd, &node.planes, best.limit);
                    u64::push(&mut stack, node, mask, entry);
                }
                ChildKind::Leaf(Leaf {
                    kind: PrimKind::Triangle,
                    index,
                }) => {
                    let block = &bvh.blocks.triangles[index];
                    let touched = touched(simd, &triangles, block, best.limit);
                    if best.improve(simd, (block, next), packet, leaf_rays, touched.bits()) {
                        // At least 0, because the rays begin there.
                        stack.cull(simd, best.limit);
                    }
                }
                ChildKind::Instance(_) if next == Child::DONE => {
                    for lane in LanesOf::<RAYS>(best.found) {
                        let (leaf, triangle) = (best.leaves[lane], best.triangles[lane]);
                        let block = &bvh.blocks.triangles[leaf.index()];
                        let (ray, t) = (&batch.rays[first + lane], best.distances[lane]);
                        let hit = block.refined_hit(triangle as usize, ray, t);
                        answers[lane] = Some(hit.told());
                        if batch.reports_surfaces() {
                            let found = LocatedHit {
                                hit,
                                leaf,
                                instance: LocatedHit::WORLD,
                            };
                            batch.report_surface(first + lane, &found);
                        }
                    }
                    return 0;
                }
                ChildKind::Leaf(_) | ChildKind::Instance(_) => break,
            }
            next = Child(stack.pop() as u32);
        }
        lanes
    }
}

/// The best hits of a packet so far.
struct BestOfLanes {
    /// Per lane, the distance beyond which nothing is of interest: negative in lanes without a ray.
    distances: [f32; RAYS],
    /// The largest of `distances`.
    limit: f32,
    /// Lanes with a hit, as bits.
    found: u32,
    /// Per lane, the name of the triangle hit, its leaf and its place there.
    ids: [PrimRef; RAYS],
    leaves: [Child; RAYS],
    triangles: [u32; RAYS],
}

impl BestOfLanes {
    #[inline(always)]
    fn new<S: Simd>(simd: S, tfar: RayLanes<S>, lanes: u32) -> Self {
        let mut best = Self {
            distances: [0.0; RAYS],
            limit: 0.0,
            found: 0,
            ids: [PrimRef {
                geom_id: INVALID_ID,
                prim_id: INVALID_ID,
            }; RAYS],
            leaves: [Child::EMPTY; RAYS],
            triangles: [0; RAYS],
        };
        tfar.store(&mut best.distances);
        for lane in 0..RAYS {
            if lanes >> lane & 1 == 0 {
                best.distances[lane] = f32::NEG_INFINITY;
            }
        }
        best.set_limit(simd);
        best
    }

    #[inline(always)]
    fn set_limit<S: Simd>(&mut self, simd: S) {
        type Vector<S> = <S as Width<4>>::Lanes;
        let (quarters, _) = self.distances.as_chunks::<4>();
        let a = Vector::<S>::load(simd, &quarters[0]);
        let b = Vector::<S>::load(simd, &quarters[1]);
        let c = Vector::<S>::load(simd, &quarters[2]);
        let d = Vector::<S>::load(simd, &quarters[3]);
        let mut most = [0.0; 4];
        a.max(b).max(c.max(d)).store(&mut most);
        let [a, b, c, d] = most;
        self.limit = crate::geometry::ray_setup::max(
            crate::geometry::ray_setup::max(a, b),
            crate::geometry::ray_setup::max(c, d),
        );
    }

    /// Takes those hits on triangles of the block that precede the best so far; whether there are any.
    #[inline(always)]
    fn improve<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        (block, leaf): (&TriangleBlock, Child),
        packet: &Packet<'_, N>,
        leaf_rays: &LeafRays<S>,
        triangles: u32,
    ) -> bool {
        let is_conditional = packet.batch.is_conditional();
        let zero = RayLanes::<S>::splat(simd, 0.0);
        let mut improved = false;
        for triangle in LanesOf::<BLOCK>(triangles) {
            let corners = corners(simd, block, triangle, leaf_rays.axes);
            let sheared = leaf_rays.shear.of::<RAYS>(&corners);
            let edges = Edges::new::<RAYS>(&sheared, leaf_rays.shear.per_z());
            if !edges.inside::<RAYS>(zero).any() {
                continue;
            }
            let limits = RayLanes::<S>::load(simd, &self.distances);
            let Ends { tnear, tfar } = leaf_rays.ends;
            let ends = Ends {
                tnear,
                tfar: limits,
            };
            let Verdict { possible, .. } = edges.judge::<RAYS>(simd, &ends);
            if !possible.any() {
                continue;
            }
            let (t, inside) = distances(simd, &sheared, leaf_rays.shear.per_z());
            let hits = (inside & tnear.lt(t) & t.lt(tfar) & t.le(limits)).bits();
            if hits == 0 {
                continue;
            }
            let mut distances = [0.0; RAYS];
            t.store(&mut distances);
            let id = block.id(triangle);
            for lane in LanesOf::<RAYS>(hits) {
                let (bit, t) = (1 << lane, distances[lane]);
                // In the order of hits, all of them in the world.
                let precedes = self.found & bit == 0
                    || (t, id.geom_id, id.prim_id)
                        < (
                            self.distances[lane],
                            self.ids[lane].geom_id,
                            self.ids[lane].prim_id,
                        );
                if precedes && (!is_conditional || packet.counts(lane, block, triangle, t)) {
                    self.ids[lane] = id;
                    self.leaves[lane] = leaf;
                    self.triangles[lane] = triangle as u32;
                    self.distances[lane] = t;
                    self.found |= bit;
                    improved = true;
                }
            }
        }
        if improved {
            self.set_limit(simd);
        }
        improved
    }
}

/// A triangle in all lanes, on these axes.
#[inline(always)]
fn corners<S: Simd>(
    simd: S,
    block: &TriangleBlock,
    lane: usize,
    axes: [usize; 3],
) -> Corners<RayLanes<S>> {
    let [xs, ys, zs] = [
        &block.corners[axes[0]],
        &block.corners[axes[1]],
        &block.corners[axes[2]],
    ];
    [
        [
            RayLanes::<S>::splat(simd, xs[0][lane]),
            RayLanes::<S>::splat(simd, xs[1][lane]),
            RayLanes::<S>::splat(simd, xs[2][lane]),
        ],
        [
            RayLanes::<S>::splat(simd, ys[0][lane]),
            RayLanes::<S>::splat(simd, ys[1][lane]),
            RayLanes::<S>::splat(simd, ys[2][lane]),
        ],
        [
            RayLanes::<S>::splat(simd, zs[0][lane]),
            RayLanes::<S>::splat(simd, zs[1][lane]),
            RayLanes::<S>::splat(simd, zs[2][lane]),
        ],
    ]
}
