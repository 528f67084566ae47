//! Triangles of a leaf, tested together.
//!
//! The definition of a hit is in [`crate::geometry::triangle_hit`]. Vectors decide nearly all lanes, see
//! [`crate::geometry::edge_test`]; lanes in doubt, and the distance of a closest hit, are computed as defined.

use antumbra_simd::{Lanes, Mask, Scalar, Simd, Width};

use crate::aabb::Aabb;
use crate::geometry::best::{Best, TreeHit};
use crate::geometry::cutout::Filters;
use crate::geometry::edge_test::{Corners, Edges, Ends, Shear, Verdict};
use crate::geometry::instance::cross;
use crate::geometry::leaf_block::{InBlock, LeafBlock, Normal};
use crate::geometry::moved::Moved;
use crate::geometry::nearest::{Near, Place};
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle_hit::{ShearedTriangle, refined};
use crate::geometry::winding::crossing;
use crate::geometry::{BLOCK, PrimRef, QueryKind};
use crate::ray::{Hit, INVALID_ID, Ray};

/// Up to [`BLOCK`] triangles of a leaf: planar, so that the shear's choice of axes is only an address.
///
/// 352 bytes: 288 of coordinates, then the ids. Empty lanes are NaN, which no comparison accepts.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(crate) struct TriangleBlock {
    /// Coordinates, `[axis][corner][lane]`.
    pub corners: [[[f32; BLOCK]; 3]; 3],
    pub geom_ids: [u32; BLOCK],
    pub prim_ids: [u32; BLOCK],
}

pub(crate) type Vector<S> = <S as Width<BLOCK>>::Lanes;
pub(crate) type Truths<S> = <Vector<S> as Lanes<BLOCK>>::Mask;

/// The triangles of a block that a ray hits.
pub(crate) struct VectorHits<S: Simd> {
    pub hits: Truths<S>,
    pub t: Vector<S>,
    pub u: Vector<S>,
    pub v: Vector<S>,
}

/// Lanes given as bits, in ascending order.
pub(crate) struct LanesOf<const N: usize = BLOCK>(pub u32);

impl<const N: usize> Iterator for LanesOf<N> {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let lane = self.0.trailing_zeros() as usize;
        self.0 &= self.0.wrapping_sub(1);
        (lane < N).then_some(lane)
    }
}

/// All lanes, as bits.
const ALL: u32 = (1 << BLOCK) - 1;

impl TriangleBlock {
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

