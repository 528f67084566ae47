//! Segments of curves: bounds, exact test, nearest point.

use alloc::borrow::Cow;
use core::f64::consts::PI;

use antumbra_simd::{Dispatch, Isa, Lanes, Mask, Simd, Width, WithSimd};

use crate::aabb::Aabb;
use crate::geometry::instance::{cross, dot};
use crate::geometry::nearest::{Near, Place, minus};
use crate::geometry::primitives::dropped::DropReason;
use crate::geometry::ray_setup::{RaySetup, max};
use crate::geometry::scalar::{ScalarPrim, ScalarShape, SurfacePoint, clamped, is_finite_box};
use crate::geometry::triangle::Vector;
use crate::geometry::{BLOCK, Geometry};
use crate::hash::Random;
use crate::math;
use crate::ray::{Hit, Ray};

/// Thin curves, such as hairs, fur and grass: chains of straight segments whose radius changes linearly, owned or borrowed.
/// [`Curves::cubic`] makes them of Bezier curves and B-splines.
///
/// Segments are flat, and face every ray: what a ray sees of a segment is a strip, or a trapezoid, around its axis. This is
/// the flat curve of pbrt and Embree.
///
/// # What is hit
/// Let the plane be perpendicular to the ray, through its origin. The ray is a point of it, and a segment is projected
/// onto it along the ray. The nearest point of the projected segment is at a share `s` of its length, 0 at the first
/// point and 1 at the second one. The segment is hit if the distance to that point is at most the radius there,
/// `(1 - s) radius₀ + s radius₁`, and if the ray passes that point of the axis at a `t` in its interval. All of it is
/// computed in double precision, and in the same bits on every level.
///
/// Two segments that follow each other make a round joint: they share it, and no ray passes between them. The first and
/// the last end of a chain are cut off flat.
///
/// `u` of a hit is `s`. `v` goes from 0 at one side over 1/2 on the axis to 1 at the other side, which is on the left of
/// the axis for someone who looks along the ray with up along the axis. At a joint `v` counts across the axis of the
/// segment as well, and `u` is 0 or 1. [`Bvh::normal`](crate::Bvh::normal) is perpendicular to the axis and faces the ray. A
/// ray may hit several segments of a curve.
///
/// [`Bvh::closest`](crate::Bvh::closest) and its relatives find the nearest point of the axis. Curves have no inside.
///
/// Dropped at build are segments with a NaN or infinite number or a negative radius, with two radii that are zero, and with
/// two equal ends. An index beyond the last point but one is an error at build.
///
/// ```
/// use antumbra::shapes::Curves;
/// use antumbra::{Bvh, Geometry, Ray, Recipe};
///
/// // A blade of grass of two segments that ends in a tip.
/// let points = vec![[0.0, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0, 0.1], [0.5, 2.0, 0.0, 0.0]];
/// let blade = Geometry::curves(Curves::chain(points));
/// let bvh = Bvh::build(&[blade], &Recipe::default())?;
/// let ray = |x, y| Ray::new([x, y, 5.0], [0.0, 0.0, -1.0]);
/// let hit = bvh.intersect(&ray(0.05, 0.5)).expect("the first segment");
/// assert_eq!((hit.prim_id, hit.t, hit.u), (0, 5.0, 0.5));
/// assert!(!bvh.occluded(&ray(0.15, 0.5)));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves<'a> {
    /// Points with radii, `[n, 4]`: x, y, z, radius.
    pub points: Cow<'a, [[f32; 4]]>,
    /// The first point of each segment, `[m]`: segment `i` goes from point `segments[i]` to the next one. The place in this
    /// list is the `prim_id`. A segment whose successor in the list begins where it ends goes on there.
    pub segments: Cow<'a, [u32]>,
}

impl<'a> Curves<'a> {
    /// Curves from owned or borrowed buffers. Indices are checked when a tree is built.
    #[must_use]
    pub fn new(
        points: impl Into<Cow<'a, [[f32; 4]]>>,
        segments: impl Into<Cow<'a, [u32]>>,
    ) -> Self {
        Self {
            points: points.into(),
            segments: segments.into(),
        }
    }

