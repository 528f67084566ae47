//! Distances of a grid of points from a scan.

use antumbra::{Aabb, Bvh};

use crate::Outcome;
use crate::compare::{Ways, compare};
use crate::input::{Mesh, dot, less};
use crate::rtc::Rtc;

/// Whether Embree's program begins a search within what the point before allows.
const WAYS: &Ways<bool> = &[("point query", false), ("point query, bounded", true)];

/// So many points to a side, in the box of the mesh and a tenth around it.
pub fn run(rtc: &Rtc, mesh: &Mesh, side: usize) -> Outcome {
    let bounds = Aabb::around(&mesh.positions);
    let size = [0, 1, 2].map(|axis| bounds.max[axis] - bounds.min[axis]);
    let points: Vec<[f32; 3]> = (0..side * side * side)
        .map(|index| {
            let row = index / side;
            // Every other row backwards, so that each point is beside the one before.
            let column = if row.is_multiple_of(2) {
                index % side
            } else {
                side - 1 - index % side
            };
            let slice = row / side;
            let line = if slice.is_multiple_of(2) {
                row % side
            } else {
                side - 1 - row % side
            };
            let places =
                [column, line, slice].map(|place| 1.2 * (place as f32 + 0.5) / side as f32 - 0.1);
            [0, 1, 2].map(|axis| bounds.min[axis] + places[axis] * size[axis])
        })
        .collect();
    let ours = |bvh: &Bvh| {
        let distance = |found: Option<antumbra::ClosestPoint>| {
            found.map_or(f32::INFINITY, |found| found.distance)
        };
        bvh.points(&points).closest().into_iter().map(distance).collect()
    };
    let embree =
        |is_bounded, share: usize| rtc.distances(mesh, &points[..points.len() / share], is_bounded);
    let compared = compare(rtc, mesh, ours, WAYS, embree);
    let smallest = 1e-6 * dot(size, size).sqrt();
    let both = compared.ours.iter().zip(&compared.embree);
    let differ = both
        .filter(|(a, b)| (*a - *b).abs() > 1e-4 * *a + smallest)
        .count();
    Ok(compared.row(points.len() as u64, points.len(), differ))
}

/// Square of the distance of a point from a triangle, by the region of its plane that the point is above (Ericson 2004,
/// "Real-Time Collision Detection", 5.1.5).
pub fn distance2(point: [f32; 3], [a, b, c]: [[f32; 3]; 3]) -> f32 {
    let (ab, ac) = (less(b, a), less(c, a));
    let to = |s: f32, t: f32| {
        let off = [0, 1, 2].map(|axis| point[axis] - a[axis] - s * ab[axis] - t * ac[axis]);
        dot(off, off)
    };
    let along = |corner: [f32; 3]| {
        let off = less(point, corner);
        (dot(ab, off), dot(ac, off))
    };
    let (b_at_a, c_at_a) = along(a);
    if b_at_a <= 0.0 && c_at_a <= 0.0 {
        return to(0.0, 0.0);
    }
    let (b_at_b, c_at_b) = along(b);
    if b_at_b >= 0.0 && c_at_b <= b_at_b {
        return to(1.0, 0.0);
    }
    let beyond_ab = b_at_a * c_at_b - b_at_b * c_at_a;
    if beyond_ab <= 0.0 && b_at_a >= 0.0 && b_at_b <= 0.0 {
        return to(b_at_a / (b_at_a - b_at_b), 0.0);
    }
    let (b_at_c, c_at_c) = along(c);
    if c_at_c >= 0.0 && b_at_c <= c_at_c {
        return to(0.0, 1.0);
    }
    let beyond_ac = b_at_c * c_at_a - b_at_a * c_at_c;
    if beyond_ac <= 0.0 && c_at_a >= 0.0 && c_at_c <= 0.0 {
        return to(0.0, c_at_a / (c_at_a - c_at_c));
    }
    let beyond_bc = b_at_b * c_at_c - b_at_c * c_at_b;
    let (from_b, from_c) = (c_at_b - b_at_b, b_at_c - c_at_c);
    if beyond_bc <= 0.0 && from_b >= 0.0 && from_c >= 0.0 {
        let part = from_b / (from_b + from_c);
        return to(1.0 - part, part);
    }
    let all = beyond_ab + beyond_ac + beyond_bc;
    to(beyond_ac / all, beyond_ab / all)
}
