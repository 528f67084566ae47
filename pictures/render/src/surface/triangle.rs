//! Points and normals of triangles, with bounds of their rounding errors.

use antumbra_scene::{Shape, TriangleMesh};
use glam::{DVec3, Vec2, Vec3};

/// Texture coordinates of triangles whose mesh has none, as in pbrt.
pub const DEFAULT_UV: [Vec2; 3] = [Vec2::ZERO, Vec2::X, Vec2::ONE];

/// Half the distance between 1 and the next `f32`.
const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// Bound of the relative error of `n` rounded operations (Higham 2002, lemma 3.1).
pub const fn gamma(n: u32) -> f32 {
    let n = n as f32 * UNIT_ROUNDOFF;
    n / (1.0 - n)
}

/// Positions of the three vertices of a triangle.
#[inline]
pub fn corners(mesh: &TriangleMesh, triangle: u32) -> [Vec3; 3] {
    mesh.indices[triangle as usize].map(|i| Vec3::from(mesh.positions[i as usize]))
}

/// Colour of the vertices of a triangle, interpolated. `None` without colours.
#[inline]
pub fn vertex_color(mesh: &TriangleMesh, triangle: u32, weights: [f32; 3]) -> Option<Vec3> {
    if mesh.colors.is_empty() {
        return None;
    }
    let [a, b, c] = mesh.indices[triangle as usize].map(|i| mesh.colors[i as usize]);
    Some(a * weights[0] + b * weights[1] + c * weights[2])
}

/// Positions and normals at the vertices of a triangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Vertices {
    /// Positions of the three vertices.
    pub corners: [Vec3; 3],
    /// Normals. All 0 if the mesh has none.
    pub normals: [Vec3; 3],
}

impl Vertices {
    /// Vertices of these indices.
    #[inline]
    pub fn new(mesh: &TriangleMesh, indices: [u32; 3]) -> Self {
        Self {
            corners: indices.map(|i| Vec3::from(mesh.positions[i as usize])),
            normals: if mesh.normals.is_empty() {
                [Vec3::ZERO; 3]
            } else {
                indices.map(|i| mesh.normals[i as usize])
            },
        }
    }
}

/// Point of a triangle, with its error bound.
///
/// The bound covers the rounding of the interpolation, and the rounding of a later intersection test with
/// the triangle, which grows with the triangle's extent and has no epsilon of its own.
#[inline]
pub fn interpolate([p0, p1, p2]: [Vec3; 3], [w0, w1, w2]: [f32; 3]) -> (Vec3, Vec3) {
    let point = p0 * w0 + p1 * w1 + p2 * w2;
    let rounding = (p0 * w0).abs() + (p1 * w1).abs() + (p2 * w2).abs();
    let extent = p0.max(p1).max(p2) - p0.min(p1).min(p2);
    let error = rounding * gamma(7) + Vec3::splat(extent.max_element() * gamma(8));
    (point, error)
}

/// Unit geometric and shading normal of a triangle, whose [`Plane`] has the normal `plane`, at barycentric
/// `weights`, oriented as pbrt-v3 does.
///
/// Without vertex normals both are `(p1 - p0) x (p2 - p0)`, flipped if exactly one of `reverse_orientation` and a
/// mirroring transformation is in force. With vertex normals the shading normal is their interpolation, flipped only by
/// `reverse_orientation`. The geometric normal takes its side.
#[inline]
pub fn triangle_normals(
    shape: &Shape,
    vertices: &Vertices,
    plane: Vec3,
    weights: [f32; 3],
) -> (Vec3, Vec3) {
    let [geometric, shading] = sides(shape);
    oriented(plane * geometric, vertices.normals, weights, shading)
}

/// Factors, 1 or -1, that turn the plane's normal and the normals at the vertices to the sides of a shape.
#[inline]
pub fn sides(shape: &Shape) -> [f32; 2] {
    let side = |flip: bool| if flip { -1.0 } else { 1.0 };
    let flip = shape.reverse_orientation != shape.transform_swaps_handedness;
    [side(flip), side(shape.reverse_orientation)]
}

/// [`triangle_normals`] of a plane that is turned to its side, with the factor for normals at the vertices.
#[inline]
pub fn oriented(
    normal: Vec3,
    [n0, n1, n2]: [Vec3; 3],
    weights: [f32; 3],
    shading_side: f32,
) -> (Vec3, Vec3) {
    let mean = n0 * weights[0] + n1 * weights[1] + n2 * weights[2];
    let Some(mean) = mean.try_normalize() else {
        return (normal, normal);
    };
    let shading = mean * shading_side;
    if normal.dot(shading) < 0.0 {
        (-normal, shading)
    } else {
        (normal, shading)
    }
}

/// Plane of a triangle: its normal and twice its area.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plane {
    /// Direction of `(p1 - p0) x (p2 - p0)`. Some unit vector for a degenerate triangle.
    pub normal: Vec3,
    /// Twice the area of the triangle.
    pub double_area: f32,
}

impl Plane {
    /// Plane through three corners.
    ///
    /// Computed in double precision, since products of thin triangles cancel.
    #[inline]
    pub fn new(corners: [Vec3; 3]) -> Self {
        let [p0, p1, p2] = corners.map(DVec3::from);
        let cross = (p1 - p0).cross(p2 - p0);
        let length = cross.length();
        let scale = length.recip();
        let normal = if scale.is_finite() && scale > 0.0 {
            cross * scale
        } else {
            DVec3::Z
        };
        Self {
            normal: normal.as_vec3(),
            double_area: length as f32,
        }
    }
}

/// Distance from the point of barycentric `weights` to the nearest edge. Infinite or 0 for a degenerate triangle.
#[inline]
pub fn edge_distance([p0, p1, p2]: [Vec3; 3], weights: [f32; 3], double_area: f32) -> f32 {
    // A weight is the distance to the opposite edge over the height, which is twice the area over that edge.
    let edges = [p2 - p1, p0 - p2, p1 - p0];
    let ratio = |i: usize| weights[i] * weights[i] / edges[i].length_squared();
    ratio(0).min(ratio(1)).min(ratio(2)).sqrt() * double_area
}

/// Largest share of the way to the incentre by which [`inset`] moves a point. Only triangles narrower than a few
/// dozen rounding errors need more.
const MAX_INSET: f64 = 1.0 / 64.0;

/// Point of barycentric `weights`, moved towards the incentre until its distance from the edges is `wanted`, and the
/// distance that it has then. `distance` is its [`edge_distance`].
///
/// The incentre is as far from all edges. A share of the way there adds the same share of the difference. The share
/// is limited, so that no point wanders along a needle.
#[cold]
#[inline(never)]
pub fn inset(corners: [Vec3; 3], weights: [f32; 3], distance: f32, wanted: f32) -> (Vec3, f32) {
    let [p0, p1, p2] = corners.map(DVec3::from);
    let lengths = DVec3::new((p2 - p1).length(), (p0 - p2).length(), (p1 - p0).length());
    let perimeter = lengths.element_sum();
    let radius = (p1 - p0).cross(p2 - p0).length() / perimeter;
    let [distance, wanted] = [distance, wanted].map(f64::from);
    let share = if radius > distance {
        ((wanted - distance) / (radius - distance)).clamp(0.0, MAX_INSET)
    } else {
        0.0
    };
    let weights = DVec3::from(weights.map(f64::from));
    let moved = weights.lerp(lengths / perimeter, share);
    let point = p0 * moved.x + p1 * moved.y + p2 * moved.z;
    let distance = distance + share * (radius - distance).max(0.0);
    (point.as_vec3(), distance as f32)
}
