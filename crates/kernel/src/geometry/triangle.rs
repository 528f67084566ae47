//! Triangles: leaf block and exact test.
//!
//! The test is that of Woop, Benthin and Wald (2013, "Watertight Ray/Triangle Intersection", JCGT 2(1)):
//! translate to the ray's origin, shear so that the ray runs along z, decide by the signs of three edge
//! functions in 2D. Two deviations. Zero counts as inside on both sides, without their fallback to double
//! precision: triangles that share an edge or a corner see the same sheared points, and rounding is
//! monotonic, so the exact sign is never contradicted, only lost to zero. And `t` is clamped into the
//! interval of the triangle's box, see [`crate::geometry::ray_setup`].

use antumbra_simd::{Lanes, Mask, Simd, Width};

use crate::aabb::Aabb;
use crate::geometry::best::Best;
use crate::geometry::edge_test::{Corners, Edges, Ends, Shear, Verdict, boxes};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::{BLOCK, PrimRef};
use crate::ray::{Hit, INVALID_ID};

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

pub(crate) type Vector<S> = <S as Width<BLOCK>>::Lanes;
pub(crate) type Truths<S> = <Vector<S> as Lanes<BLOCK>>::Mask;

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

    /// `t`, `u` and `v` of a lane that is hit.
    #[inline(always)]
    pub fn values(&self, lane: usize) -> [f32; 3] {
        let det = self.det[lane];
        [self.t[lane], self.v[lane] / det, self.w[lane] / det]
    }
}

/// [`BlockHits`] in vectors, with the barycentrics worked out for all lanes.
pub(crate) struct VectorHits<S: Simd> {
    pub hits: Truths<S>,
    pub t: Vector<S>,
    pub u: Vector<S>,
    pub v: Vector<S>,
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

