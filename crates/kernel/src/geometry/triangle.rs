//! Triangles: leaf block and exact test.
//!
//! The test is that of Woop, Benthin and Wald (2013, "Watertight Ray/Triangle Intersection", JCGT 2(1)):
//! translate to the ray's origin, shear so that the ray runs along z, decide by the signs of three edge
//! functions in 2D. Two deviations. Zero counts as inside on both sides, without their fallback to double
//! precision: triangles that share an edge or a corner see the same sheared points, and rounding is
//! monotonic, so the exact sign is never contradicted, only lost to zero. And `t` is clamped into the
//! interval of the triangle's box, see [`crate::trace::setup`].

use antumbra_simd::{Lanes, Mask, Simd, Width};

use super::{BLOCK, PrimRef};
use crate::aabb::Aabb;
use crate::ray::{Hit, INVALID_ID};
use crate::trace::best::Best;
use crate::trace::setup::RaySetup;

/// Up to [`BLOCK`] triangles of a leaf: planar, so that the shear's choice of axes is only an address.
///
/// 352 bytes: 288 of coordinates, then the ids. Empty lanes are NaN, which no comparison accepts.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(crate) struct TriangleBlock {
    /// `[axis][corner][lane]`.
    pub corners: [[[f32; BLOCK]; 3]; 3],
    pub geom_ids: [u32; BLOCK],
    pub prim_ids: [u32; BLOCK],
}

type Vector<S> = <S as Width<BLOCK>>::Lanes;
type Truths<S> = <Vector<S> as Lanes<BLOCK>>::Mask;

/// The part of the test that all lanes go through: the edge functions and who is inside.
struct Edges<S: Simd> {
    u: Vector<S>,
    v: Vector<S>,
    w: Vector<S>,
    /// z of the corners relative to the origin, not yet in units of `t`.
    z: [Vector<S>; 3],
    inside: Truths<S>,
    /// Inside and on no edge.
    strictly_inside: Truths<S>,
}

/// The rest, needed only when some lane is inside.
struct Distances<S: Simd> {
    det: Vector<S>,
    t: Vector<S>,
    /// Smallest and largest `t` of the three corners.
    t_min: Vector<S>,
    t_max: Vector<S>,
}

/// Where a ray hits the triangles of a block.
pub(crate) struct BlockHits {
    /// Bit per lane: whether it is hit.
    hits: u32,
    t: [f32; BLOCK],
    /// Edge functions; the barycentric weights when divided by their sum.
    v: [f32; BLOCK],
    w: [f32; BLOCK],
    det: [f32; BLOCK],
}

impl BlockHits {
    /// The lanes that are hit, in ascending order.
    #[inline(always)]
    pub fn lanes(&self) -> HitLanes {
        HitLanes(self.hits)
    }
}

/// See [`BlockHits::lanes`].
pub(crate) struct HitLanes(u32);

impl Iterator for HitLanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let lane = self.0.trailing_zeros() as usize;
        self.0 &= self.0.wrapping_sub(1);
        (lane < BLOCK).then_some(lane)
    }
}

impl TriangleBlock {
    pub const EMPTY: Self = Self {
        corners: [[[f32::NAN; BLOCK]; 3]; 3],
        geom_ids: [u32::MAX; BLOCK],
        prim_ids: [u32::MAX; BLOCK],
    };

    /// Puts a triangle into a lane.
    pub fn set(&mut self, lane: usize, corners: &[[f32; 3]; 3], id: PrimRef) {
        for axis in 0..3 {
            for corner in 0..3 {
                self.corners[axis][corner][lane] = corners[corner][axis];
            }
        }
        self.geom_ids[lane] = id.geom_id;
        self.prim_ids[lane] = id.prim_id;
    }

