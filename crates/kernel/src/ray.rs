//! Rays and hits.

/// `inst_id` of a hit that lies in no instance.
pub const INVALID_ID: u32 = u32::MAX;

/// A ray `org + t * dir` restricted to the open interval `tnear < t < tfar`.
///
/// `t` counts multiples of `dir`, which need not be of unit length. `tnear` may be negative and `tfar`
/// infinite. A ray with a NaN anywhere, an infinite origin or direction, a zero direction (one whose largest
/// component has no finite reciprocal, below 2.9e-39) or an empty interval hits nothing. A triangle is missed
/// when its distance times its area, as seen along the ray, is beyond the range of `f32`.
///
/// A ray that leaves a surface is answered sooner if it begins [`Aabb::origin_offset`](crate::Aabb::origin_offset) away
/// from it.
///
/// 32 bytes: origin, `tnear`, direction, `tfar`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Origin.
    pub org: [f32; 3],
    /// Excluded lower end of the interval, in multiples of `dir`.
    pub tnear: f32,
    /// Direction, of any length but zero.
    pub dir: [f32; 3],
    /// Excluded upper end of the interval, in multiples of `dir`.
    pub tfar: f32,
}

impl Ray {
    /// A ray over the interval (0, ∞). Nothing is checked: rays that cannot hit anything miss.
    pub fn new(org: [f32; 3], dir: [f32; 3]) -> Self {
        Self {
            org,
            dir,
            tnear: 0.0,
            tfar: f32::INFINITY,
        }
    }

    /// The segment strictly between two points: `t` runs from 0 at `from` to 1 at `to`. Between equal points nothing is
    /// hit.
    pub fn between(from: [f32; 3], to: [f32; 3]) -> Self {
        let dir = core::array::from_fn(|axis| to[axis] - from[axis]);
        Self {
            org: from,
            dir,
            tnear: 0.0,
            tfar: 1.0,
        }
    }
}

/// Where a ray meets the closest primitive.
///
/// Of several primitives at equal distance the one of the smallest (inst_id, geom_id, prim_id) is hit. Primitives in the
/// world itself come after those in instances, because [`INVALID_ID`] is the largest number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray in multiples of its direction.
    pub t: f32,
    /// Barycentric weight of the triangle's second corner; 0 on a sphere.
    pub u: f32,
    /// Barycentric weight of the triangle's third corner; 0 on a sphere.
    pub v: f32,
    /// Index of the triangle or sphere in its geometry.
    pub prim_id: u32,
    /// Index of the geometry in the list the tree was built from, or in the list of the instance's object.
    pub geom_id: u32,
    /// Index of the instance, or [`INVALID_ID`] if the primitive lies in the world itself.
    pub inst_id: u32,
}

impl Hit {
    /// No hit yet on a ray that ends at `tfar`.
    pub(crate) const fn none(tfar: f32) -> Self {
        Self {
            t: tfar,
            u: 0.0,
            v: 0.0,
            prim_id: INVALID_ID,
            geom_id: INVALID_ID,
            inst_id: INVALID_ID,
        }
    }

    /// The hit, unless it is still [`Hit::none`].
    pub(crate) fn found(&self) -> Option<Self> {
        (self.prim_id != INVALID_ID).then_some(*self)
    }

    /// Whether this hit is nearer than `other` or, at equal distance, of a smaller (inst_id, geom_id, prim_id), so
    /// that the answer does not depend on who was tested first.
    #[inline(always)]
    pub(crate) fn precedes(&self, other: &Self) -> bool {
        let rank = |hit: &Self| (hit.t, hit.inst_id, hit.geom_id, hit.prim_id);
        rank(self) < rank(other)
    }
}