    /// Corners of all lanes on these axes, in this order.
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
        let corners = shear.of::<BLOCK>(&self.corners_on(simd, [x, y, z]));
        Edges::new::<BLOCK>(&corners, shear.per_z())
    }

    /// Decides nearly all lanes, for hits no farther than `limit`, which is at most the end of the ray.
    #[inline(always)]
    fn judge<S: Simd>(
        simd: S,
        ray: &RaySetup,
        limit: f32,
        edges: &Edges<Vector<S>>,
    ) -> Verdict<Truths<S>> {
        let ends = Ends {
            tnear: Vector::<S>::splat(simd, ray.tnear_of_vectors),
            tfar: Vector::<S>::splat(simd, limit),
        };
        edges.judge::<BLOCK>(simd, &ends)
    }

    /// The lanes that the ray may pass through, at whatever distance.
    #[inline(always)]
    fn inside<S: Simd>(simd: S, edges: &Edges<Vector<S>>) -> Truths<S> {
        edges.inside::<BLOCK>(Vector::<S>::splat(simd, 0.0))
    }

    /// The corners of a lane, `[axis][corner]` on these axes.
    #[inline(always)]
    pub fn corners_of(&self, lane: usize, axes: [usize; 3]) -> [[f32; 3]; 3] {
        axes.map(|axis| {
            let [a, b, c] = &self.corners[axis];
            [a[lane], b[lane], c[lane]]
        })
    }

    /// The triangle of a lane as the ray sees it.
    #[inline(always)]
    fn seen(&self, lane: usize, ray: &RaySetup) -> ShearedTriangle {
        let axes = ray.axes.map(|axis| axis as usize);
        ShearedTriangle::new(&self.corners_of(lane, axes), &ray.sheared())
    }

    /// `t`, `u` and `v` that decide whether the ray hits the cut-out of a lane.
    #[inline(always)]
    pub fn values(&self, lane: usize, ray: &RaySetup) -> Option<[f32; 3]> {
        let seen = self.seen(lane, ray);
        let t = seen.distance(&ray.sheared())?;
        let [u, v] = seen.barycentrics().unwrap_or_else(|| {
            let [_, u, v] = self.refined(lane, ray, t);
            [u, v]
        });
        Some([t, u, v])
    }

    /// `t`, `u` and `v` that are reported of a hit in a lane, decided at the distance `t`.
    #[inline(always)]
    pub fn refined(&self, lane: usize, ray: &Ray, t: f32) -> [f32; 3] {
        refined(&self.triangle(lane), ray, t)
    }

    /// Lanes whose triangles are hit, among `lanes`.
    #[cold]
    #[inline(never)]
    fn settled(&self, lanes: u32, ray: &RaySetup) -> u32 {
        let is_hit = |&lane: &usize| self.seen(lane, ray).distance(&ray.sheared()).is_some();
        let hits = LanesOf::<BLOCK>(lanes).filter(is_hit);
        hits.fold(0, |bits, lane| bits | 1 << lane)
    }

    /// All hits no farther than `limit`, which is at most the end of the ray, in a ray stream.
    #[inline(always)]
    pub fn vector_hits<S: Simd>(&self, simd: S, ray: &RaySetup, limit: f32) -> VectorHits<S> {
        let mut values = [[f32::NAN; BLOCK]; 3];
        for lane in self.candidates::<S, true>(simd, ray, limit) {
            if let Some([t, u, v]) = self.values(lane, ray)
                && t <= limit
            {
                (values[0][lane], values[1][lane], values[2][lane]) = (t, u, v);
            }
        }
        let t = Vector::<S>::load(simd, &values[0]);
        let u = Vector::<S>::load(simd, &values[1]);
        let v = Vector::<S>::load(simd, &values[2]);
        VectorHits {
            hits: t.eq(t),
            t,
            u,
            v,
        }
    }

    /// All hits in a ray stream that wants no distances; those are of no meaning.
    #[inline(always)]
    pub fn vector_occluders<S: Simd>(&self, simd: S, ray: &RaySetup) -> VectorHits<S> {
        let edges = self.edges(simd, ray);
        let Verdict { sure, possible } = Self::judge(simd, ray, ray.tfar, &edges);
        if sure.bits() != possible.bits() || ray.extreme {
            return self.vector_hits(simd, ray, ray.tfar);
        }
        let [u, v] = edges.barycentrics::<BLOCK>();
        VectorHits {
            hits: sure,
            t: Vector::<S>::splat(simd, 0.0),
            u,
            v,
        }
    }

    /// The hit in a lane, decided at the distance `t`, that is still to be refined.
    #[inline(always)]
    pub fn hit_at(&self, lane: usize, t: f32) -> TreeHit {
        TreeHit::from(Hit {
            t,
            u: 0.0,
            v: 0.0,
            prim_id: self.prim_ids[lane],
            geom_id: self.geom_ids[lane],
            inst_id: INVALID_ID,
        })
    }

    /// [`TriangleBlock::hit_at`], refined.
    #[inline(always)]
    pub fn refined_hit(&self, lane: usize, ray: &Ray, t: f32) -> TreeHit {
        (self.hit_at(lane, t)).refined(self.refined(lane, ray, t))
    }
}

impl InBlock for TriangleBlock {
    type Block = Self;
}

impl LeafBlock for TriangleBlock {
    const KIND: PrimKind = PrimKind::Triangle;
    const EMPTY: Self = Self {
        corners: [[[f32::NAN; BLOCK]; 3]; 3],
        geom_ids: [u32::MAX; BLOCK],
        prim_ids: [u32::MAX; BLOCK],
    };
    const OCCLUDERS_ARE_SURE: bool = true;

    fn count(&self) -> usize {
        self.prim_ids
            .iter()
            .take_while(|id| **id != u32::MAX)
            .count()
    }

    #[inline(always)]
    fn id(&self, lane: usize) -> PrimRef {
        PrimRef {
            geom_id: self.geom_ids[lane],
            prim_id: self.prim_ids[lane],
        }
    }

    fn bounds(&self, lane: usize) -> Aabb {
        Aabb::around(&self.triangle(lane))
    }

    fn fill(&mut self, primitives: &Primitives, prims: &[u32]) {
        primitives.set_triangles(self, prims);
    }

