//! Polygons as triangles.

use earcut::Earcut;
use glam::{DVec2, DVec3};

/// Area that triangles of a fan may lie outside, as a part of the polygon's: rounding puts corners beside straight edges.
const OUTSIDE: f64 = 1e-6;

/// Splits polygons with inward corners, as the crate `earcut` does, whose fan around the first corner leaves them.
///
/// `fan` has all triangles of one polygon, around its first corner; other polygons stay fans. The polygon is seen along the
/// sum of the triangles' normals, and triangles that its corners do not need become points.
pub fn split<C: Copy>(fan: &mut [[C; 3]], position: impl Fn(C) -> DVec3) {
    let Some(&[first, second, _]) = fan.first().filter(|_| fan.len() > 1) else {
        return;
    };
    let normal_of = |&[a, b, c]: &[C; 3]| {
        let origin = position(a);
        (position(b) - origin).cross(position(c) - origin)
    };
    let normal: DVec3 = fan.iter().map(normal_of).sum();
    let least = -OUTSIDE * normal.length_squared();
    let is_outside = |triangle: &[C; 3]| normal_of(triangle).dot(normal) < least;
    if !normal.is_finite() || !fan.iter().any(is_outside) {
        return;
    }
    let mut corners = vec![first, second];
    corners.extend(fan.iter().map(|&[_, _, last]| last));
    let (u, v) = normal.normalize().any_orthonormal_pair();
    let seen = |&corner: &C| {
        let place = position(corner) - position(first);
        DVec2::new(place.dot(u), place.dot(v))
    };
    let points: Vec<DVec2> = corners.iter().map(seen).collect();
    let mut order: Vec<u32> = Vec::new();
    let flat = points.iter().map(|point| point.to_array());
    Earcut::new().earcut(flat, &[], &mut order);
    if order.is_empty() {
        return;
    }
    let triangles = order.as_chunks::<3>().0.iter().map(|&[a, b, c]| {
        let [p, q, r] = [a, b, c].map(|index| points[index as usize]);
        let turned = if (q - p).perp_dot(r - p) < 0.0 {
            [a, c, b]
        } else {
            [a, b, c]
        };
        turned.map(|index| corners[index as usize])
    });
    let none = std::iter::repeat([first; 3]);
    for (old, new) in fan.iter_mut().zip(triangles.chain(none)) {
        *old = new;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area that the triangles cover, seen from above, and the number that look up.
    fn covered(points: &[DVec3]) -> (f64, usize) {
        let last = points.len() as u32 - 1;
        let mut fan: Vec<[u32; 3]> = (1..last).map(|index| [0, index, index + 1]).collect();
        split(&mut fan, |corner| points[corner as usize]);
        let areas = fan.iter().map(|corners| {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            (b - a).cross(c - a).z / 2.0
        });
        let areas: Vec<f64> = areas.collect();
        (
            areas.iter().map(|area| area.abs()).sum(),
            areas.iter().filter(|&&area| area > 0.0).count(),
        )
    }

    #[test]
    fn inward_corners_are_inside_of_no_triangle() {
        let on = |list: &[[f64; 2]], slope: f64| -> Vec<DVec3> {
            list.iter()
                .map(|&[x, y]| DVec3::new(x, y, slope * x))
                .collect()
        };
        // An L from its outermost corner, an arrow, and a comb of a hundred teeth.
        let l = [[2., 0.], [2., 1.], [1., 1.], [1., 2.], [0., 2.], [0., 0.]];
        let arrow = [[0., 0.], [2., 1.], [0., 2.], [1., 1.]];
        let mut comb = vec![[0.0, -1.0], [200.0, -1.0]];
        comb.extend((0..=200).rev().map(|x| [f64::from(x), f64::from(x % 2)]));
        for (points, area) in [(&l[..], 3.0), (&arrow, 1.0), (&comb, 300.0)] {
            for slope in [0.0, 1.0, 30.0] {
                let (found, up) = covered(&on(points, slope));
                assert!((found - area).abs() < 1e-9, "{found} for {area}");
                assert_eq!(up, points.len() - 2);
            }
            let back: Vec<[f64; 2]> = points.iter().rev().copied().collect();
            let (found, up) = covered(&on(&back, 1.0));
            assert!((found - area).abs() < 1e-9 && up == 0, "{found} for {area}");
        }
    }

    #[test]
    fn other_polygons_stay_fans() {
        let square = [[0., 0.], [1., 0.], [2., 0.], [2., 2.], [0., 2.]];
        let odd = [[0., 0.], [0., 0.], [0., 0.], [0., 0.]];
        let broken = [[0., 0.], [f64::NAN, 0.], [0., 1.], [1., 1.]];
        for points in [&square[..], &odd, &broken] {
            let last = points.len() as u32 - 1;
            let mut fan: Vec<[u32; 3]> = (1..last).map(|i| [0, i, i + 1]).collect();
            let before = fan.clone();
            split(&mut fan, |corner| {
                DVec2::from(points[corner as usize]).extend(0.0)
            });
            assert_eq!(fan, before);
        }
    }
}
