//! Flat curves: Embree's segments and ribbons as segments of the kernel.
//!
//! A linear primitive of Embree has round ends, with and without neighbours. The kernel has them only where a segment goes on.
//! So each chain begins and ends with a segment without length, which the kernel drops.
//!
//! A cubic primitive is a ribbon of quads that face the ray, as many as the tessellation rate says. Each quad lies within the
//! segment of the kernel with its ends and radii. The kernel finds the segments, and Embree's rule decides which are hit.

use antumbra::shapes::Curves;
use antumbra::{Geometry as Kernel, Hit};

use crate::abi::RtcRay;
use crate::commit::{Placed, PlacedInstance};
use crate::geometry::{Kind, State};
use crate::query::in_object;

/// Rays ignore hits within this many radii of their origin, as in official libraries.
const AVOIDED: f64 = 2.0;

/// What the points of a curve mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Basis {
    Linear,
    Bezier,
    BSpline,
    CatmullRom,
}

impl Basis {
    /// Visible segments of a primitive.
    fn pieces(self, state: &State) -> u32 {
        match self {
            Self::Linear => 1,
            _ => state.tessellation,
        }
    }

    /// Primitive and piece of a segment of the kernel.
    fn place(self, state: &State, prim_id: u32) -> (u32, u32) {
        let all = self.pieces(state) + 2;
        (prim_id / all, (prim_id % all).saturating_sub(1))
    }

    /// Weights of four points at a place of a cubic curve.
    fn weights(self, u: f64) -> [f64; 4] {
        let w = 1.0 - u;
        match self {
            Self::Linear => [w, u, 0.0, 0.0],
            Self::Bezier => [w * w * w, 3.0 * u * w * w, 3.0 * u * u * w, u * u * u],
            Self::BSpline => [
                w * w * w,
                (3.0 * u - 6.0) * u * u + 4.0,
                (3.0 * w - 6.0) * w * w + 4.0,
                u * u * u,
            ]
            .map(|weight| weight / 6.0),
            Self::CatmullRom => [
                -u * w * w,
                2.0 + u * u * (3.0 * u - 5.0),
                2.0 + w * w * (3.0 * w - 5.0),
                -w * u * u,
            ]
            .map(|weight| weight / 2.0),
        }
    }

    /// Weights of four points in the derivative by the place.
    fn slopes(self, u: f64) -> [f64; 4] {
        let w = 1.0 - u;
        match self {
            Self::Linear => [-1.0, 1.0, 0.0, 0.0],
            Self::Bezier => {
                [-w * w, w * w - 2.0 * u * w, 2.0 * u * w - u * u, u * u].map(|x| 3.0 * x)
            }
            Self::BSpline => [-w * w, u * (3.0 * u - 4.0), -w * (3.0 * w - 4.0), u * u]
                .map(|weight| weight / 2.0),
            Self::CatmullRom => [
                w * (2.0 * u - w),
                u * (9.0 * u - 10.0),
                -w * (9.0 * w - 10.0),
                u * (u - 2.0 * w),
            ]
            .map(|weight| weight / 2.0),
        }
    }
}

/// Points of a primitive, with radii: two, or four. `None` if an index is out of range.
fn points<const N: usize>(state: &State, prim: usize) -> Option<[[f32; 4]; N]> {
    let index = state.index.as_ref().filter(|index| prim < index.count)?;
    let vertices = state.vertices.as_ref()?;
    let [first] = index.read::<1, u32>(prim);
    let first = first as usize;
    let last = first.checked_add(N - 1)?;
    (last < vertices.count).then(|| std::array::from_fn(|place| vertices.read(first + place)))
}

/// Points of a primitive of any basis. A linear one has two, and no weight for others.
fn controls(basis: Basis, state: &State, prim: u32) -> Option<[[f32; 4]; 4]> {
    match basis {
        Basis::Linear => points(state, prim as usize).map(|[a, b]| [a, b, b, b]),
        _ => points(state, prim as usize),
    }
}

fn sum(points: &[[f32; 4]; 4], weights: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|axis| {
        let terms = (0..4).map(|place| weights[place] * f64::from(points[place][axis]));
        terms.sum()
    })
}