    /// One curve through all points. Without a second point there is none.
    #[must_use]
    pub fn chain(points: impl Into<Cow<'a, [[f32; 4]]>>) -> Self {
        let points = points.into();
        let count = (points.len() as u32).saturating_sub(1);
        Self::new(points, (0..count).collect::<alloc::vec::Vec<_>>())
    }

    /// A segment, if it can be kept. Points are NaN if an index is out of range.
    fn segment(&self, prim_id: u32) -> Option<Result<CurveSegment, DropReason>> {
        let place = prim_id as usize;
        let first = *self.segments.get(place)?;
        let second = first.checked_add(1);
        let point = |index: Option<u32>| -> [f32; 4] {
            let point = index.and_then(|index| self.points.get(index as usize));
            point.copied().unwrap_or([f32::NAN; 4])
        };
        let ends = [point(Some(first)), point(second)];
        let radii = ends.map(|[.., radius]| radius);
        if radii.iter().any(|radius| *radius < 0.0) {
            return Some(Err(DropReason::NoRadius));
        }
        let neighbour = |place: Option<usize>| self.segments.get(place?).copied();
        let before = neighbour(place.checked_sub(1));
        let goes_on = [
            before.is_some_and(|before| before.checked_add(1) == Some(first)),
            second.is_some() && neighbour(place.checked_add(1)) == second,
        ];
        let sign = |goes_on: bool| if goes_on { -1.0 } else { 1.0 };
        let points = [0, 1].map(|end| {
            let [x, y, z, radius] = ends[end];
            [x, y, z, radius.copysign(sign(goes_on[end]))]
        });
        Some(CurveSegment { points }.checked())
    }
}

/// A segment of a curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurveSegment {
    /// Position and radius of both ends. The sign bit of a radius is set where the curve goes on.
    points: [[f32; 4]; 2],
}

impl CurveSegment {
    fn ends(&self) -> [[f32; 3]; 2] {
        self.points.map(|[x, y, z, _]| [x, y, z])
    }

    fn radii(&self) -> [f32; 2] {
        self.points.map(|[.., radius]| radius)
    }

    /// The segment, if it can be kept.
    fn checked(self) -> Result<Self, DropReason> {
        let [a, b] = self.ends();
        // Bounds ignore NaN.
        if !a
            .iter()
            .chain(&b)
            .chain(&self.radii())
            .all(|x| x.is_finite())
            || !is_finite_box(&self.bounds())
        {
            Err(DropReason::NotFinite)
        } else if a == b {
            Err(DropReason::CornersCoincide)
        } else if self.radii()[0] == 0.0 && self.radii()[1] == 0.0 {
            Err(DropReason::NoRadius)
        } else {
            Ok(self)
        }
    }

    fn goes_on(&self, end: usize) -> bool {
        self.radii()[end].is_sign_negative()
    }

    /// Radius at a share of the length.
    fn radius(&self, share: f64) -> f64 {
        let [first, second] = self.radii().map(|radius| f64::from(radius.abs()));
        (1.0 - share) * first + share * second
    }

    fn axis(&self) -> [f64; 3] {
        let [a, b] = self.ends().map(|end| end.map(f64::from));
        minus(b, a)
    }
}

impl ScalarShape for CurveSegment {
    /// Of the spheres around both ends, rounded outwards: the ray passes a point of the axis at a distance of at most its
    /// radius.
    fn bounds(&self) -> Aabb {
        let [a, b] = self.ends();
        let [r, s] = self.radii().map(f32::abs);
        Aabb {
            min: core::array::from_fn(|i| (a[i] - r).min(b[i] - s).next_down()),
            max: core::array::from_fn(|i| (a[i] + r).max(b[i] + s).next_up()),
        }
    }