    /// Number of lanes that hold a triangle; they come first.
    pub fn count(&self) -> usize {
        self.prim_ids
            .iter()
            .take_while(|id| **id != u32::MAX)
            .count()
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

    /// The corners on these axes.
    #[inline(always)]
    pub fn corners_on<S: Simd>(&self, simd: S, axes: [usize; 3]) -> Corners<Vector<S>> {
        let [xs, ys, zs] = [
            &self.corners[axes[0]],
            &self.corners[axes[1]],
            &self.corners[axes[2]],
        ];
        [
            [
                Vector::<S>::load(simd, &xs[0]),
                Vector::<S>::load(simd, &xs[1]),
                Vector::<S>::load(simd, &xs[2]),
            ],
            [
                Vector::<S>::load(simd, &ys[0]),
                Vector::<S>::load(simd, &ys[1]),
                Vector::<S>::load(simd, &ys[2]),
            ],
            [
                Vector::<S>::load(simd, &zs[0]),
                Vector::<S>::load(simd, &zs[1]),
                Vector::<S>::load(simd, &zs[2]),
            ],
        ]
    }

    #[inline(always)]
    fn edges<S: Simd>(&self, simd: S, ray: &RaySetup) -> Edges<Vector<S>> {
        let [x, y, z] = [
            ray.axes[0] as usize,
            ray.axes[1] as usize,
            ray.axes[2] as usize,
        ];
        let shear = Shear {
            org: [
                Vector::<S>::splat(simd, ray.shear_org[0]),
                Vector::<S>::splat(simd, ray.shear_org[1]),
                Vector::<S>::splat(simd, ray.shear_org[2]),
            ],
            shear: [
                Vector::<S>::splat(simd, ray.shear[0]),
                Vector::<S>::splat(simd, ray.shear[1]),
                Vector::<S>::splat(simd, ray.shear[2]),
            ],
        };
        Edges::new::<BLOCK>(&shear, &self.corners_on(simd, [x, y, z]))
    }

    /// Decides nearly all lanes.
    #[inline(always)]
    fn judge<S: Simd>(simd: S, ray: &RaySetup, edges: &Edges<Vector<S>>) -> Verdict<Truths<S>> {
        let ends = Ends {
            tnear: Vector::<S>::splat(simd, ray.tnear),
            tfar: Vector::<S>::splat(simd, ray.tfar),
            doubt_by_spread: Vector::<S>::splat(simd, ray.doubt_by_spread),
            minus_doubt: Vector::<S>::splat(simd, ray.minus_doubt),
        };
        edges.judge::<BLOCK>(Vector::<S>::splat(simd, 0.0), &ends)
    }

    /// The lanes that the ray passes through, at whatever distance.
    #[inline(always)]
    fn inside<S: Simd>(simd: S, edges: &Edges<Vector<S>>) -> Truths<S> {
        edges.inside::<BLOCK>(Vector::<S>::splat(simd, 0.0))
    }

    /// The definition: distances, and which lanes are hit.
    #[inline(always)]
    fn define<S: Simd>(
        &self,
        simd: S,
        ray: &RaySetup,
        edges: &Edges<Vector<S>>,
    ) -> (Vector<S>, Truths<S>) {
        let zero = Vector::<S>::splat(simd, 0.0);
        let tnear = Vector::<S>::splat(simd, ray.tnear);
        let tfar = Vector::<S>::splat(simd, ray.tfar);
        let candidates = edges.candidates::<BLOCK>(zero, tnear, tfar);
        let boxes = boxes(&self.corners_on(simd, [0, 1, 2]));
        ray.confirm_lanes::<S, BLOCK>(simd, boxes, candidates)
    }

    /// The first lane found that occludes the ray. In a ray stream (`STREAM`) all lanes go the whole way: leaving early
    /// saves less than a wrong guess costs.
    #[inline(always)]
    pub fn occluded<S: Simd, const STREAM: bool>(&self, simd: S, ray: &RaySetup) -> Option<usize> {
        let found = self.occluders::<S, STREAM>(simd, ray);
        (found != 0).then_some(found.trailing_zeros() as usize)
    }

    /// All lanes that occlude the ray, as bits.
    #[inline(always)]
    pub fn occluders<S: Simd, const STREAM: bool>(&self, simd: S, ray: &RaySetup) -> u32 {
        let edges = self.edges(simd, ray);
        if !STREAM && !Self::inside(simd, &edges).any() {
            return 0;
        }
        let Verdict { sure, doubtful } = Self::judge(simd, ray, &edges);
        if doubtful.any() || ray.extreme {
            self.define(simd, ray, &edges).1.bits()
        } else {
            sure.bits()
        }
    }

    /// Replaces `best` by the block's closest hit where that precedes it, and returns whether it did. `STREAM` is
    /// as in [`TriangleBlock::occluded`].
    #[inline(always)]
    pub fn intersect<S: Simd, const STREAM: bool>(
        &self,
        simd: S,
        ray: &RaySetup,
        best: &mut Best,
    ) -> bool {
        let Some(hits) = self.hits::<S, STREAM>(simd, ray, best.limit) else {
            return false;
        };
        let mut improved = false;
        for lane in hits.lanes() {
            improved |= best.offer(self.hit(lane, hits.values(lane)));
        }
        improved
    }

    /// All hits no farther than `limit`; `None` if there is not even a candidate. `STREAM` is as in
    /// [`TriangleBlock::occluded`].
    #[inline(always)]
    pub fn hits<S: Simd, const STREAM: bool>(
        &self,
        simd: S,
        ray: &RaySetup,
        limit: f32,
    ) -> Option<BlockHits> {
        let edges = self.edges(simd, ray);
        if !STREAM && !Self::inside(simd, &edges).any() {
            return None;
        }
        let Verdict { sure, doubtful } = Self::judge(simd, ray, &edges);
        if !((sure | doubtful).any() || ray.extreme) {
            return None;
        }
        let (t, hits) = self.define(simd, ray, &edges);
        let hits = hits & t.le(Vector::<S>::splat(simd, limit));
        let mut lanes = [[0.0; BLOCK]; 4];
        t.store(&mut lanes[0]);
        edges.v.store(&mut lanes[1]);
        edges.w.store(&mut lanes[2]);
        edges.det.store(&mut lanes[3]);
        let [t, v, w, det] = lanes;
        let hits = hits.bits();
        Some(BlockHits { hits, t, v, w, det })
    }

    /// [`TriangleBlock::hits`] in a ray stream. Without `DISTANCES` those are of no meaning, and found faster.
    #[inline(always)]
    pub fn vector_hits<S: Simd, const DISTANCES: bool>(
        &self,
        simd: S,
        ray: &RaySetup,
        limit: f32,
    ) -> VectorHits<S> {
        let edges = self.edges(simd, ray);
        let Verdict { sure, doubtful } = Self::judge(simd, ray, &edges);
        let define = if DISTANCES {
            (sure | doubtful).any() || ray.extreme
        } else {
            doubtful.any() || ray.extreme
        };
        let (t, hits) = if define {
            let (t, hits) = self.define(simd, ray, &edges);
            (t, hits & t.le(Vector::<S>::splat(simd, limit)))
        } else {
            (Vector::<S>::splat(simd, 0.0), sure)
        };
        VectorHits {
            hits,
            t,
            u: edges.v / edges.det,
            v: edges.w / edges.det,
        }
    }

    /// The hit in a lane at these `t`, `u` and `v`.
    #[inline(always)]
    pub fn hit(&self, lane: usize, [t, u, v]: [f32; 3]) -> Hit {
        Hit {
            t,
            u,
            v,
            prim_id: self.prim_ids[lane],
            geom_id: self.geom_ids[lane],
            inst_id: INVALID_ID,
        }
    }
}

/// The test of one triangle in plain scalar code, for the oracle. Returns `(t, u, v)`.
pub(crate) fn hit(corners: &[[f32; 3]; 3], ray: &RaySetup) -> Option<(f32, f32, f32)> {
    let [x, y, z] = ray.axes.map(|axis| axis as usize);
    let [sx, sy, sz] = ray.shear;
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = corners.map(|corner| {
        let along = ray.org[z] - corner[z];
        [
            (ray.org[x] - corner[x]) - sx * along,
            (ray.org[y] - corner[y]) - sy * along,
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
