//! Disks, cylinders and parts of spheres, as meshes with smooth normals.
//!
//! A whole turn has 256 segments: no point is further from the surface than 1e-4 of the radius. Those that
//! emit have 64, since every triangle is a light of its own: 1.3e-3. The radius is that at which the area, and
//! so the emitted power, is that of the surface itself.

use antumbra_scene::TriangleMesh;
use glam::DVec3;

use super::grid;
use crate::lookup::Lookup;
use crate::report::Report;

/// Segments of a whole turn.
const SEGMENTS: u32 = 256;
/// The same for a surface that emits.
const SEGMENTS_OF_EMITTERS: u32 = 64;

/// How finely a surface is divided.
#[derive(Clone, Copy)]
pub(super) struct Fineness(u32);

impl Fineness {
    /// What suits a surface that emits, or does not.
    pub fn of(is_emitter: bool) -> Self {
        Self(if is_emitter {
            SEGMENTS_OF_EMITTERS
        } else {
            SEGMENTS
        })
    }

    /// Segments of an angle.
    fn segments(self, radians: f64) -> u32 {
        let turns = radians / std::f64::consts::TAU;
        ((f64::from(self.0) * turns).ceil() as u32).max(1)
    }
}

const POSITIVE: [f32; 2] = [f32::MIN_POSITIVE, f32::MAX];

fn radius(lookup: &mut Lookup, report: &mut Report) -> f64 {
    lookup.float_in("radius", 1.0, POSITIVE, report).into()
}

/// The angle that is swept around the z axis, in radians. `None`: it is empty, which is reported.
fn sweep(lookup: &mut Lookup, report: &mut Report) -> Option<f64> {
    let degrees = lookup.float("phimax", 360.0, report).clamp(0.0, 360.0);
    if degrees == 0.0 {
        report_empty(lookup, report);
        return None;
    }
    Some(f64::from(degrees).to_radians())
}

fn report_empty(lookup: &Lookup, report: &mut Report) {
    let message = format!("{} has no surface", lookup.what());
    report.error(lookup.at, message);
}

/// Point of the unit circle around z.
fn around(angle: f64) -> DVec3 {
    let (sin, cos) = angle.sin_cos();
    DVec3::new(cos, sin, 0.0)
}

/// A `disk`, normal to z. `None`: something was reported.
pub(super) fn disk(
    lookup: &mut Lookup,
    fineness: Fineness,
    report: &mut Report,
) -> Option<TriangleMesh> {
    let height: f64 = lookup.float("height", 0.0, report).into();
    let outer = radius(lookup, report);
    let inner: f64 = lookup
        .float_in("innerradius", 0.0, [0.0, f32::MAX], report)
        .into();
    let sweep = sweep(lookup, report)?;
    if inner >= outer {
        report_empty(lookup, report);
        return None;
    }
    let size = [fineness.segments(sweep), 1];
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

/// A `cylinder` around z, without caps. `None`: something was reported.
pub(super) fn cylinder(
    lookup: &mut Lookup,
    fineness: Fineness,
    report: &mut Report,
) -> Option<TriangleMesh> {
    let radius = radius(lookup, report);
    let ends = [
        lookup.float("zmin", -1.0, report),
        lookup.float("zmax", 1.0, report),
    ];
    let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])].map(f64::from);
    let sweep = sweep(lookup, report)?;
    if low == high {
        report_empty(lookup, report);
        return None;
    }
    let size = [fineness.segments(sweep), 1];
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

/// What there is of a `sphere`, all of it or a part.
#[derive(Clone, Copy)]
pub(super) struct SpherePart {
    pub radius: f64,
    low: f64,
    high: f64,
    /// In radians.
    sweep: f64,
}

impl SpherePart {
    /// The parameters of a `sphere`. `None`: something was reported.
    pub fn read(lookup: &mut Lookup, report: &mut Report) -> Option<Self> {
        let radius = radius(lookup, report);
        let ends = [
            lookup.float("zmin", -radius as f32, report),
            lookup.float("zmax", radius as f32, report),
        ];
        let part = Self {
            radius,
            low: f64::from(ends[0].min(ends[1])).clamp(-radius, radius),
            high: f64::from(ends[0].max(ends[1])).clamp(-radius, radius),
            sweep: sweep(lookup, report)?,
        };
        if part.low == part.high {
            report_empty(lookup, report);
            return None;
        }
        Some(part)
    }

    /// Whether nothing is missing.
    pub fn is_whole(&self) -> bool {
        self.low == -self.radius
            && self.high == self.radius
            && self.sweep > std::f64::consts::TAU - 1e-9
    }

    /// The part as a mesh.
    pub fn mesh(&self, fineness: Fineness) -> TriangleMesh {
        let Self {
            radius,
            low,
            high,
            sweep,
        } = *self;
        // Angles from the z axis; that of the lower end is the larger one.
        let [start, end] = [low, high].map(|z| (z / radius).acos());
        let size = [fineness.segments(sweep), fineness.segments(start - end)];
        let make = |scale: f64| {
            grid::mesh(size, |u, v| {
                let (sin, cos) = (start + v * (end - start)).sin_cos();
                // Exactly on the axis at the poles, so that their triangles are seen to be flat.
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