    /// In double precision, which the levels share, so the bits are the same on all of them.
    fn hit(&self, _: u32, ray: &RaySetup, _: f32) -> Option<[f32; 3]> {
        let [org, dir] = [ray.org, ray.dir].map(|vector| vector.map(f64::from));
        let to_first = minus(self.ends()[0].map(f64::from), org);
        let axis = self.axis();
        let length2 = dot(dir, dir);
        let [first_along, axis_along] = [to_first, axis].map(|way| dot(way, dir) / length2);
        // As seen along the ray.
        let seen = |way: [f64; 3], along: f64| -> [f64; 3] {
            core::array::from_fn(|i| way[i] - along * dir[i])
        };
        let (first, axis) = (seen(to_first, first_along), seen(axis, axis_along));
        let seen_length2 = dot(axis, axis);
        // Seen from the end, both ends are the nearest point, and nothing is cut off.
        let foot = match seen_length2 > 0.0 {
            true => -dot(first, axis) / seen_length2,
            false => 0.0,
        };
        let is_cut_off = (foot < 0.0 && !self.goes_on(0)) || (foot > 1.0 && !self.goes_on(1));
        // Not `clamp`: NaN is out.
        let share = if foot < 0.0 { 0.0 } else { foot.min(1.0) };
        let nearest: [f64; 3] = core::array::from_fn(|i| first[i] + share * axis[i]);
        let distance2 = dot(nearest, nearest);
        let radius = self.radius(share);
        if is_cut_off || !(distance2 <= radius * radius) {
            return None;
        }
        let t = (first_along + share * axis_along) as f32;
        if !(ray.tnear < t && t < ray.tfar) {
            return None;
        }
        let t = clamped(&self.bounds(), t, ray)?;
        // At a joint as well v counts across the axis, so that it goes on from segment to segment.
        let off = if share == foot {
            distance2
        } else {
            let along = dot(nearest, axis);
            (distance2 - along * along / seen_length2).max(0.0)
        };
        let side = math::sqrt(off) / radius;
        // The vector goes from the ray to the axis.
        let is_right = dot(cross(axis, dir), nearest) > 0.0;
        let v = 0.5 + if is_right { -0.5 * side } else { 0.5 * side };
        // 0 / 0 at a tip.
        let v = if v.is_nan() { 0.5 } else { v };
        Some([t, share as f32, v as f32])
    }

    /// Towards the ray; if that runs along the axis, against it.
    fn normal(&self, ray: &Ray, _: &Hit) -> Option<[f64; 3]> {
        let dir = ray.dir.map(f64::from);
        let axis = self.axis();
        let along = dot(dir, axis) / dot(axis, axis);
        let across: [f64; 3] = core::array::from_fn(|i| along * axis[i] - dir[i]);
        Some(match dot(across, across) > 1e-24 * dot(dir, dir) {
            true => across,
            false => dir.map(|x| -x),
        })
    }

    /// Nearest point on the axis, not on the surface.
    fn near(&self, _: u32, place: &Place<'_>) -> Option<Near> {
        let [a, b] = self.ends().map(|end| place.in_world(end));
        let axis = minus(b, a);
        let share = dot(minus(place.point, a), axis) / dot(axis, axis);
        // An instance may flatten a segment to a point.
        let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
        let position = core::array::from_fn(|i| a[i] + share * axis[i]);
        Some(place.near(position, [share, 0.5]))
    }

    /// Area of the cone: its circumference in the middle times the length of its axis.
    fn area(&self) -> f64 {
        let axis = self.axis();
        2.0 * PI * self.radius(0.5) * math::sqrt(dot(axis, axis))
    }

    /// On the cone.
    fn surface_point(&self, random: &mut Random) -> SurfacePoint {
        let axis = self.axis();
        let share = random.unit();
        let normal = loop {
            let around = cross(axis, random.direction());
            let length2 = dot(around, around);
            if length2 > 1e-6 * dot(axis, axis) {
                let length = math::sqrt(length2);
                break around.map(|x| x / length);
            }
        };
        let radius = self.radius(share);
        SurfacePoint {
            position: core::array::from_fn(|i| {
                f64::from(self.ends()[0][i]) + share * axis[i] + radius * normal[i]
            }),
            normal,
        }
    }
}

/// Error bound of a distance across a ray in single precision, relative to `R`: `256 u`, see
/// [`CurveSegment::candidates`].
const ACROSS: f32 = 1.0 / (1 << 16) as f32;
/// Error bound of the place of the nearest point, times the length that is seen, relative to `R`: `512 u`.
const PLACE: f32 = 1.0 / (1 << 15) as f32;
/// Segments of which less than this share is seen are left to the test.
const SEEN2: f32 = 1.0 / (1 << 20) as f32;
/// More than all radii are off.
const WIDER: f32 = 1.0 + 1.0 / 64.0;

