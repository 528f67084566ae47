//! Ribbons: curves of a width that face given normals, as meshes.

use antumbra_scene::TriangleMesh;
use glam::DVec3;

use super::curve::Bezier;
use super::grid;

/// Largest number of pieces of a segment.
const MAX_PIECES: f64 = 64.0;

/// Largest angle by which a ribbon turns in one piece.
const MAX_TWIST: f64 = std::f64::consts::PI / 32.0;

/// Mesh of a ribbon, by its segments, its widths at both ends, and its normals at the ends of the segments. The texture
/// coordinate u goes from 0 to 1 along each segment, as in pbrt-v3.
///
/// The deviation from the curve is at most a twentieth of its width, the bound to which pbrt-v3 refines.
pub(super) fn mesh(segments: &[Bezier], widths: [f64; 2], normals: &[DVec3]) -> TriangleMesh {
    let tolerance = widths[0].max(widths[1]) / 20.0;
    let mut ribbon = TriangleMesh::default();
    for (index, segment) in segments.iter().enumerate() {
        let ends = [normals[index], normals[index + 1]];
        let twist = ends[0].angle_between(ends[1]) / MAX_TWIST;
        let pieces = pieces(segment, tolerance).max(twist.ceil() as u32);
        let part = grid::mesh([pieces, 1], |u, v| {
            let tangent = tangent(segment, u);
            let normal = slerp(ends[0], ends[1], u)
                .reject_from_normalized(tangent)
                .try_normalize()
                .unwrap_or_else(|| tangent.any_orthonormal_vector());
            let along = (index as f64 + u) / segments.len() as f64;
            let width = widths[0] + along * (widths[1] - widths[0]);
            let across = normal.cross(tangent) * ((v - 0.5) * width);
            (point(segment, u) + across, normal)
        });
        let offset = ribbon.positions.len() as u32;
        let indices = part
            .indices
            .iter()
            .map(|corners| corners.map(|i| i + offset));
        ribbon.indices.extend(indices);
        ribbon.positions.extend(part.positions);
        ribbon.normals.extend(part.normals);
        ribbon.uvs.extend(part.uvs);
    }
    ribbon
}

/// Number of pieces, equal in the parameter, that stay within the tolerance.
///
/// A chord deviates by at most 1/8 of the second derivative times the square of the parameter's step.
fn pieces(c: &Bezier, tolerance: f64) -> u32 {
    let bend = (c[0] - 2.0 * c[1] + c[2]).length();
    let bend = bend.max((c[1] - 2.0 * c[2] + c[3]).length());
    (6.0 * bend / (8.0 * tolerance))
        .sqrt()
        .ceil()
        .clamp(1.0, MAX_PIECES) as u32
}

/// Point of the curve (de Casteljau).
fn point(c: &Bezier, t: f64) -> DVec3 {
    let [a, b, d] = [c[0].lerp(c[1], t), c[1].lerp(c[2], t), c[2].lerp(c[3], t)];
    a.lerp(b, t).lerp(b.lerp(d, t), t)
}

/// Unit tangent. Where the derivative is 0, the direction from the first to the last control point, as in pbrt-v3.
fn tangent(c: &Bezier, t: f64) -> DVec3 {
    let [a, b, d] = [c[1] - c[0], c[2] - c[1], c[3] - c[2]];
    let derivative = a.lerp(b, t).lerp(b.lerp(d, t), t);
    let unit = derivative.try_normalize();
    unit.or((c[3] - c[0]).try_normalize()).unwrap_or(DVec3::X)
}

/// Spherical linear interpolation of two normals, which are scaled to unit length first.
fn slerp(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    let [a, b] = [a, b].map(|n| n.normalize_or(DVec3::Z));
    let angle = a.dot(b).clamp(0.0, 1.0).acos();
    if angle < 1e-6 {
        return a.lerp(b, t);
    }
    (a * ((1.0 - t) * angle).sin() + b * (t * angle).sin()) / angle.sin()
}
