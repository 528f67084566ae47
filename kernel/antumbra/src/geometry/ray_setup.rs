//! Ray set-up: a ray checked and made ready for traversal, once. No other place checks rays.
//!
//! # Why no box that matters is ever missed
//!
//! Let `u = 2⁻²⁴`, let `R = max|org| + reach`, where `reach` is the scene extent, its largest absolute
//! coordinate, and let `w = max|dir|`. Every corner of every primitive is within `R` of the origin on each
//! axis, so the rounding errors of a slab test and of the sheared corners are all bounded by small multiples of `u R`.
//! The plane distances of **node** boxes are widened by `32 u R`.
//!
//! - *Triangle*: as defined in [`crate::geometry::triangle_hit`], a hit is a mean `M` of the sheared corners whose weights
//!   are not negative, and right to `2⁻⁵¹`. Let `P` be the mean of the corners themselves with these weights: a point of
//!   the triangle. On the axis of the shear, the ray at the hit's distance `t` is off `P` by at most `3 u R`, one rounding
//!   each of the translation, of the reciprocal and of `t`. On the others `M` is 0, so the ray is off by those and `7 u R`
//!   more, for one rounding of the translation, four of the shear product, one of the difference of up to `2 R`. So every
//!   box that holds `P`, widened by `11 u R`, holds the ray at `t`.
//! - *Node*: its box holds the primitive, so it holds `P`. The reciprocal direction adds `u R`, clamping it `2⁻³⁹ R`,
//!   evaluating the slab `4.2 u R`, fused or not. All of it is less than the margin. So every node above a triangle that is
//!   hit is entered at `t` or before, and left at `t` or later: no tree, width, order or level can lose it. The same
//!   holds for every box around a part of the triangle with `P` in it.
//! - *Sphere, user geometry*: the distance is computed from the sphere, or returned by the user's function, and then
//!   *defined* to be clamped into the interval of the primitive's own box, whose plane distances are widened by
//!   `16 u R`. Node boxes hold that box, the same formula is monotonic in the planes, and the difference of the margins,
//!   `16 u R`, is more than all roundings of the two evaluations (`8.3 u R`). So a node above it is entered at or before
//!   the hit, again.
//!
//! Rays for which a product might overflow, or the margins underflow, are traced without culling, and nothing is clamped.
//!
//! # Why no tree decides what is hit in an instance
//!
//! An instance is entered by a ray made ready for its object: origin and direction are transformed without fused
//! operations and the direction keeps its length, so distances mean the same in both spaces. Within the object all of
//! the above holds, so what is hit there, and at which `t`, follows from nothing but the transformed ray and the
//! primitive. What remains is how the two spaces fit together, because rounding may place a hit outside of the boxes
//! that lead to it in the world. Hence these definitions:
//!
//! - The *instance interval* of a ray is the part of it inside the instance's box in the world, widened by `16 u R` like
//!   the interval of a sphere. The box follows from the primitives and the transform (see
//!   [`crate::geometry::instance`]). The instance is missed unless the instance interval shares a point with the open
//!   interval of the ray.
//! - A hit in the object at `t` counts as one at `t` clamped into the instance interval. The clamped distance lies in the
//!   interval of the ray, because `t` does and both intervals share a point. Hits are ranked by the clamped distances,
//!   then by ids. What is reported of a triangle follows from nothing but the ray in the object, so the box has no say in it:
//!   see [`crate::geometry::triangle_hit`].
//!
//! In the world the box of the instance takes the place of a sphere's: every node above it is entered
//! at or before the instance interval, so no tree can lose the instance, nor, among closest hits, one that counts
//! in that interval. In the object, a node is entered at or before the `t` of what is below it, before that is
//! clamped. Let `b` be the best distance so far. As long as `b` is less than the end of the instance interval, a hit of
//! use has a `t` of at most `b`: clamped down to the end it would come after `b`, and clamping up moves it away.
//! So boxes entered beyond `b` may be left out, in the object as in the world. Otherwise nothing is left out
//! before the end of the ray. A ray that is traced without culling in the world is never culled in instances, and
//! enters all of them.
//!
//! An occlusion query need not clamp: see the second definition.
//!
//! # What vectors in single precision can decide
//!
//! Vectors compute edge functions `e` of the sheared corners in single precision, their sum `D`, distances `tᵢ` of the
//! corners, and `T`, the sum of `e tᵢ`. Rounding is monotonic, so an edge function that is not zero has the sign of the
//! exact one, `E`, and edge functions of both signs are a miss. Let all be of one sign, and more than [`SMALL`] by
//! magnitude.
//!
//! Let `S` be the product of the largest sheared coordinates on the first two axes, by magnitude, `m` the largest `tᵢ` by
//! magnitude, and `t` the distance as defined. An edge function is a difference of two products of at most `S`, so it is
//! off by at most `4 u S`. For exact distances `zᵢ` of the corners the sum of `E (zᵢ - t)` is 0. So `T - t D` is the sum of
//! `(e - E) (zᵢ - t)` and roundings. The differences are at most `2 m (1 + 2 u)`, so this sum is at most `24 u S m`, and a
//! little more. The roundings of `tᵢ`, `T` and `t` are at most `5 u m D` together.
//!
//! Both `T - tnear D` and `tfar D - T` are compared with the doubt `24 u m (2 S + D)`, for an end of the interval or the
//! distance of the best hit so far. The excess is for the roundings of the comparison and of `D`, which are at most
//! `6 u m D` where that end is within `2 m`, and a few `u` of the difference itself where it is not. So a lane whose
//! differences both exceed the doubt is surely hit, and a lane with a difference less than the negative doubt surely is
//! not. Few lanes are left to be computed as defined. The triangle that a ray starts from is seldom one, because `m` is
//! small there.
//!
//! An interval that begins next to 0, as with a closed ray, is compared as if it began there, since `tnear D` would be
//! subnormal for triangles of ordinary size, which takes Intel's cores ten times as long. `D` is at most `24 R²`, so while `R` is
//! at most [`SMALL_REACH`], `tnear D` is within [`SLACK`]: a lane that is surely hit has a `t` beyond such a `tnear`, and
//! a lane with a hit between both is in doubt.
//!
//! Nothing overflows while `R` and `R / w` are within [`SANE`]; beyond, every lane is computed as defined. What
//! underflows in `e` is nothing beside [`SMALL`]. What underflows in `tᵢ` or `T` is less than [`SLACK`], which the doubt
//! has in addition: a unit is `2⁻¹⁵⁰`, and `D` at most `2⁸³`.

