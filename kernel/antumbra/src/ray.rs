//! Rays and hits.

/// `inst_id` of a hit that lies in no instance.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::{INVALID_ID, Ray};
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let hit = bvh.intersect(&Ray::new([0.2, 0.2, 0.0], [0.0, 0.0, 1.0]));
/// assert_eq!(hit.map(|hit| hit.inst_id), Some(INVALID_ID));
/// # Ok::<(), antumbra::Error>(())
/// ```
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
///
/// ```
/// use antumbra::Ray;
///
/// let ray = Ray { tfar: 10.0, ..Ray::new([1.0, 2.0, 3.0], [0.0, 0.0, 2.0]) };
/// assert_eq!((ray.tnear, ray.at(1.5)), (0.0, [1.0, 2.0, 6.0]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Origin of the ray.
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
    #[must_use]
    pub fn new(org: impl Into<[f32; 3]>, dir: impl Into<[f32; 3]>) -> Self {
        Self {
            org: org.into(),
            dir: dir.into(),
            tnear: 0.0,
            tfar: f32::INFINITY,
        }
    }

    /// The segment strictly between two points: `t` runs from 0 at `from` to 1 at `to`. Between equal points nothing is
    /// hit.
    #[must_use]
    pub fn between(from: impl Into<[f32; 3]>, to: impl Into<[f32; 3]>) -> Self {
        let (from, to) = (from.into(), to.into());
        let dir = core::array::from_fn(|axis| to[axis] - from[axis]);
        Self {
            org: from,
            dir,
            tnear: 0.0,
            tfar: 1.0,
        }
    }

    /// The ray with another upper end of its interval, in multiples of the direction. With NaN it hits nothing.
    ///
    /// ```
    /// use antumbra::Ray;
    ///
    /// let ray = Ray::new([0.0; 3], [0.0, 0.0, 2.0]).far(5.0);
    /// assert_eq!((ray.tnear, ray.tfar), (0.0, 5.0));
    /// ```
    #[must_use]
    pub fn far(mut self, distance: f32) -> Self {
        self.tfar = distance;
        self
    }

    /// The point at distance `t`, in multiples of the direction. Rounded, so it lies near a surface that is hit there and
    /// not on it: see [`Aabb::origin_offset`](crate::Aabb::origin_offset).
    #[must_use]
    pub fn at(&self, t: f32) -> [f32; 3] {
        core::array::from_fn(|axis| self.org[axis] + t * self.dir[axis])
    }

    /// The ray with hits at either end of its interval counted, as other libraries count them: `tnear <= t <= tfar`.
    ///
    /// Moves `tnear` down and `tfar` up to the next number that is not subnormal. An interval that holds nothing, or has a
    /// NaN, stays as it is. The ends of a closed ray are on either side of 0 also where the CPU takes subnormal numbers for
    /// 0, as some programs have it do: the number next to 0 is `f32::MIN_POSITIVE`.
    #[must_use]
    pub fn closed(self) -> Self {
        if !(self.tnear <= self.tfar) {
            return self;
        }
        Self {
            tnear: -next_up(-self.tnear),
            tfar: next_up(self.tfar),
            ..self
        }
    }
}

impl Default for Ray {
    /// The ray without direction, which hits nothing.
    fn default() -> Self {
        Self::new([0.0; 3], [0.0; 3])
    }
}

/// The next larger number that is not subnormal; subnormal numbers count as 0.
fn next_up(t: f32) -> f32 {
    if t.is_subnormal() || t == 0.0 {
        return f32::MIN_POSITIVE;
    }
    let next = t.next_up();
    if next.is_subnormal() { 0.0 } else { next }
}

