//! Hits on flat curves by Embree's rule.

use antumbra::Hit;

use crate::abi::RtcRay;
use crate::geometry::curves::{controls, sum};
use crate::geometry::{Basis, Kind, State};
use crate::scene::Site;

/// Rays ignore hits within this many radii of their origin, as in official libraries.
const AVOIDED: f64 = 2.0;

/// A hit on a curve, with Embree's numbers.
pub struct CurveHit {
    pub hit: Hit,
    radius: f64,
}

/// A hit on a segment of the kernel as one on Embree's primitive; `None` if Embree's rule has none.
pub fn own_hit(basis: Basis, site: Site<'_>, ray: &RtcRay, hit: &Hit) -> Option<CurveHit> {
    let state = site.state();
    let (prim_id, piece) = basis.place(state, hit.prim_id);
    let points = controls(basis, state, prim_id)?;
    if basis == Basis::Linear {
        return Some(CurveHit {
            hit: Hit {
                prim_id,
                v: 0.0,
                ..*hit
            },
            radius: sum(&points, basis.weights(hit.u.into()))[3],
        });
    }
    let pieces = f64::from(basis.pieces(state));
    let ends = [piece, piece + 1].map(|place| f64::from(place) / pieces);
    let (org, dir) = site.in_object(ray);
    let seen = Seen::new(org, dir);
    let [a, b] = ends.map(|u| seen.point(sum(&points, basis.weights(u))));
    let slopes = ends.map(|u| seen.way(sum(&points, basis.slopes(u))));
    let radii = ends.map(|u| sum(&points, basis.weights(u))[3]);
    let [t, u, v] = on_quad([a, b], slopes, radii)?;
    let is_in = f64::from(ray.tnear) <= t && t <= f64::from(ray.tfar);
    is_in.then_some(CurveHit {
        hit: Hit {
            prim_id,
            t: t as f32,
            u: ((f64::from(piece) + u) / pieces) as f32,
            v: (2.0 * v - 1.0) as f32,
            ..*hit
        },
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
pub fn own_prim(site: Site<'_>, prim_id: u32) -> u32 {
    match site.kind() {
        Kind::Curves(basis) => basis.place(site.state(), prim_id).0,
        _ => prim_id,
    }
}

/// Direction of a curve at a hit, which Embree calls its normal.
pub fn tangent(basis: Basis, state: &State, prim: u32, u: f32) -> [f32; 3] {
    let slope = controls(basis, state, prim).map(|points| sum(&points, basis.slopes(u.into())));
    slope.map_or([0.0; 3], |[x, y, z, _]| [x, y, z].map(|x| x as f32))
}

/// Whether a hit is by Embree's rule and far enough from the origin of the ray, if it is on a curve.
pub fn counts(site: Site<'_>, ray: &RtcRay, hit: &Hit) -> bool {
    let Kind::Curves(basis) = site.kind() else {
        return true;
    };
    let dir = site.in_object(ray).1.map(f64::from);
    own_hit(basis, site, ray, hit)
        .is_some_and(|own| f64::from(own.hit.t) * dot(dir, dir).sqrt() > AVOIDED * own.radius)
}