use core::ops::Deref;

use antumbra_simd::{Lanes, Mask, Scalar, Simd, Width};

use crate::aabb::Aabb;
use crate::geometry::slab_test::hits_box;
use crate::geometry::slab_test::{One, value, widened_offsets};
use crate::geometry::triangle_hit::ShearedRay;
use crate::ray::{INVALID_ID, Ray};

/// Margin of node boxes relative to `R`: `32 u`.
pub(crate) const NODE_MARGIN: f32 = 1.0 / (1 << 19) as f32;
/// An origin offset relative to the largest coordinate: as if every ray began at the far end of the box that holds everything, with
/// room for the roundings of its origin.
pub(crate) const ORIGIN_OFFSET: f32 = 2.125 * NODE_MARGIN;
/// Margin of the box of an instance or a sphere relative to `R`: `16 u`.
pub(crate) const PRIM_MARGIN: f32 = NODE_MARGIN / 2.0;
/// `24 u`: the doubt about a distance, see above.
pub(crate) const DOUBT: f32 = NODE_MARGIN * 0.75;
/// Edge functions of this magnitude or less are in doubt: `2⁻⁵⁰`.
pub(crate) const SMALL: f32 = 1.0 / (1u64 << 50) as f32;
/// `2⁻⁶⁵`: added to a doubt for what underflows, see above.
pub(crate) const SLACK: f32 = 1.0 / (1u128 << 65) as f32;
/// Lengths and distances between which no product of few of them leaves the range of `f32`, margins are far
/// from underflow, and distances far from overflow even along a clamped direction.
pub(crate) const SANE: (f32, f32) = (1.0 / (1u64 << 40) as f32, (1u64 << 40) as f32);
/// Up to this `R`, `tnear D` is less than a quarter of [`SLACK`] for a `tnear` next to 0: `2⁻¹²⁶ 24 R²` is less than `2⁻⁶⁷`.
const SMALL_REACH: f32 = (1 << 27) as f32;
/// Below this `R` the margins would drown in subnormal numbers, so nothing is culled.
const MIN_REACH: f32 = 1.0 / (1u64 << 60) as f32;
/// Below this, margins in units of `t` would drown.
const MIN_MARGIN: f32 = MIN_REACH * MIN_REACH * 1e6;
/// Direction components are brought up to this share of the largest, so that reciprocals stay finite and
/// empty slots (inverted infinite boxes) are missed. It moves a ray by less than `2⁻³⁹ R`.
pub(crate) const MIN_DIRECTION: f32 = 1.0 / (1u64 << 40) as f32;