/// Where a ray hits the closest primitive.
///
/// Of several primitives at equal distance the one of the smallest (inst_id, geom_id, prim_id) is hit. Primitives in the
/// world itself come after those in instances, because [`INVALID_ID`] is the largest number.
///
/// [`Bvh::normal`](crate::Bvh::normal) has the normal there, [`Ray::at`] the point.
///
/// 24 bytes: `t`, `u`, `v`, `prim_id`, `geom_id`, `inst_id`.
///
/// ```
/// # use antumbra::{Bvh, Geometry, Recipe};
/// use antumbra::{Hit, Ray};
///
/// # let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// # let geometry = [Geometry::triangles(&positions[..], vec![[0, 1, 2]])];
/// # let bvh = Bvh::build(&geometry, &Recipe::default())?;
/// let ray = Ray::new([0.25, 0.5, 0.0], [0.0, 0.0, 1.0]);
/// let hit: Hit = bvh.intersect(&ray).expect("a triangle above");
/// assert_eq!((hit.t, hit.u, hit.v, hit.prim_id), (1.0, 0.25, 0.5, 0));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Hit {
    /// Distance along the ray in multiples of its direction.
    pub t: f32,
    /// Barycentric weight of the triangle's second corner; 0 without corners; of a [quad](crate::shapes::QuadMesh) the
    /// place from corner 0 to corner 1; what [user geometry](crate::shapes::UserGeometry) returns.
    pub u: f32,
    /// Barycentric weight of the triangle's third corner; 0 without corners; of a quad the place from corner 0 to
    /// corner 3; what user geometry returns.
    pub v: f32,
    /// Index of the primitive in its geometry.
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

    /// Whether this hit is nearer than `other` or, at equal distance, of a smaller (inst_id, geom_id, prim_id), so
    /// that the answer does not depend on who was tested first.
    #[inline(always)]
    pub(crate) fn precedes(&self, other: &Self) -> bool {
        let rank = |hit: &Self| (hit.t, hit.inst_id, hit.geom_id, hit.prim_id);
        rank(self) < rank(other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::mem::offset_of;

    #[test]
    fn layouts_are_as_documented() {
        assert_eq!((size_of::<Ray>(), align_of::<Ray>()), (32, 4));
        assert_eq!(
            [
                offset_of!(Ray, org),
                offset_of!(Ray, tnear),
                offset_of!(Ray, dir),
                offset_of!(Ray, tfar)
            ],
            [0, 12, 16, 28]
        );
        assert_eq!((size_of::<Hit>(), align_of::<Hit>()), (24, 4));
        assert_eq!(
            [offset_of!(Hit, t), offset_of!(Hit, u), offset_of!(Hit, v)],
            [0, 4, 8]
        );
        assert_eq!(
            [
                offset_of!(Hit, prim_id),
                offset_of!(Hit, geom_id),
                offset_of!(Hit, inst_id)
            ],
            [12, 16, 20]
        );
    }

    #[test]
    fn closed_ends_are_next_to_the_open_ones_and_never_subnormal() {
        let tiny = f32::MIN_POSITIVE;
        for (tnear, tfar, near, far) in [
            (0.0, f32::INFINITY, -tiny, f32::INFINITY),
            (-0.0, 0.0, -tiny, tiny),
            (1e-45, 1e-40, -tiny, tiny),
            (tiny, tiny, 0.0, tiny.next_up()),
            (-tiny, -tiny, (-tiny).next_down(), 0.0),
            (-1e-45, 1.0, -tiny, 1.0f32.next_up()),
            (
                f32::NEG_INFINITY,
                f32::MAX,
                f32::NEG_INFINITY,
                f32::INFINITY,
            ),
            (-2.0, 3.0, (-2.0f32).next_down(), 3.0f32.next_up()),
            // Nothing lies in these, and nothing comes in.
            (1.0, 0.5, 1.0, 0.5),
            (tiny, 0.0, tiny, 0.0),
        ] {
            let ray = Ray {
                tnear,
                tfar,
                ..Ray::default()
            }
            .closed();
            assert_eq!((ray.tnear, ray.tfar), (near, far), "({tnear}, {tfar})");
            for end in [ray.tnear, ray.tfar] {
                assert!(!end.is_subnormal());
            }
        }
        let ray = Ray {
            tnear: f32::NAN,
            ..Ray::default()
        }
        .closed();
        assert!(ray.tnear.is_nan() && ray.tfar == f32::INFINITY);
    }
}