    fn permute(&mut self, lanes: &[u8; BLOCK]) {
        let old = self.clone();
        for (lane, &from) in lanes.iter().enumerate() {
            let from = from as usize;
            self.set(lane, &old.triangle(from), old.id(from));
        }
    }

    fn prefetch(primitives: &Primitives, prim: u32) {
        let [first, _, last] = &primitives.triangles[prim as usize];
        Scalar.prefetch(first);
        Scalar.prefetch(last);
        Scalar.prefetch(&primitives.triangle_refs[prim as usize]);
    }

    #[inline(always)]
    fn candidates<S: Simd, const STREAM: bool>(
        &self,
        simd: S,
        ray: &RaySetup,
        limit: f32,
    ) -> LanesOf {
        if ray.extreme {
            return LanesOf(ALL);
        }
        let edges = self.edges(simd, ray);
        if !STREAM && !Self::inside(simd, &edges).any() {
            return LanesOf(0);
        }
        LanesOf(Self::judge(simd, ray, limit, &edges).possible.bits())
    }

    #[inline(always)]
    fn hit(&self, lane: usize, ray: &RaySetup, _: &Filters, _: QueryKind) -> Option<TreeHit> {
        let t = self.seen(lane, ray).distance(&ray.sheared())?;
        Some(self.refined_hit(lane, ray, t))
    }

    #[inline(always)]
    fn occluders<S: Simd, const STREAM: bool>(&self, simd: S, ray: &RaySetup) -> u32 {
        if ray.extreme {
            return self.settled(ALL, ray);
        }
        let edges = self.edges(simd, ray);
        if !STREAM && !Self::inside(simd, &edges).any() {
            return 0;
        }
        let Verdict { sure, possible } = Self::judge(simd, ray, ray.tfar, &edges);
        let (sure, possible) = (sure.bits(), possible.bits());
        if sure == possible {
            sure
        } else {
            sure | self.settled(possible & !sure, ray)
        }
    }

    #[inline(always)]
    fn improve(&self, lanes: LanesOf, ray: &RaySetup, _: &Filters, best: &mut Best) -> bool {
        let mut improved = None;
        for lane in lanes {
            let Some(t) = self.seen(lane, ray).distance(&ray.sheared()) else {
                continue;
            };
            if t <= best.limit && best.offer(self.hit_at(lane, t)) {
                improved = Some((lane, t));
            }
        }
        // Only the last of them may be reported.
        if let Some((lane, t)) = improved {
            best.refine(self.refined(lane, ray, t));
        }
        improved.is_some()
    }

    fn corners(&self, lane: usize) -> Option<[[f32; 3]; 3]> {
        Some(self.triangle(lane))
    }

    fn normal(&self, lane: usize, _: &Ray, _: &Hit) -> Option<Normal> {
        let [a, b, c] = self.triangle(lane).map(|corner| corner.map(f64::from));
        let from_a = |to: [f64; 3]| core::array::from_fn(|axis| to[axis] - a[axis]);
        Some(Normal {
            direction: cross(from_a(b), from_a(c)),
            mirrors_turn: true,
        })
    }

    fn near(&self, lane: usize, place: &Place<'_>) -> Option<Near> {
        Some(place.triangle(&self.triangle(lane)))
    }

    fn crossing(&self, lane: usize, point: [f64; 3]) -> i32 {
        crossing(&self.triangle(lane), point)
    }

    fn is_there(moved: &Moved<'_>, id: PrimRef) -> bool {
        moved.triangle(id).is_some()
    }

    fn refill(&mut self, moved: &Moved<'_>) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for lane in 0..self.count() {
            let id = self.id(lane);
            if let Some(corners) = moved.triangle(id) {
                self.set(lane, &corners, id);
                bounds = bounds.union(&Aabb::around(&corners));
            }
        }
        bounds
    }
}

/// The test of one triangle, for the oracle: `t`, `u` and `v` that decide, and those that are reported.
pub(crate) fn hit(corners: &[[f32; 3]; 3], ray: &RaySetup) -> Option<[[f32; 3]; 2]> {
    let sheared = ray
        .axes
        .map(|axis| corners.map(|corner| corner[axis as usize]));
    let seen = ShearedTriangle::new(&sheared, &ray.sheared());
    let t = seen.distance(&ray.sheared())?;
    let refined = refined(corners, ray, t);
    let [_, u, v] = refined;
    let [u, v] = seen.barycentrics().unwrap_or([u, v]);
    Some([[t, u, v], refined])
}