impl ScalarPrim for CurveSegment {
    const NAME: &'static str = "curves";
    const NOTHING: Self = Self {
        points: [[0.0; 4]; 2],
    };
    const NUMBERS: usize = 8;

    /// The rule in single precision, for all segments at once, in units of [`crate::geometry::ray_setup`].
    ///
    /// Let `a` be the way to the first end and `e` the axis, both as seen along the ray. Translation and projection
    /// leave an error of at most `28 u R` in `a`, and `28 u |axis|` in `e`. So at any share `s` the distance is off by
    /// at most `130 u R`. The share is not exact, but how far the distance may fall below what is found at `s` follows
    /// from the slope there, `g = s e² + a e`: by `g² / e²` of its square. `g` is 0 but for roundings, which for a ray
    /// that hits, with `|a| <= r + |e|`, are at most `(28 u R + 116 u |axis|) |e|` and a share of `r`. As `|axis|` is at
    /// most `3.5 R`, that is less than `PLACE R |e|`.
    // Away from the loops, and compiled for the level from wherever it is called.
    #[inline(never)]
    fn candidates<S: Simd>(simd: S, segments: &[Self; BLOCK], count: usize, ray: &RaySetup) -> u32 {
        let all = (1 << count) - 1;
        match ray.extreme {
            true => all,
            false => all & !Isa::of(simd).dispatch(Misses { segments, ray }),
        }
    }

    fn count(geometry: &Geometry<'_>) -> usize {
        match geometry {
            Geometry::Curves(curves) => curves.segments.len(),
            _ => 0,
        }
    }

    fn of(geometry: &Geometry<'_>, prim_id: u32) -> Option<Result<Self, DropReason>> {
        match geometry {
            Geometry::Curves(curves) => curves.segment(prim_id),
            _ => None,
        }
    }

    #[inline(always)]
    fn numbers(&self) -> [f32; 8] {
        let [[a, b, c, r], [x, y, z, s]] = self.points;
        [a, b, c, r, x, y, z, s]
    }

    fn from_numbers([a, b, c, r, x, y, z, s]: [f32; 8]) -> Result<Self, DropReason> {
        let points = [[a, b, c, r], [x, y, z, s]];
        Self { points }.checked()
    }
}

/// Which segments a ray misses, as bits.
struct Misses<'a> {
    segments: &'a [CurveSegment; BLOCK],
    ray: &'a RaySetup,
}

/// Three coordinates, a segment per lane.
type Vectors<S> = [Vector<S>; 3];

#[inline(always)]
fn splat<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> Vectors<S> {
    [
        Vector::<S>::splat(simd, x),
        Vector::<S>::splat(simd, y),
        Vector::<S>::splat(simd, z),
    ]
}

