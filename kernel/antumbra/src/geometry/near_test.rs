//! Lower bounds of the distances from a point to the triangles of a block, all lanes at once.
//!
//! # Why no bound is too large
//! For any vector `d` and all points `q` of a triangle, `d · (p - q)` is at least the smallest of the three
//! `d · (p - corner)`, since it is linear in `q`. And `|p - q|` is at least `d · (p - q) / |d|`. So the smallest of the three,
//! over `|d|`, is a bound, whatever `d` is. The bound is the distance if `d` runs from the nearest point to `p`.
//!
//! So the nearest point may be found in single precision, on slivers too: where that goes wrong the bound is small,
//! and a triangle more is measured in double precision.
//!
//! # Rounding
//! Differences of coordinates are at most `2 w`, where no coordinate of the point or a corner is larger than `w`. The sums
//! of three products and their difference are then off by less than `26 · 2⁻²⁴ · 2 w |d|`, so a bound by less than
//! `2⁻¹⁸ w`. That is [`MARGIN`], and callers add it to the distances they compare with. Rounding after that is relative, a
//! few parts in 10 million. Where products come near the ends of the range of `f32` nothing holds: see [`LEAST`] and [`MOST`].
//!
//! # Upper bounds
//! `|d|` itself is one: `d` runs from a point whose barycentric weights are positive and add up to 1, but for rounding. The
//! same margin covers that.

use antumbra_simd::Lanes;

use crate::geometry::edge_test::Corners;

/// By how much bounds may be off, in multiples of the largest coordinate.
pub(crate) const MARGIN: f64 = 1.0 / (1u64 << 18) as f64;
/// Squares of bounds that are smaller may be off by as much.
pub(crate) const LEAST: f32 = 1e-37;
/// Bounds mean something if no coordinate is as large.
pub(crate) const MOST: f32 = 1e18;

/// Squares of bounds of distances.
pub(crate) struct Bounds<V> {
    /// Lower bounds: not negative, never NaN.
    pub least2: V,
    /// Upper bounds, or NaN.
    pub most2: V,
}

impl<V> Bounds<V> {
    #[inline(always)]
    pub fn of<const L: usize>(token: V::Token, corners: &Corners<V>, point: [f32; 3]) -> Self
    where
        V: Lanes<L>,
    {
        let [[ax, bx, cx], [ay, by, cy], [az, bz, cz]] = *corners;
        let zero = V::splat(token, 0.0);
        let one = V::splat(token, 1.0);
        let to_point = [
            V::splat(token, point[0]) - ax,
            V::splat(token, point[1]) - ay,
            V::splat(token, point[2]) - az,
        ];
        let (ab, ac) = ([bx - ax, by - ay, bz - az], [cx - ax, cy - ay, cz - az]);
        let (bb, bc, cc) = (dot(ab, ab), dot(ab, ac), dot(ac, ac));
        let (pb, pc) = (dot(to_point, ab), dot(to_point, ac));
        // Shares of the way along the sides. A division by zero becomes one of the ends, as NaN does.
        let on_ab = (pb / bb).max(zero).min(one);
        let on_ac = (pc / cc).max(zero).min(one);
        let from_c = bb - bc;
        let on_bc = ((from_c + pc - pb) / (from_c + cc - bc)).max(zero).min(one);
        let off_bc = one - on_bc;
        // The squared distances there, less the one from the first corner.
        let (pb2, pc2) = (pb + pb, pc + pc);
        let to_ab = on_ab * (on_ab * bb - pb2);
        let to_ac = on_ac * (on_ac * cc - pc2);
        let to_bc = off_bc * (off_bc * bb - pb2) + on_bc * (on_bc * cc - pc2 + (bc + bc) * off_bc);
        let is_ac = to_ac.lt(to_ab);
        let u = V::select(is_ac, zero, on_ab);
        let v = V::select(is_ac, on_ac, zero);
        let is_bc = to_bc.lt(to_ab.min(to_ac));
        let u = V::select(is_bc, off_bc, u);
        let v = V::select(is_bc, on_bc, v);
        // Over the inside: the normal equations of the plane.
        let det = bb * cc - bc * bc;
        let (inner_u, inner_v) = (cc * pb - bc * pc, bb * pc - bc * pb);
        let is_inside = zero.lt(inner_u) & zero.lt(inner_v) & (inner_u + inner_v).lt(det);
        let per_det = one / det;
        let u = V::select(is_inside, inner_u * per_det, u);
        let v = V::select(is_inside, inner_v * per_det, v);
        let d = [
            to_point[0] - u * ab[0] - v * ac[0],
            to_point[1] - u * ab[1] - v * ac[1],
            to_point[2] - u * ab[2] - v * ac[2],
        ];
        let along = dot(d, to_point) - dot(d, ab).max(dot(d, ac)).max(zero);
        // What is no number says nothing.
        let along = along.max(zero);
        let most2 = dot(d, d);
        let length2 = most2 + V::splat(token, f32::MIN_POSITIVE);
        let least2 = (along * (along / length2)).max(zero);
        Self { least2, most2 }
    }
}

#[inline(always)]
fn dot<const L: usize, V: Lanes<L>>(a: [V; 3], b: [V; 3]) -> V {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