/// Curves as the kernel takes them. Primitives with an index out of range are dropped, as by Embree.
pub fn kernel_curves(basis: Basis, state: &State) -> Kernel<'static> {
    let pieces = basis.pieces(state);
    let count = state.index.as_ref().map_or(0, |index| index.count);
    let mut all: Vec<[f32; 4]> = Vec::new();
    let mut segments = Vec::new();
    for prim in 0..count {
        // Where there are too many points the index is out of range, which is an error of the build.
        let first = u32::try_from(all.len()).unwrap_or(u32::MAX);
        segments.extend((0..pieces + 2).map(|piece| first.saturating_add(piece)));
        let points = controls(basis, state, prim as u32).unwrap_or([[f32::NAN; 4]; 4]);
        let at = |place: u32| {
            let weights = basis.weights(f64::from(place) / f64::from(pieces));
            sum(&points, weights).map(|x| x as f32)
        };
        all.push(at(0));
        all.extend((0..=pieces).map(at));
        all.push(at(pieces));
    }
    Kernel::curves(Curves::new(all, segments))
}

/// A hit on a curve, with Embree's numbers.
pub struct CurveHit {
    pub prim: u32,
    pub t: f32,
    pub u: f32,
    pub v: f32,
    radius: f64,
}

/// A hit on a segment of the kernel as one on Embree's primitive; `None` if Embree's rule has none.
pub fn own_hit(
    basis: Basis,
    state: &State,
    instance: Option<&PlacedInstance>,
    ray: &RtcRay,
    hit: &Hit,
) -> Option<CurveHit> {
    let (prim, piece) = basis.place(state, hit.prim_id);
    let points = controls(basis, state, prim)?;
    if basis == Basis::Linear {
        let u = f64::from(hit.u);
        let radius = sum(&points, basis.weights(u))[3];
        return Some(CurveHit {
            prim,
            t: hit.t,
            u: hit.u,
            v: 0.0,
            radius,
        });
    }
    let pieces = f64::from(basis.pieces(state));
    let ends = [piece, piece + 1].map(|place| f64::from(place) / pieces);
    let (org, dir) = in_object(instance, ray.org, ray.dir);
    let seen = Seen::new(org, dir);
    let [a, b] = ends.map(|u| seen.point(sum(&points, basis.weights(u))));
    let slopes = ends.map(|u| seen.way(sum(&points, basis.slopes(u))));
    let radii = ends.map(|u| sum(&points, basis.weights(u))[3]);
    let [t, u, v] = on_quad([a, b], slopes, radii)?;
    let is_in = f64::from(ray.tnear) <= t && t <= f64::from(ray.tfar);
    is_in.then_some(CurveHit {
        prim,
        t: t as f32,
        u: ((f64::from(piece) + u) / pieces) as f32,
        v: (2.0 * v - 1.0) as f32,
        radius: (1.0 - u) * radii[0] + u * radii[1],
    })
}

/// A space in which the ray is the axis z, in units of its direction.
struct Seen {
    org: [f64; 3],
    axes: [[f64; 3]; 3],
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

impl Seen {
    fn new(org: [f32; 3], dir: [f32; 3]) -> Self {
        let dir = dir.map(f64::from);
        let length2 = dot(dir, dir);
        let smallest = (0..3).min_by(|&a, &b| dir[a].abs().total_cmp(&dir[b].abs()));
        let mut across = [0.0; 3];
        across[smallest.unwrap_or(0)] = 1.0;
        let x = cross(across, dir);
        let length = dot(x, x).sqrt();
        let x = x.map(|x| x / length);
        let y = cross(dir, x).map(|y| y / length2.sqrt());
        Self {
            org: org.map(f64::from),
            axes: [x, y, dir.map(|z| z / length2)],
        }
    }

    fn way(&self, [x, y, z, _]: [f64; 4]) -> [f64; 3] {
        self.axes.map(|axis| dot(axis, [x, y, z]))
    }