#[inline(always)]
fn dots<S: Simd>(a: Vectors<S>, b: Vectors<S>) -> Vector<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a + factor * b`
#[inline(always)]
fn plus<S: Simd>(a: Vectors<S>, factor: Vector<S>, b: Vectors<S>) -> Vectors<S> {
    [
        a[0] + factor * b[0],
        a[1] + factor * b[1],
        a[2] + factor * b[2],
    ]
}

impl WithSimd<BLOCK> for Misses<'_> {
    type Output = u32;

    #[inline(always)]
    fn with_simd<S: Simd + Width<BLOCK>>(self, simd: S) -> u32 {
        let Self { segments, ray } = self;
        let mut rows = [[0.0; 8]; BLOCK];
        for lane in 0..BLOCK {
            rows[lane] = segments[lane].numbers();
        }
        let [ax, ay, az, r, bx, by, bz, s] = simd.transpose(&rows);
        let [x, y, z] = ray.dir;
        let largest = max(max(x.abs(), y.abs()), z.abs());
        let [x, y, z] = [x / largest, y / largest, z / largest];
        let dir = splat(simd, [x, y, z]);
        let [ox, oy, oz] = splat(simd, ray.org);
        let zero = Vector::<S>::splat(simd, 0.0);
        let minus_per_length2 = Vector::<S>::splat(simd, -1.0 / (x * x + y * y + z * z));
        let (from, axis) = ([ax - ox, ay - oy, az - oz], [bx - ax, by - ay, bz - az]);
        // As seen along the ray.
        let a = plus::<S>(from, dots::<S>(from, dir) * minus_per_length2, dir);
        let e = plus::<S>(axis, dots::<S>(axis, dir) * minus_per_length2, dir);
        let length2 = dots::<S>(e, e);
        let share = (zero - dots::<S>(a, e)) / length2;
        let share = share.max(zero).min(Vector::<S>::splat(simd, 1.0));
        let off = plus::<S>(a, share, e);
        let across = Vector::<S>::splat(simd, ACROSS * ray.reach());
        let place = PLACE * ray.reach();
        let wide = Vector::<S>::splat(simd, WIDER) * r.max_size(s) + across;
        let least = wide * wide + Vector::<S>::splat(simd, place * place);
        // NaN is no miss.
        let is_seen = (Vector::<S>::splat(simd, SEEN2) * dots::<S>(axis, axis)).lt(length2);
        (is_seen & least.lt(dots::<S>(off, off))).bits()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_simd::Scalar;
    use antumbra_testkit::Rng;

    /// Whatever is hit is a candidate, however thin the segment, however far away the ray begins, also at the very edge.
    /// Few others are.
    #[test]
    fn what_is_hit_is_a_candidate() {
        let mut rng = Rng::new(77);
        let (mut hits, mut others, mut candidates) = (0, 0, 0);
        for case in 0..200_000 {
            let scale = |rng: &mut Rng, least: i32| 10f32.powi(least + rng.below(6) as i32);
            let length = scale(&mut rng, -5);
            let radius = length * scale(&mut rng, -6);
            let from = rng.point(1.0);
            let way = rng.direction();
            let to = [0, 1, 2].map(|axis| from[axis] + length * way[axis]);
            let sign = |rng: &mut Rng| if rng.below(2) == 0 { 1.0 } else { -1.0 };
            let radii = [radius, radius * rng.unit()].map(|radius| radius * sign(&mut rng));
            let points = [0, 1].map(|end| {
                let [x, y, z] = [from, to][end];
                [x, y, z, radii[end]]
            });
            let Ok(segment) = (CurveSegment { points }).checked() else {
                continue;
            };
            let segments = [segment; BLOCK];
            // Past a point of the axis, at about the radius there.
            let share = rng.unit() * 1.2 - 0.1;
            let dir = match case % 4 {
                // Nearly along the axis.
                0 => {
                    let off = rng.direction();
                    [0, 1, 2].map(|axis| way[axis] + 0.001 * off[axis])
                }
                _ => rng.direction(),
            };
            let across = cross(way.map(f64::from), dir.map(f64::from));
            let size = math::sqrt(dot(across, across));
            let most = f64::from(radius) * (0.5 + f64::from(rng.unit()));
            let back = scale(&mut rng, -2);
            let org = core::array::from_fn(|axis| {
                let on_axis = f64::from(from[axis]) + f64::from(share * length * way[axis]);
                (on_axis + most * across[axis] / size - f64::from(back * dir[axis])) as f32
            });
            let extent = segment.bounds().reach();
            let Some(ray) = RaySetup::new(&Ray::new(org, dir), extent) else {
                continue;
            };
            let is_hit = segment.hit(0, &ray, ray.tfar).is_some();
            let found = CurveSegment::candidates(Scalar, &segments, BLOCK, &ray);
            for isa in Isa::available() {
                let misses = isa.dispatch(Misses {
                    segments: &segments,
                    ray: &ray,
                });
                assert!(ray.extreme || misses == !found & 0xff, "{}", isa.level());
            }
            assert!(found == 0 || found == 0xff, "all lanes are the same");
            assert!(!is_hit || found == 0xff, "{segment:?} {:?}", *ray);
            hits += usize::from(is_hit);
            others += usize::from(!is_hit);
            candidates += usize::from(found != 0 && !is_hit);
        }
        assert!(
            hits > 20_000 && candidates < others,
            "{hits} {others} {candidates}"
        );
    }
}
