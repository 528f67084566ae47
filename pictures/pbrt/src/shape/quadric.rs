//! Disks, cylinders and parts of spheres, tessellated to meshes with smooth normals.
//!
//! A whole turn has 256 segments, for a deviation of at most 1e-4 of the radius. Emitters have 64 segments (1.3e-3),
//! because every triangle is a light. Vertices are scaled so that the mesh has the area of the exact surface, and thus
//! its emitted power.

use antumbra_scene::TriangleMesh;
use glam::DVec3;

use super::grid;
use crate::lookup::{Lookup, NOT_NEGATIVE, POSITIVE};

/// Number of segments of a whole turn.
const SEGMENTS: u32 = 256;
/// Number of segments of a whole turn for an emitter.
const SEGMENTS_OF_EMITTERS: u32 = 64;

/// Tessellation of a surface, as the number of segments of a whole turn.
#[derive(Clone, Copy)]
pub(super) struct Tessellation(u32);

impl Tessellation {
    /// Tessellation for an emitter or another surface.
    pub fn of(is_emitter: bool) -> Self {
        Self(if is_emitter {
            SEGMENTS_OF_EMITTERS
        } else {
            SEGMENTS
        })
    }

    /// Number of rows along a meridian that is bent by less than a quarter of a turn.
    pub fn rows(self) -> u32 {
        self.0 / 4
    }

    /// Number of segments of an angle.
    pub fn segments(self, radians: f64) -> u32 {
        let turns = radians / std::f64::consts::TAU;
        ((f64::from(self.0) * turns).ceil() as u32).max(1)
    }
}

pub(super) fn radius(lookup: &mut Lookup) -> f64 {
    lookup.float_in("radius", 1.0, POSITIVE).into()
}

/// Reads the sweep around the z axis in radians. `None`: the angle is 0, which was reported.
pub(super) fn sweep(lookup: &mut Lookup) -> Option<f64> {
    let degrees = lookup.float("phimax", 360.0).clamp(0.0, 360.0);
    if degrees == 0.0 {
        return empty(lookup);
    }
    Some(f64::from(degrees).to_radians())
}

/// Heights of both ends, the lower one first. The default of the upper one is 1.
pub(super) fn heights(lookup: &mut Lookup, low: f32) -> [f64; 2] {
    let ends = [lookup.float("zmin", low), lookup.float("zmax", 1.0)];
    [ends[0].min(ends[1]), ends[0].max(ends[1])].map(f64::from)
}

/// Reports that a shape has no surface.
pub(super) fn empty<T>(lookup: &mut Lookup) -> Option<T> {
    lookup.fail(format!("{} has no surface", lookup.what()))
}

/// Point of the unit circle around the z axis.
fn around(angle: f64) -> DVec3 {
    let (sin, cos) = angle.sin_cos();
    DVec3::new(cos, sin, 0.0)
}

/// Reads a `disk`, perpendicular to z. `None`: a mistake was reported.
pub(super) fn disk(lookup: &mut Lookup, tessellation: Tessellation) -> Option<TriangleMesh> {
    let height: f64 = lookup.float("height", 0.0).into();
    let outer = radius(lookup);
    let inner: f64 = lookup.float_in("innerradius", 0.0, NOT_NEGATIVE).into();
    let sweep = sweep(lookup)?;
    if inner >= outer {
        return empty(lookup);
    }
    let size = [tessellation.segments(sweep), 1];
    let make = |scale: f64| {
        grid::mesh(size, |u, v| {
            let out = around(u * sweep);
            let radius = scale * (outer + v * (inner - outer));
            (out * radius + DVec3::Z * height, DVec3::Z)
        })
    };
    let area = 0.5 * sweep * (outer * outer - inner * inner);
    Some(make((area / grid::area(&make(1.0))).sqrt()))
}

/// Reads a `cylinder` around z, without caps. `None`: a mistake was reported.
pub(super) fn cylinder(lookup: &mut Lookup, tessellation: Tessellation) -> Option<TriangleMesh> {
    let radius = radius(lookup);
    let [low, high] = heights(lookup, -1.0);
    let sweep = sweep(lookup)?;
    if low == high {
        return empty(lookup);
    }
    let size = [tessellation.segments(sweep), 1];
    let make = |scale: f64| {
        grid::mesh(size, |u, v| {
            let out = around(u * sweep);
            (
                out * (scale * radius) + DVec3::Z * (low + v * (high - low)),
                out,
            )
        })
    };
    let area = sweep * radius * (high - low);
    Some(make(area / grid::area(&make(1.0))))
}

/// Sphere or a part of one, from the parameters of a `sphere`.
#[derive(Clone, Copy)]
pub(super) struct SpherePart {
    pub radius: f64,
    low: f64,
    high: f64,
    /// Sweep around the z axis in radians.
    sweep: f64,
}

impl SpherePart {
    /// Reads the parameters of a `sphere`. `None`: a mistake was reported.
    pub fn read(lookup: &mut Lookup) -> Option<Self> {
        let radius = radius(lookup);
        let ends = [
            lookup.float("zmin", -radius as f32),
            lookup.float("zmax", radius as f32),
        ];
        let part = Self {
            radius,
            low: f64::from(ends[0].min(ends[1])).clamp(-radius, radius),
            high: f64::from(ends[0].max(ends[1])).clamp(-radius, radius),
            sweep: sweep(lookup)?,
        };
        if part.low == part.high {
            return empty(lookup);
        }
        Some(part)
    }

    /// Returns true if the part is the whole sphere.
    pub fn is_whole(&self) -> bool {
        self.low == -self.radius
            && self.high == self.radius
            && self.sweep > std::f64::consts::TAU - 1e-9
    }

    /// Tessellates the part.
    pub fn mesh(&self, tessellation: Tessellation) -> TriangleMesh {
        let Self {
            radius,
            low,
            high,
            sweep,
        } = *self;
        // Angles from the z axis. The lower end has the larger angle.
        let [start, end] = [low, high].map(|z| (z / radius).acos());
        let size = [
            tessellation.segments(sweep),
            tessellation.segments(start - end),
        ];
        let make = |scale: f64| {
            grid::mesh(size, |u, v| {
                let (sin, cos) = (start + v * (end - start)).sin_cos();
                // Poles are exactly on the axis, so that `grid` finds and drops their degenerate triangles.
                let sin = if sin < 1e-12 { 0.0 } else { sin };
                let out = around(u * sweep);
                let normal = out * sin + DVec3::Z * cos;
                (normal * (scale * radius), normal)
            })
        };
        let area = sweep * radius * (high - low);
        make((area / grid::area(&make(1.0))).sqrt())
    }
}
