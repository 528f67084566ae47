//! Primitives that are tested one by one, in plain scalar code: every kind but triangles. Scenes have few of them.
//!
//! A kind is a type with [`ScalarShape`] and [`ScalarPrim`], in a file of its own, and a row of
//! [`crate::geometry::primitives::kinds`]. Its leaf block is a [`ScalarBlock`].

use core::fmt::Debug;

use antumbra_simd::{Scalar, Simd};

use crate::aabb::Aabb;
use crate::geometry::best::{Best, TreeHit};
use crate::geometry::cutout::Filters;
use crate::geometry::instance_ray::Interval;
use crate::geometry::leaf_block::{InBlock, LeafBlock, Normal};
use crate::geometry::moved::Moved;
use crate::geometry::nearest::{Near, Place};
use crate::geometry::primitives::dropped::DropReason;
use crate::geometry::primitives::kinds::Listed;
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::LanesOf;
use crate::geometry::{BLOCK, Geometry, PrimRef, QueryKind};
use crate::hash::Random;
use crate::ray::{Hit, INVALID_ID, Ray};

/// A point on a surface and the normal there, of unit length.
pub(crate) struct SurfacePoint {
    pub position: [f64; 3],
    pub normal: [f64; 3],
}

/// What queries, builders and surface rays need of one primitive.
pub(crate) trait ScalarShape {
    /// A box that holds the primitive.
    fn bounds(&self) -> Aabb;

    /// `t`, `u` and `v` of the nearest hit inside the ray's interval. The same bits on every level, and `t` inside the
    /// interval of the box, see [`clamped`]. Hits that cannot be nearer than `limit` may be left out.
    fn hit(&self, prim_id: u32, ray: &RaySetup, limit: f32) -> Option<[f32; 3]>;

    /// Whether there is such a hit.
    fn occludes(&self, prim_id: u32, ray: &RaySetup) -> bool {
        self.hit(prim_id, ray, ray.tfar).is_some()
    }

    /// Geometric normal at a hit, of any length.
    fn normal(&self, ray: &Ray, hit: &Hit) -> Option<[f64; 3]>;