/// The larger one; `b` if either is NaN. `f32::max` takes longer, to find the other one then.
#[inline(always)]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Whether a length is neither so small nor so large that distances underflow or overflow.
pub fn is_sane(length: f32) -> bool {
    SANE.0 < length && length < SANE.1
}

/// Lengths of a ray in units of which rounding errors are measured; a ray per lane.
pub(crate) struct Lengths<V> {
    /// Magnitudes of the direction.
    pub magnitudes: [V; 3],
    /// The largest of them, `w` above.
    pub largest: V,
    /// `1 / w`, the reciprocal of `largest`.
    pub shortest: V,
    /// `R` as above: the largest coordinate of the origin, by magnitude, plus the scene extent.
    pub reach: V,
    /// `R / w`.
    span: V,
}

impl<V> Lengths<V> {
    /// The lengths of rays with these origins and directions, among primitives whose coordinates are at most `extent`.
    #[inline(always)]
    pub fn new<const L: usize>(
        simd: V::Token,
        [ox, oy, oz]: [V; 3],
        [dx, dy, dz]: [V; 3],
        extent: f32,
    ) -> Self
    where
        V: Lanes<L>,
    {
        let [mx, my, mz] = [dx.flip_sign(dx), dy.flip_sign(dy), dz.flip_sign(dz)];
        let largest = mx.max(my).max(mz);
        let shortest = V::splat(simd, 1.0) / largest;
        let [ax, ay, az] = [ox.flip_sign(ox), oy.flip_sign(oy), oz.flip_sign(oz)];
        let reach = ax.max(ay).max(az) + V::splat(simd, extent);
        let span = reach * shortest;
        Self {
            magnitudes: [mx, my, mz],
            largest,
            shortest,
            reach,
            span,
        }
    }

    /// Whether `R` and `R / w` are [`SANE`].
    #[inline(always)]
    pub fn are_sane<const L: usize>(&self, simd: V::Token) -> V::Mask
    where
        V: Lanes<L>,
    {
        let (less, more) = (self.reach.min(self.span), self.reach.max(self.span));
        V::splat(simd, SANE.0).lt(less) & more.lt(V::splat(simd, SANE.1))
    }
}

/// Magnitudes of the reciprocal direction, of components brought up to `least`.
#[inline(always)]
pub(crate) fn steepness<const L: usize, V: Lanes<L>>(simd: V::Token, magnitude: V, least: V) -> V {
    V::splat(simd, 1.0) / magnitude.max(least)
}

/// A coordinate axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Axis {
    X,
    Y,
    Z,
}

/// One of the two planes of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Side {
    Low,
    High,
}

/// The near planes by the signs of the direction: bit 0 is set when it is negative on x.
pub(crate) const NEAR: [[Side; 4]; 8] = {
    let mut near = [[Side::Low; 4]; 8];
    let mut signs = 0;
    while signs < 8 {
        let mut axis = 0;
        while axis < 3 {
            if signs >> axis & 1 == 1 {
                near[signs][axis] = Side::High;
            }
            axis += 1;
        }
        signs += 1;
    }
    near
};

/// A ray made ready for one tree. Vectors have a fourth component of no meaning, so that they are worked
/// out and stored as one register.
///
/// 128 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct RaySetup {
    /// Input of the slab test: the reciprocal direction; `org * rdir`, widened so that near planes come nearer;
    /// the same, widened so that far planes go farther. 0, +∞ and -∞ when culling is off.
    pub(crate) slabs: [[f32; 4]; 3],
    /// Near plane of each axis. A fourth, so that they are copied as one word.
    pub(crate) near: [Side; 4],
    /// The axes x, y, z of the shear: z is the one of the largest direction component.
    pub(crate) axes: [Axis; 3],
    /// Lengths are not [`SANE`], or the interval begins at -∞: everything is in doubt.
    pub(crate) extreme: bool,
    ray: Ray,
    /// The origin on the axes of the shear.
    pub(crate) shear_org: [f32; 3],
    /// `dir_x / dir_z`, `dir_y / dir_z`, `-1 / dir_z` on those axes.
    pub(crate) shear: [f32; 3],
    /// `R` as above: the largest coordinate of the origin, by magnitude, plus the scene extent.
    reach: f32,
    /// `tnear` as vectors compare it: 0 if it is next to 0, see above.
    pub(crate) tnear_of_vectors: f32,
    /// The instance in whose space this is, or [`INVALID_ID`].
    pub(crate) inst_id: u32,
}