    /// The corners of a lane; NaN for an empty one.
    pub fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        core::array::from_fn(|corner| core::array::from_fn(|axis| self.corners[axis][corner][lane]))
    }

    /// How many lanes hold a triangle; they come first.
    pub fn count(&self) -> usize {
        self.prim_ids
            .iter()
            .take_while(|id| **id != u32::MAX)
            .count()
    }

    pub fn bounds(&self) -> Aabb {
        (0..self.count()).fold(Aabb::EMPTY, |bounds, lane| {
            bounds.union(&Aabb::around(&self.triangle(lane)))
        })
    }

    /// Puts the triangle of lane `lanes[i]` into lane `i`.
    pub fn permute(&mut self, lanes: &[u8; BLOCK]) {
        let old = self.clone();
        for (lane, &from) in lanes.iter().enumerate() {
            let from = from as usize;
            let id = PrimRef {
                geom_id: old.geom_ids[from],
                prim_id: old.prim_ids[from],
            };
            self.set(lane, &old.triangle(from), id);
        }
    }

    #[inline(always)]
    fn edges<S: Simd>(&self, simd: S, ray: &RaySetup) -> Edges<S> {
        let [x, y, z] = [
            ray.axes[0] as usize,
            ray.axes[1] as usize,
            ray.axes[2] as usize,
        ];
        let ox = Vector::<S>::splat(simd, ray.shear_org[0]);
        let oy = Vector::<S>::splat(simd, ray.shear_org[1]);
        let oz = Vector::<S>::splat(simd, ray.shear_org[2]);
        let sx = Vector::<S>::splat(simd, ray.shear[0]);
        let sy = Vector::<S>::splat(simd, ray.shear[1]);
        let [xs, ys, zs] = [&self.corners[x], &self.corners[y], &self.corners[z]];

        let az = Vector::<S>::load(simd, &zs[0]) - oz;
        let bz = Vector::<S>::load(simd, &zs[1]) - oz;
        let cz = Vector::<S>::load(simd, &zs[2]) - oz;
        let ax = (Vector::<S>::load(simd, &xs[0]) - ox) - sx * az;
        let ay = (Vector::<S>::load(simd, &ys[0]) - oy) - sy * az;
        let bx = (Vector::<S>::load(simd, &xs[1]) - ox) - sx * bz;
        let by = (Vector::<S>::load(simd, &ys[1]) - oy) - sy * bz;
        let cx = (Vector::<S>::load(simd, &xs[2]) - ox) - sx * cz;
        let cy = (Vector::<S>::load(simd, &ys[2]) - oy) - sy * cz;

        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let least = u.min(v.min(w));
        let most = u.max(v.max(w));
        let zero = Vector::<S>::splat(simd, 0.0);
        Edges {
            u,
            v,
            w,
            z: [az, bz, cz],
            inside: zero.le(least) | most.le(zero),
            strictly_inside: zero.lt(least) | most.lt(zero),
        }
    }

    #[inline(always)]
    fn distances<S: Simd>(simd: S, ray: &RaySetup, edges: &Edges<S>) -> Distances<S> {
        let sz = Vector::<S>::splat(simd, ray.shear[2]);
        let [az, bz, cz] = [edges.z[0] * sz, edges.z[1] * sz, edges.z[2] * sz];
        let det = (edges.u + edges.v) + edges.w;
        let t = ((edges.u * az + edges.v * bz) + edges.w * cz) / det;
        Distances {
            det,
            t,
            t_min: az.min(bz.min(cz)),
            t_max: az.max(bz.max(cz)),
        }
    }

    /// The first lane found that occludes the ray. In a `WAVE` all lanes go the whole way: leaving early
    /// saves less than a wrong guess costs.
    #[inline(always)]
    pub fn occluded<S: Simd, const WAVE: bool>(&self, simd: S, ray: &RaySetup) -> Option<usize> {
        let edges = self.edges(simd, ray);
        if !WAVE && !edges.inside.any() {
            return None;
        }
        let distances = Self::distances(simd, ray, &edges);
        let tnear = Vector::<S>::splat(simd, ray.tnear);
        let tfar = Vector::<S>::splat(simd, ray.tfar);
        let candidates = edges.inside & tnear.lt(distances.t) & distances.t.lt(tfar);
        // Strictly inside and not close to an end of the interval: `confirm` would agree whatever it clamps,
        // by the argument in `trace::setup`. That is nearly every occluder.
        let zero = Vector::<S>::splat(simd, 0.0);
        let to_end = (distances.t - tnear).min(tfar - distances.t);
        let beyond_doubt = to_end - Vector::<S>::splat(simd, ray.doubt);
        let det = distances.det.max(zero - distances.det);
        let spread = distances.t_max - distances.t_min;
        let doubt = spread * Vector::<S>::splat(simd, ray.doubt_by_spread);
        let sure = candidates & edges.strictly_inside & doubt.lt(det * beyond_doubt);
        let (candidates_bits, sure_bits) = (candidates.bits(), sure.bits());
        // All of the candidates if none is sure, else none of them. As plain conditions this becomes a
        // branch on whether the ray is occluded, which no CPU can guess.
        let doubtful = candidates_bits & sure_bits.wrapping_sub(1) >> BLOCK;
        let found = if doubtful != 0 {
            self.confirm(simd, ray, distances.t, candidates).1.bits()
        } else {
            sure_bits
        };
        (found != 0).then_some(found.trailing_zeros() as usize)
    }

    /// [`RaySetup::confirm`] for all lanes at once: the clamped distances, and which of the candidates are
    /// hits.
    #[inline(always)]
    fn confirm<S: Simd>(
        &self,
        simd: S,
        ray: &RaySetup,
        t: Vector<S>,
        candidates: Truths<S>,
    ) -> (Vector<S>, Truths<S>) {
        let zero = Vector::<S>::splat(simd, 0.0);
        if !ray.culls() {
            return (t + zero, candidates);
        }
        let mut enter = Vector::<S>::splat(simd, f32::NEG_INFINITY);
        let mut leave = Vector::<S>::splat(simd, f32::INFINITY);
        for axis in 0..3 {
            let [a, b, c] = &self.corners[axis];
            let a = Vector::<S>::load(simd, a);
            let b = Vector::<S>::load(simd, b);
            let c = Vector::<S>::load(simd, c);
            let rdir = Vector::<S>::splat(simd, ray.rdir[axis]);
            let [near_offset, far_offset] = ray.prim_offsets(axis);
            // Which plane is the near one follows from the sign of the direction; so does which product is
            // the smaller one.
            let low = a.min(b.min(c)) * rdir;
            let high = a.max(b.max(c)) * rdir;
            enter = enter.max(low.min(high) - Vector::<S>::splat(simd, near_offset));
            leave = leave.min(low.max(high) - Vector::<S>::splat(simd, far_offset));
        }
        let tnear = Vector::<S>::splat(simd, ray.tnear);
        let tfar = Vector::<S>::splat(simd, ray.tfar);
        let t = t.max(enter).min(leave) + zero;
        (t, candidates & enter.le(leave) & tnear.lt(t) & t.lt(tfar))
    }

    /// Replaces `best` by the block's closest hit where that precedes it, and returns whether it did. `WAVE` is
    /// as in [`TriangleBlock::occluded`].
    #[inline(always)]
    pub fn intersect<S: Simd, const WAVE: bool>(
        &self,
        simd: S,
        ray: &RaySetup,
        best: &mut Best,
    ) -> bool {
        let Some(hits) = self.hits::<S, WAVE>(simd, ray, best.limit) else {
            return false;
        };
        let mut improved = false;
        for lane in hits.lanes() {
            improved |= best.offer(self.hit(&hits, lane));
        }
        improved
    }

    /// All hits no farther than `limit`; `None` if there is not even a candidate. `WAVE` is as in
    /// [`TriangleBlock::occluded`].
    #[inline(always)]
    pub fn hits<S: Simd, const WAVE: bool>(
        &self,
        simd: S,
        ray: &RaySetup,
        limit: f32,
    ) -> Option<BlockHits> {
        let edges = self.edges(simd, ray);
        if !WAVE && !edges.inside.any() {
            return None;
        }
        let distances = Self::distances(simd, ray, &edges);
        // Against the whole interval, not against the best so far: what is clamped nearer must not
        // depend on what was found before.
        let tnear = Vector::<S>::splat(simd, ray.tnear);
        let tfar = Vector::<S>::splat(simd, ray.tfar);
        let candidates = edges.inside & tnear.lt(distances.t) & distances.t.lt(tfar);
        if !candidates.any() {
            return None;
        }
        let (t, hits) = self.confirm(simd, ray, distances.t, candidates);
        let hits = hits & t.le(Vector::<S>::splat(simd, limit));
        let mut lanes = [[0.0; BLOCK]; 4];
        t.store(&mut lanes[0]);
        edges.v.store(&mut lanes[1]);
        edges.w.store(&mut lanes[2]);
        distances.det.store(&mut lanes[3]);
        let [t, v, w, det] = lanes;
        let hits = hits.bits();
        Some(BlockHits { hits, t, v, w, det })
    }

    /// One of the hits.
    #[inline(always)]
    pub fn hit(&self, hits: &BlockHits, lane: usize) -> Hit {
        let det = hits.det[lane];
        Hit {
            t: hits.t[lane],
            u: hits.v[lane] / det,
            v: hits.w[lane] / det,
            prim_id: self.prim_ids[lane],
            geom_id: self.geom_ids[lane],
            inst_id: INVALID_ID,
        }
    }
}

/// The same test for one triangle in plain scalar code: what the oracle uses. Returns `(t, u, v)`.
pub(crate) fn hit(corners: &[[f32; 3]; 3], ray: &RaySetup) -> Option<(f32, f32, f32)> {
    let [x, y, z] = ray.axes.map(|axis| axis as usize);
    let [sx, sy, sz] = ray.shear;
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = corners.map(|corner| {
        let along = corner[z] - ray.org[z];
        [
            (corner[x] - ray.org[x]) - sx * along,
            (corner[y] - ray.org[y]) - sy * along,
            along,
        ]
    });
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let inside = u >= 0.0 && v >= 0.0 && w >= 0.0 || u <= 0.0 && v <= 0.0 && w <= 0.0;
    if !inside {
        return None;
    }
    let det = (u + v) + w;
    let t = ((u * (az * sz) + v * (bz * sz)) + w * (cz * sz)) / det;
    if !(ray.tnear < t && t < ray.tfar) {
        return None;
    }
    let t = ray.confirm(&Aabb::around(corners), t)?;
    Some((t, v / det, w / det))
}