    /// The nearest point of the primitive, if it has one.
    fn near(&self, prim_id: u32, place: &Place<'_>) -> Option<Near>;

    /// Signed crossing of the half-line from `point` towards larger x, see [`crate::geometry::winding`].
    fn crossing(&self, _point: [f64; 3]) -> i32 {
        0
    }

    /// Area of the surface, for surface rays.
    fn area(&self) -> f64;

    /// The normal of a flat primitive, of unit length.
    fn flat_normal(&self) -> Option<[f64; 3]> {
        None
    }

    /// A point anywhere on the surface.
    fn surface_point(&self, random: &mut Random) -> SurfacePoint;
}

/// A kind of primitives.
pub(crate) trait ScalarPrim:
    ScalarShape + Listed + Clone + Debug + Send + Sync + 'static
{
    /// Plural, for errors.
    const NAME: &'static str;
    /// What is in lanes without a primitive.
    const NOTHING: Self;
    /// Numbers of a primitive in a file; 0 if no file can hold one.
    const NUMBERS: usize;

    /// Which of the first `count` primitives a ray may hit, as bits. A kind may rule some out cheaply.
    #[inline(always)]
    fn candidates<S: Simd>(_: S, _: &[Self; BLOCK], count: usize, _: &RaySetup) -> u32 {
        (1 << count) - 1
    }

    /// Number of primitives of this kind in a geometry.
    fn count(geometry: &Geometry<'_>) -> usize;

    /// A primitive of a geometry; `None` if there is none of this kind and number.
    fn of(geometry: &Geometry<'_>, prim_id: u32) -> Option<Result<Self, DropReason>>;

    /// The numbers of a primitive in a file: the first [`ScalarPrim::NUMBERS`] of these.
    fn numbers(&self) -> [f32; 8];

    /// A primitive of numbers as [`ScalarPrim::numbers`] returns them.
    fn from_numbers(numbers: [f32; 8]) -> Result<Self, DropReason>;
}

/// The distance clamped into the interval of the primitive's box, see [`crate::geometry::ray_setup`], if the ray's own
/// interval holds the result.
pub(crate) fn clamped(bounds: &Aabb, t: f32, ray: &RaySetup) -> Option<f32> {
    let t = interval_in(bounds, ray)?.clamp(t);
    (ray.tnear < t && t < ray.tfar).then_some(t)
}

/// The part of the ray in a box.
pub(crate) fn interval_in(bounds: &Aabb, ray: &RaySetup) -> Option<Interval> {
    let planes = [bounds.min, bounds.max].map(|[x, y, z]| [x, y, z, 0.0]);
    Interval::of(Scalar, ray, &planes)
}

/// Whether all sides of a box are finite.
pub(crate) fn is_finite_box(bounds: &Aabb) -> bool {
    bounds.min.iter().chain(&bounds.max).all(|x| x.is_finite())
}

/// Up to [`BLOCK`] primitives of one kind. The first `count` lanes have one.
#[derive(Clone, Debug)]
pub(crate) struct ScalarBlock<P> {
    count: usize,
    prims: [P; BLOCK],
    refs: [PrimRef; BLOCK],
}

impl<P: ScalarPrim> ScalarBlock<P> {
    /// Puts a primitive into the next lane.
    pub fn push(&mut self, prim: P, id: PrimRef) {
        self.prims[self.count] = prim;
        self.refs[self.count] = id;
        self.count += 1;
    }

    /// The primitive in a lane.
    pub fn prim(&self, lane: usize) -> &P {
        &self.prims[lane]
    }

    /// The hit in a lane, unless it cannot be nearer than `limit`.
    fn hit_within(&self, lane: usize, ray: &RaySetup, limit: f32) -> Option<TreeHit> {
        let PrimRef { geom_id, prim_id } = self.refs[lane];
        let [t, u, v] = self.prims[lane].hit(prim_id, ray, limit)?;
        Some(TreeHit::from(Hit {
            t,
            u,
            v,
            prim_id,
            geom_id,
            inst_id: INVALID_ID,
        }))
    }
}

impl<P: ScalarPrim> InBlock for P {
    type Block = ScalarBlock<P>;
}

impl<P: ScalarPrim> LeafBlock for ScalarBlock<P> {
    const KIND: PrimKind = P::KIND;
    const EMPTY: Self = Self {
        count: 0,
        prims: [P::NOTHING; BLOCK],
        refs: [PrimRef {
            geom_id: u32::MAX,
            prim_id: u32::MAX,
        }; BLOCK],
    };

    fn count(&self) -> usize {
        self.count
    }

    fn id(&self, lane: usize) -> PrimRef {
        self.refs[lane]
    }

    fn bounds(&self, lane: usize) -> Aabb {
        self.prims[lane].bounds()
    }

    fn fill(&mut self, primitives: &Primitives, prims: &[u32]) {
        let start = primitives.start_of(P::KIND);
        for &prim in prims {
            let (shape, id) = P::list(&primitives.scalars).at(prim as usize - start);
            self.push(shape.clone(), id);
        }
    }

    fn permute(&mut self, lanes: &[u8; BLOCK]) {
        let old = self.clone();
        for (lane, &from) in lanes.iter().enumerate() {
            self.prims[lane] = old.prims[from as usize].clone();
            self.refs[lane] = old.refs[from as usize];
        }
    }

    #[inline(always)]
    fn candidates<S: Simd, const STREAM: bool>(&self, simd: S, ray: &RaySetup, _: f32) -> LanesOf {
        LanesOf(P::candidates(simd, &self.prims, self.count, ray))
    }

    fn hit(&self, lane: usize, ray: &RaySetup, _: &Filters, _: QueryKind) -> Option<TreeHit> {
        self.hit_within(lane, ray, ray.tfar)
    }

    fn occludes(&self, lane: usize, ray: &RaySetup, _: &Filters) -> bool {
        self.prims[lane].occludes(self.refs[lane].prim_id, ray)
    }

    #[cold]
    fn improve(&self, lanes: LanesOf, ray: &RaySetup, _: &Filters, best: &mut Best) -> bool {
        let mut improved = false;
        for lane in lanes {
            if let Some(hit) = self.hit_within(lane, ray, best.limit) {
                improved |= best.offer(hit);
            }
        }
        improved
    }

    fn normal(&self, lane: usize, ray: &Ray, hit: &Hit) -> Option<Normal> {
        Some(Normal {
            direction: self.prims[lane].normal(ray, hit)?,
            mirrors_turn: false,
        })
    }

    fn near(&self, lane: usize, place: &Place<'_>) -> Option<Near> {
        self.prims[lane].near(self.refs[lane].prim_id, place)
    }

    fn crossing(&self, lane: usize, point: [f64; 3]) -> i32 {
        self.prims[lane].crossing(point)
    }

    fn is_there(moved: &Moved<'_>, id: PrimRef) -> bool {
        moved.scalar::<P>(id).is_some()
    }

    /// A primitive of user geometry that is sound no more, although it was when it was checked, becomes nothing.
    fn refill(&mut self, moved: &Moved<'_>) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for lane in 0..self.count {
            let prim = moved.scalar(self.refs[lane]).unwrap_or(P::NOTHING);
            bounds = bounds.union(&prim.bounds());
            self.prims[lane] = prim;
        }
        bounds
    }
}
