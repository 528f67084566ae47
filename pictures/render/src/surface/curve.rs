//! Points of curves, as pbrt-v3 has them.

use std::f32::consts::PI;

use antumbra::Hit;
use antumbra_scene::{CurveProfile, Curves};
use glam::{Vec2, Vec3};

use super::shapes::{Placement, Shapes};
use super::triangle::gamma;

/// Part of a curve that a straight segment of the kernel replaces: the number of the curve, and `u` at both ends.
pub type CurvePart = (u32, [f32; 2]);

/// Distance of a curve from its segments, in radii. The bound of pbrt-v3.
const TOLERANCE: f32 = 0.1;

/// Distance in radii at which rays begin from the plane through the axis and across the normal.
///
/// A ray that begins at least one radius away, and leads away from the plane, misses the strip around the axis: either the
/// nearest point of the axis is behind it, or it passes the axis at more than a radius. The rest is for curves that are bent
/// between the ends of a segment.
const CLEARANCE: f32 = 1.25;

/// Curves as the kernel takes them, and the part of each segment.
pub fn segments(curves: &Curves) -> (antumbra::shapes::Curves<'static>, Vec<CurvePart>) {
    let basis = antumbra::shapes::CurveBasis::Bezier;
    let cubic = antumbra::shapes::Curves::cubic(&curves.points, &curves.first, basis, TOLERANCE);
    cubic.map_or_else(Default::default, |cubic| (cubic.curves, cubic.parts))
}

/// Point of a curve that a ray has hit, in the world.
#[derive(Clone, Copy, Debug)]
pub struct CurvePoint {
    /// Position: on the axis of the curve, moved across it.
    pub point: Vec3,
    /// Unit normal. It points away from the ray, unless `ReverseOrientation` or a reflection turns it.
    pub normal: Vec3,
    /// Change of the position along the curve and across it, per unit of u and v.
    pub tangents: [Vec3; 2],
    /// Parameter along the curve, and place across it.
    pub uv: Vec2,
    /// Point above which rays begin.
    pub start: Vec3,
    /// Distance from `start` at which rays begin.
    pub distance: f32,
}

impl CurvePoint {
    /// Point of `curves`, the shape at `index`, that a ray from the direction `wo` has hit.
    pub fn new(
        shapes: &Shapes,
        (index, curves): (usize, &Curves),
        hit: &Hit,
        wo: Vec3,
        placement: Option<&Placement>,
    ) -> Self {
        let shape = &shapes[index];
        let (curve, [from, to]) = shapes.curve_parts(index)[hit.prim_id as usize];
        let u = from + hit.u * (to - from);
        let control = curves.control(curve);
        let axis = Axis::new(&control, u);
        // The kernel counts v from the left, and pbrt from the right. A reflection exchanges them.
        let is_mirrored = shape.transform_swaps_handedness;
        let v = if is_mirrored { hit.v } else { 1.0 - hit.v };
        let dir = placement.map_or(-wo, |placement| placement.ray(Vec3::ZERO, -wo)[1]);
        let along = axis.tangent.normalize_or(Vec3::X);
        let right = dir.cross(along);
        let right = match right.length_squared() > 1e-12 * dir.length_squared() {
            true => right.normalize(),
            false => along.any_orthonormal_vector(),
        };
        let away = along.cross(right);
        let across = if is_mirrored { -right } else { right };
        let radius = axis.radius;
        let offset = across * (radius * (2.0 * v - 1.0));
        let (sin, cos) = match curves.profile {
            CurveProfile::Flat => (0.0, 1.0),
            CurveProfile::Round => libm::sincosf((v - 0.5) * PI),
        };
        let side = if shape.reverse_orientation == is_mirrored {
            1.0
        } else {
            -1.0
        };
        let normal = (away * cos + across * sin) * side;
        let around = (across * cos - away * sin) * (2.0 * radius);
        let size = control
            .iter()
            .flatten()
            .fold(0.0, |most: f32, x| most.max(x.abs()));
        let error = Vec3::splat(size * gamma(16));
        let here = Self {
            point: axis.point + offset,
            normal,
            tangents: [axis.tangent, around],
            uv: Vec2::new(u, v),
            start: axis.point + offset - normal * normal.dot(offset),
            distance: CLEARANCE * radius + 2.0 * error.x,
        };
        let Some(placement) = placement else {
            return here;
        };
        let (point, error) = placement.point(here.point, error);
        let normal = placement.normal(normal);
        let offset = placement.tangent(offset);
        let [wide, high] = [across, away].map(|way| placement.tangent(way * radius).length());
        Self {
            point,
            normal,
            tangents: here.tangents.map(|tangent| placement.tangent(tangent)),
            uv: here.uv,
            start: point - normal * normal.dot(offset),
            distance: CLEARANCE * wide.max(high) + 2.0 * error.max_element(),
        }
    }
}

/// Change of the position along the curve, at a point near the segment `primitive` of `curves`, the shape at `index`.
pub fn tangent_near(
    shapes: &Shapes,
    (index, curves): (usize, &Curves),
    primitive: u32,
    point: Vec3,
) -> Vec3 {
    let (curve, [from, to]) = shapes.curve_parts(index)[primitive as usize];
    let control = curves.control(curve);
    let [first, last] = [from, to].map(|u| Axis::new(&control, u).point);
    let chord = last - first;
    let share = (point - first).dot(chord) / chord.length_squared();
    // NaN is 0.
    let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
    Axis::new(&control, from + share * (to - from)).tangent
}

/// A point on the axis of a curve.
struct Axis {
    point: Vec3,
    radius: f32,
    /// Change of the position with u.
    tangent: Vec3,
}

impl Axis {
    /// Point at a parameter (de Casteljau).
    fn new(control: &[[f32; 4]; 4], u: f32) -> Self {
        let points = control.map(|[x, y, z, _]| Vec3::new(x, y, z));
        let radii = control.map(|[.., radius]| radius);
        let [a, b, c, d] = points;
        let [ab, bc, cd] = [a.lerp(b, u), b.lerp(c, u), c.lerp(d, u)];
        let (abc, bcd) = (ab.lerp(bc, u), bc.lerp(cd, u));
        let derivative = 3.0 * (bcd - abc);
        let mix = |a: f32, b: f32| (1.0 - u) * a + u * b;
        let [r, s, t] = [0, 1, 2].map(|i| mix(radii[i], radii[i + 1]));
        Self {
            point: abc.lerp(bcd, u),
            radius: mix(mix(r, s), mix(s, t)),
            // Where three control points coincide, as in pbrt-v3.
            tangent: match derivative.length_squared() > 0.0 {
                true => derivative,
                false => d - a,
            },
        }
    }
}

#[cfg(test)]
mod tests;