impl RaySetup {
    /// Whether the ray enters a box, as the test of node boxes has it: it may report a box that the ray barely misses.
    pub fn hits_box(&self, bounds: &Aabb) -> bool {
        hits_box(self, bounds)
    }

    /// The set-up of no ray; never traced.
    pub(crate) const IDLE: Self = Self {
        slabs: [[0.0; 4]; 3],
        near: [Side::Low; 4],
        axes: [Axis::X, Axis::Y, Axis::Z],
        extreme: false,
        ray: Ray {
            org: [0.0; 3],
            tnear: 0.0,
            dir: [0.0; 3],
            tfar: 0.0,
        },
        shear_org: [0.0; 3],
        shear: [0.0; 3],
        reach: 0.0,
        tnear_of_vectors: 0.0,
        inst_id: INVALID_ID,
    };

    /// `R` as above: the largest coordinate of the origin, by magnitude, plus the scene extent.
    #[inline(always)]
    pub(crate) fn reach(&self) -> f32 {
        self.reach
    }

    /// Makes a ray ready for primitives whose coordinates are at most `extent`; `None` when the ray cannot hit
    /// anything (see [`Ray`]).
    pub(crate) fn new(ray: &Ray, extent: f32) -> Option<Self> {
        let mut setup = Self::IDLE;
        setup.set(Scalar, ray, extent).then_some(setup)
    }

    /// [`RaySetup::new`] in place, which spares a stream the copy, and with the vectors of a level, which changes
    /// no bit. Returns whether the ray can hit anything; if not, what is in place is not to be traced.
    #[inline(always)]
    pub(crate) fn set<S: Simd>(&mut self, simd: S, ray: &Ray, extent: f32) -> bool {
        type Vector<S> = <S as Width<4>>::Lanes;
        let [ox, oy, oz] = ray.org;
        let [dx, dy, dz] = ray.dir;
        let (tnear, tfar) = (ray.tnear, ray.tfar);
        // No subnormal products in the lane of no meaning, either.
        let org = Vector::<S>::load(simd, &[ox, oy, oz, 0.0]);
        let dir = Vector::<S>::load(simd, &[dx, dy, dz, tfar]);
        let zero = Vector::<S>::splat(simd, 0.0);

        let one = |x| One::splat(Scalar, x);
        let lengths = Lengths::new::<1>(Scalar, ray.org.map(one), ray.dir.map(one), extent);
        let (largest, shortest) = (value(lengths.largest), value(lengths.shortest));
        // One test of all conditions: they never fail in practice. The fourth lane may be infinite.
        let finite = (org * zero + dir * zero).eq(zero).bits() & 7 == 7;
        if !(finite & (shortest < f32::INFINITY) & (tnear < tfar)) {
            return false;
        }
        // The first of the largest components; tables, because a CPU cannot guess which it is.
        const AXES: [[Axis; 4]; 3] = [
            [Axis::X, Axis::Y, Axis::Z, Axis::Y],
            [Axis::Y, Axis::Z, Axis::X, Axis::Z],
            [Axis::Z, Axis::X, Axis::Y, Axis::X],
        ];
        let [mx, my, _] = lengths.magnitudes.map(value);
        let which = usize::from(mx == largest) | usize::from(my == largest) << 1;
        let axes = [AXES[0][which], AXES[1][which], AXES[2][which]];

        let least = Vector::<S>::splat(simd, largest * MIN_DIRECTION);
        let steepness = steepness(simd, dir.flip_sign(dir), least);
        let rdir = steepness.copysign(dir);
        let reach = value(lengths.reach);
        let margin = reach * NODE_MARGIN;
        let margins = Vector::<S>::splat(simd, margin);
        let [near, far] = widened_offsets(org, [rdir, steepness], margins);

        self.ray = *ray;
        rdir.store(&mut self.slabs[0]);
        near.store(&mut self.slabs[1]);
        far.store(&mut self.slabs[2]);
        self.near = NEAR[rdir.lt(zero).bits() as usize & 7];
        self.axes = axes;
        self.reach = reach;
        let is_next_to_zero = (tnear.abs() <= f32::MIN_POSITIVE) & (reach <= SMALL_REACH);
        self.tnear_of_vectors = if is_next_to_zero { 0.0 } else { tnear };
        self.inst_id = INVALID_ID;
        // The largest component is not clamped, so its reciprocal serves the shear.
        let [x, y, z] = [axes[0] as usize, axes[1] as usize, axes[2] as usize];
        let along = shortest.copysign(ray.dir[z]);
        self.shear = [ray.dir[x] * along, ray.dir[y] * along, -along];
        self.shear_org = [ray.org[x], ray.org[y], ray.org[z]];
        self.extreme = false;
        if !(lengths.are_sane::<1>(Scalar).any() & (tnear > f32::NEG_INFINITY)) {
            self.set_extreme(margin * shortest);
        }
        true
    }

