//! Cones, paraboloids and hyperboloids: surfaces of revolution about the z axis, tessellated to meshes with smooth normals.
//!
//! Radii are scaled so that the mesh has the area of the exact surface, as for the other quadrics.

use antumbra_scene::TriangleMesh;
use glam::{DMat3, DVec3};

use super::grid;
use super::quadric::{Tessellation, empty, heights, radius, sweep};
use crate::lookup::{Lookup, POSITIVE};

/// Circle of a surface of revolution, or the part of one that is swept.
struct Ring {
    /// Point where the sweep begins.
    start: DVec3,
    /// Normal there, of any length.
    normal: DVec3,
    /// Second texture coordinate.
    v: f64,
}

/// Pieces of a meridian, for its area.
const PIECES: u32 = 4096;
/// Change of the scale of radii that shows how the area grows.
const STEP: f64 = 1e-3;

/// Makes the mesh of a surface from its rings, which are numbered from 0 to 1.
fn revolve(
    tessellation: Tessellation,
    rows: u32,
    sweep: f64,
    ring: impl Fn(f64) -> Ring,
) -> TriangleMesh {
    let make = |scale: f64| {
        let size = [tessellation.segments(sweep), rows];
        let mut mesh = grid::mesh(size, |u, row| {
            let turn = DMat3::from_rotation_z(u * sweep);
            let ring = ring(row);
            let scaled = ring.start * DVec3::new(scale, scale, 1.0);
            (turn * scaled, turn * ring.normal)
        });
        for uv in &mut mesh.uvs {
            uv.y = ring(uv.y.into()).v as f32;
        }
        mesh
    };
    let meridian = |piece: u32| {
        let start = ring(f64::from(piece) / f64::from(PIECES)).start;
        [start.truncate().length(), start.z]
    };
    let frustum = |piece: u32| {
        let [[r0, z0], [r1, z1]] = [meridian(piece), meridian(piece + 1)];
        0.5 * (r0 + r1) * (r1 - r0).hypot(z1 - z0)
    };
    let exact = sweep * (0..PIECES).map(frustum).sum::<f64>();
    // Close to 1, the area is linear in the scale.
    let [one, more] = [1.0, 1.0 + STEP].map(|scale| grid::area(&make(scale)));
    make(1.0 + STEP * (exact - one) / (more - one))
}

/// Reads a `cone` around z, without its base. `None`: a mistake was reported.
pub(super) fn cone(lookup: &mut Lookup, tessellation: Tessellation) -> Option<TriangleMesh> {
    let radius = radius(lookup);
    let height = f64::from(lookup.float_in("height", 1.0, POSITIVE));
    let sweep = sweep(lookup)?;
    Some(revolve(tessellation, 1, sweep, |v| Ring {
        start: DVec3::new(radius * (1.0 - v), 0.0, v * height),
        normal: DVec3::new(height, 0.0, radius),
        v,
    }))
}

/// Reads a `paraboloid` around z, with its vertex in the origin. `None`: a mistake was reported.
pub(super) fn paraboloid(lookup: &mut Lookup, tessellation: Tessellation) -> Option<TriangleMesh> {
    let radius = radius(lookup);
    let [low, high] = heights(lookup, 0.0);
    let sweep = sweep(lookup)?;
    if low == high || high == 0.0 {
        return empty(lookup);
    }
    // There is no surface on the other side of the vertex.
    let start = if high > 0.0 { low.max(0.0) } else { low };
    // Rows follow the radius, since the height bends at the vertex.
    let [from, to] = [start, high].map(|z| (z / high).sqrt());
    Some(revolve(tessellation, tessellation.rows(), sweep, |row| {
        let share = from + row * (to - from);
        let z = high * share * share;
        Ring {
            start: DVec3::new(radius * share, 0.0, z),
            normal: DVec3::new(radius * share, 0.0, -0.5 * radius * radius / high),
            v: ((z - low) / (high - low)).clamp(0.0, 1.0),
        }
    }))
}

/// Reads a `hyperboloid` around z, made by a line between two points. `None`: a mistake was reported.
///
/// As in pbrt-v3, the surface is symmetric about z = 0. The line is on it only where that holds for the line, too.
pub(super) fn hyperboloid(lookup: &mut Lookup, tessellation: Tessellation) -> Option<TriangleMesh> {
    let mut from = lookup.point("p1", DVec3::ZERO);
    let mut to = lookup.point("p2", DVec3::ONE);
    let sweep = sweep(lookup)?;
    if to.z == 0.0 {
        std::mem::swap(&mut from, &mut to);
    }
    let along = to - from;
    if along.z == 0.0 || (along.truncate() == from.truncate() && from.x == 0.0 && from.y == 0.0) {
        return empty(lookup);
    }
    let squared = squared_radius(from, to);
    let flat = along.truncate();
    let crossing = -from.truncate().dot(flat) / flat.length_squared();
    let misses_axis = (from.truncate() + flat * crossing).length() > 1e-9 * flat.length();
    if crossing > 0.0 && crossing < 1.0 && !misses_axis {
        return lookup.refuse("a hyperboloid whose line crosses the axis between its ends is");
    }
    let heights = (0..=PIECES).map(|piece| from.z + along.z * f64::from(piece) / f64::from(PIECES));
    let least = heights.map(&squared).fold(f64::INFINITY, f64::min);
    if least < -1e-9 * (from.length_squared() + to.length_squared()) {
        return lookup.refuse("a hyperboloid with gaps between its ends is");
    }
    Some(revolve(tessellation, tessellation.rows(), sweep, |v| {
        let on_line = from + along * v;
        // On the axis, the direction of the line is the limit.
        let out = on_line
            .truncate()
            .try_normalize()
            .unwrap_or(flat.normalize_or_zero());
        let radius = squared(on_line.z).max(0.0).sqrt();
        // A ring without radius has the normal of its neighbours.
        let arm = if radius > 0.0 { out * radius } else { out };
        Ring {
            start: (out * radius).extend(on_line.z),
            normal: DVec3::new(-arm.y, arm.x, 0.0).cross(along),
            v,
        }
    }))
}

/// Squared radius by height, `a + b z²`, through the circles of the end of a line and of a point behind the end.
fn squared_radius(from: DVec3, to: DVec3) -> impl Fn(f64) -> f64 {
    let along = to - from;
    let mut beyond = to + along;
    if beyond.z * beyond.z == to.z * to.z {
        beyond += 2.0 * along;
    }
    let [end, far] = [to, beyond].map(|p| [p.truncate().length_squared(), p.z * p.z]);
    let growth = (far[0] - end[0]) / (far[1] - end[1]);
    move |z| end[0] + growth * (z * z - end[1])
}