    fn point(&self, [x, y, z, w]: [f64; 4]) -> [f64; 3] {
        let [a, b, c] = self.org;
        self.way([x - a, y - b, z - c, w])
    }
}

/// Where the axis z hits the quad around a piece: `t`, and places along and across. The back of a quad is not hit.
fn on_quad(ends: [[f64; 3]; 2], slopes: [[f64; 3]; 2], radii: [f64; 2]) -> Option<[f64; 3]> {
    let chord: [f64; 3] = std::array::from_fn(|axis| ends[1][axis] - ends[0][axis]);
    let corner = |end: usize, side: f64| -> [f64; 3] {
        let slope = match slopes[end] == [0.0; 3] {
            true => chord,
            false => slopes[end],
        };
        let length = slope[0].hypot(slope[1]);
        let across = [slope[1] / length, -slope[0] / length, 0.0];
        std::array::from_fn(|axis| ends[end][axis] + side * radii[end] * across[axis])
    };
    let [a, b, c, d] = [
        corner(0, 1.0),
        corner(1, 1.0),
        corner(1, -1.0),
        corner(0, -1.0),
    ];
    // Twice the area of the triangle of the origin and an edge, as seen along z.
    let turn = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
    let is_first = turn(d, b) <= 0.0;
    let [v0, v1, v2] = if is_first { [a, b, d] } else { [c, d, b] };
    let (along, across, last) = (turn(v0, v2), turn(v1, v0), turn(v2, v1));
    let area = along + across + last;
    // NaN is no hit.
    if !(along <= 0.0 && across <= 0.0 && last <= 0.0 && area < 0.0) {
        return None;
    }
    let [along, across, last] = [along, across, last].map(|part| part / area);
    let t = last * v0[2] + along * v1[2] + across * v2[2];
    let [u, v] = match is_first {
        true => [along, across],
        false => [1.0 - along, 1.0 - across],
    };
    Some([t, u, v])
}

/// Number of Embree's primitive.
pub fn own_prim(placed: &Placed, prim_id: u32) -> u32 {
    match placed.geometry.kind {
        Kind::Curves(basis) => basis.place(&placed.state, prim_id).0,
        _ => prim_id,
    }
}

/// Direction of a curve at a hit, which Embree calls its normal.
pub fn tangent(basis: Basis, state: &State, prim: u32, u: f32) -> [f32; 3] {
    let slope = controls(basis, state, prim).map(|points| sum(&points, basis.slopes(u.into())));
    slope.map_or([0.0; 3], |[x, y, z, _]| [x, y, z].map(|x| x as f32))
}

/// Whether a hit is by Embree's rule and far enough from the origin of the ray, if it is on a curve.
pub fn counts(placed: &Placed, instance: Option<&PlacedInstance>, ray: &RtcRay, hit: &Hit) -> bool {
    let Kind::Curves(basis) = placed.geometry.kind else {
        return true;
    };
    let (_, dir) = in_object(instance, ray.org, ray.dir);
    let dir = dir.map(f64::from);
    own_hit(basis, &placed.state, instance, ray, hit)
        .is_some_and(|own| f64::from(own.t) * dot(dir, dir).sqrt() > AVOIDED * own.radius)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights add up to 1, their slopes to 0, and slopes are derivatives.
    #[test]
    fn weights_and_their_slopes_fit() {
        for basis in [
            Basis::Linear,
            Basis::Bezier,
            Basis::BSpline,
            Basis::CatmullRom,
        ] {
            for step in 0..=8 {
                let (u, h) = (f64::from(step) / 8.0, 1e-6);
                let (weights, slopes) = (basis.weights(u), basis.slopes(u));
                assert!(
                    (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12,
                    "{basis:?}"
                );
                assert!(slopes.iter().sum::<f64>().abs() < 1e-12, "{basis:?} {u}");
                let (after, before) = (basis.weights(u + h), basis.weights(u - h));
                for place in 0..4 {
                    let slope = (after[place] - before[place]) / (2.0 * h);
                    assert!(
                        (slope - slopes[place]).abs() < 1e-8,
                        "{basis:?} {u} {place}"
                    );
                }
            }
        }
        assert_eq!(Basis::Bezier.weights(1.0), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(Basis::CatmullRom.weights(0.0), [0.0, 1.0, 0.0, 0.0]);
        assert_eq!(
            Basis::BSpline.weights(0.0),
            [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0, 0.0]
        );
    }
}