    /// Corrects the set-up for lengths that are not [`SANE`] and intervals that begin at -∞. `margin` is the margin of
    /// node boxes, in units of `t`.
    #[cold]
    #[inline(never)]
    fn set_extreme(&mut self, margin: f32) {
        self.extreme = true;
        let [x, y, z, _] = self.slabs[0].map(f32::abs);
        let safe = (4.0 * self.reach * max(max(x, y), z) < f32::MAX)
            & (self.reach > MIN_REACH)
            & (margin > MIN_MARGIN);
        if !safe {
            self.slabs = [[0.0; 4], [f32::INFINITY; 4], [f32::NEG_INFINITY; 4]];
        }
    }

    /// The reciprocal direction on an axis.
    #[inline(always)]
    pub(crate) fn rdir(&self, axis: usize) -> f32 {
        self.slabs[0][axis]
    }

    /// Whether the direction is negative on an axis, so that the near plane is the upper one.
    #[inline(always)]
    pub(crate) fn negative(&self, axis: usize) -> bool {
        self.near[axis] == Side::High
    }

    /// The ray on the axes of its shear.
    #[inline(always)]
    pub(crate) fn sheared(&self) -> ShearedRay {
        ShearedRay {
            org: self.shear_org,
            shear: self.shear,
            tnear: self.tnear,
            tfar: self.tfar,
        }
    }

    /// Whether boxes can be missed at all.
    #[inline(always)]
    pub(crate) fn culls(&self) -> bool {
        self.rdir(0) != 0.0
    }

    /// `org * rdir` on three axes, widened for the near and for the far plane of the box of an instance or a sphere; the
    /// fourth lanes have no meaning.
    #[inline(always)]
    pub(crate) fn prim_offsets<S: Simd>(&self, simd: S) -> [<S as Width<4>>::Lanes; 2] {
        type Vector<S> = <S as Width<4>>::Lanes;
        let [ox, oy, oz] = self.org;
        let org = Vector::<S>::load(simd, &[ox, oy, oz, 0.0]);
        let rdir = Vector::<S>::load(simd, &self.slabs[0]);
        let margin = Vector::<S>::splat(simd, self.reach * PRIM_MARGIN);
        widened_offsets(org, [rdir, rdir.flip_sign(rdir)], margin)
    }
}

impl Aabb {
    /// Distance from a surface at which a ray that leaves it should begin, if this box holds everything that can be
    /// hit: 2⁻¹⁸ of the scene extent and a sixteenth more. 0 for the empty box.
    ///
    /// Boxes are tested a little larger than they are, so that rounding never costs a hit. A ray that begins nearer to a
    /// surface may visit the leaf that holds that surface, even if it goes away from it. All answers are right, but
    /// occlusion queries take more steps. [`Bvh::origin_offset`](crate::Bvh::origin_offset) is the least one that keeps a surface from
    /// hiding what is above it.
    pub fn origin_offset(&self) -> f32 {
        self.reach() * ORIGIN_OFFSET
    }
}

/// The fields of the ray.
impl Deref for RaySetup {
    type Target = Ray;

    #[inline(always)]
    fn deref(&self) -> &Ray {
        &self.ray
    }
}
