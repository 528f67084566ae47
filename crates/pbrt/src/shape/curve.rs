//! Curves: Bézier curves and B-splines with a width, tessellated to tubes and ribbons.
//!
//! The deviation from the curve is at most a twentieth of its width, the bound to which pbrt-v3 refines. Tubes are
//! regular octagons whose mean width over all directions is the width of the curve. A flat curve of pbrt-v3 faces
//! every ray, which no mesh can. Flat curves therefore become tubes, with an equal outline but rounder shading.

use antumbra_scene::TriangleMesh;
use glam::DVec3;

use super::grid;
use crate::lookup::Lookup;
use crate::params::{ParamType, Values};
use crate::report::Report;

/// Number of sides of a tube.
const SIDES: u32 = 8;
/// Largest number of pieces of a segment.
const MAX_PIECES: f64 = 64.0;

/// Largest number of segments of a curve. Each becomes up to 64 pieces of nine vertices.
const MAX_SEGMENTS: usize = 1 << 14;

/// Cross-section of a curve.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Flat,
    Cylinder,
    Ribbon,
}

/// Largest angle by which a ribbon turns in one piece.
const MAX_TWIST: f64 = std::f64::consts::PI / 32.0;

/// Control points of a cubic Bézier curve.
type Bezier = [DVec3; 4];

/// Reads the mesh of a `curve`. `None`: a mistake was reported.
pub(super) fn curve(lookup: &mut Lookup, report: &mut Report) -> Option<TriangleMesh> {
    let kinds = [
        ("flat", Kind::Flat),
        ("cylinder", Kind::Cylinder),
        ("ribbon", Kind::Ribbon),
    ];
    let kind = lookup.choice("type", kinds, report);
    let range = [0.0, f32::MAX];
    let width = lookup.float_in("width", 1.0, range, report);
    let widths = [
        lookup.float_in("width0", width, range, report),
        lookup.float_in("width1", width, range, report),
    ]
    .map(f64::from);
    let why = "curves are divided as finely as they are curved";
    let types = &[ParamType::Integer, ParamType::Float];
    lookup.left_out("splitdepth", types, why, report);
    let errors_before = report.error_count();
    let segments = segments(lookup, report)?;
    if segments.len() > MAX_SEGMENTS {
        let count = segments.len();
        let message = format!("a curve has {MAX_SEGMENTS} segments at most, found {count}");
        report.error(lookup.at, message);
        return None;
    }
    let normals = triples(lookup, "N", &[ParamType::Normal], report);
    if report.error_count() > errors_before {
        return None;
    }
    if kind == Kind::Flat {
        let message = "flat curves are taken as cylinders: same outline, rounder shading";
        report.note(lookup.at, message);
    }
    if widths == [0.0; 2] {
        report.error(lookup.at, format!("{} has no width", lookup.what()));
        return None;
    }
    let normals = match (kind, normals) {
        (Kind::Ribbon, Some(normals)) if normals.len() == segments.len() + 1 => Some(normals),
        (Kind::Ribbon, found) => {
            let (found, needed) = (found.map_or(0, |n| n.len()), segments.len() + 1);
            let message = format!("a ribbon needs {needed} normals \"N\", found {found}");
            report.error(lookup.at, message);
            return None;
        }
        _ => None,
    };
    let polyline = Polyline::new(&segments, widths, normals.as_deref());
    Some(match kind {
        Kind::Ribbon => polyline.ribbon(),
        Kind::Flat | Kind::Cylinder => polyline.tube(),
    })
}

/// Reads the control points as cubic Bézier curves, each of which begins where the previous one ends.
fn segments(lookup: &mut Lookup, report: &mut Report) -> Option<Vec<Bezier>> {
    let degree = lookup.integer_from("degree", 3, 2, report) as usize;
    let is_spline = lookup.choice("basis", [("bezier", false), ("bspline", true)], report);
    if degree > 3 {
        let message = format!("curves have degree 2 or 3, found {degree}");
        report.error(lookup.at, message);
        return None;
    }
    let Some(points) = triples(lookup, "P", &[ParamType::Point3], report) else {
        if !lookup.has("P") {
            let message = format!("{} needs a parameter \"P\"", lookup.what());
            report.error_help(lookup.at, message, "add \"point P\"");
        }
        return None;
    };
    let count = points.len();
    let is_right = count > degree && (is_spline || (count - 1).is_multiple_of(degree));
    if !is_right {
        let needed = match is_spline {
            true => format!("at least {}", degree + 1),
            false => format!("{} and any number of times {degree} more", degree + 1),
        };
        let message = format!("{count} points \"P\" make no curve; a curve needs {needed}");
        report.error(lookup.at, message);
        return None;
    }
    let step = if is_spline { 1 } else { degree };
    let windows = points.windows(degree + 1).step_by(step);
    let segments = windows.map(|p| match (is_spline, degree) {
        (false, 3) => [p[0], p[1], p[2], p[3]],
        (false, _) => elevated([p[0], p[1], p[2]]),
        // With knots at the integers, the ends are blends of their neighbours (Boehm 1980).
        (true, 3) => {
            let [a, b] = [p[1].lerp(p[2], 1.0 / 3.0), p[1].lerp(p[2], 2.0 / 3.0)];
            let start = p[0].lerp(p[1], 2.0 / 3.0).midpoint(a);
            let end = b.midpoint(p[2].lerp(p[3], 1.0 / 3.0));
            [start, a, b, end]
        }
        (true, _) => elevated([p[0].midpoint(p[1]), p[1], p[1].midpoint(p[2])]),
    });
    Some(segments.collect())
}

/// Raises a quadratic Bézier curve to a cubic one.
fn elevated([a, b, c]: [DVec3; 3]) -> Bezier {
    [a, a.lerp(b, 2.0 / 3.0), c.lerp(b, 2.0 / 3.0), c]
}

/// Reads points or normals. `None`: they are not given, or a mistake was reported.
fn triples(
    lookup: &mut Lookup,
    name: &'static str,
    types: &'static [ParamType],
    report: &mut Report,
) -> Option<Vec<DVec3>> {
    let param = lookup.find(name, types)?;
    let values = match &param.values {
        Values::Points(values) => values.clone(),
        Values::Floats(values) => values.iter().copied().map(f64::from).collect(),
        _ => return None,
    };
    if !values.iter().all(|v| v.is_finite()) {
        report.error(param.list, format!("{name:?} must be finite"));
        return None;
    }
    Some(values.chunks_exact(3).map(DVec3::from_slice).collect())
}

/// Frame at a point of a curve.
#[derive(Clone, Copy)]
struct Frame {
    point: DVec3,
    /// Unit tangent.
    tangent: DVec3,
    width: f64,
    /// Unit normal, perpendicular to the tangent. Tubes begin there, and ribbons face it.
    normal: DVec3,
}

/// Curve as a polyline of frames.
struct Polyline(Vec<Frame>);

impl Polyline {
    /// Divides the segments of a curve. `normals` are the normals of a ribbon at the ends of the segments.
    fn new(segments: &[Bezier], widths: [f64; 2], normals: Option<&[DVec3]>) -> Self {
        let mut frames: Vec<Frame> = Vec::new();
        let tolerance = widths[0].max(widths[1]) / 20.0;
        for (index, segment) in segments.iter().enumerate() {
            let mut pieces = pieces(segment, tolerance);
            if let Some(normals) = normals {
                let angle = normals[index].angle_between(normals[index + 1]);
                pieces = pieces.max((angle / MAX_TWIST).ceil() as u32);
            }
            for piece in u32::from(index > 0)..=pieces {
                let t = f64::from(piece) / f64::from(pieces);
                let along = (index as f64 + t) / segments.len() as f64;
                let tangent = tangent(segment, t);
                let toward = match (normals, frames.last()) {
                    (Some(normals), _) => slerp(normals[index], normals[index + 1], t),
                    // The normal turns as little as possible from the previous one.
                    (None, Some(last)) => last.normal,
                    (None, None) => tangent.any_orthonormal_vector(),
                };
                frames.push(Frame {
                    point: point(segment, t),
                    tangent,
                    width: widths[0] + along * (widths[1] - widths[0]),
                    normal: toward
                        .reject_from_normalized(tangent)
                        .try_normalize()
                        .unwrap_or_else(|| tangent.any_orthonormal_vector()),
                });
            }
        }
        Self(frames)
    }

    /// Frame at u in 0..=1, where u is a multiple of 1 over the number of pieces.
    fn at(&self, u: f64) -> Frame {
        self.0[(u * self.pieces()).round() as usize]
    }

    fn pieces(&self) -> f64 {
        (self.0.len() - 1) as f64
    }

    fn tube(&self) -> TriangleMesh {
        let half_side = std::f64::consts::PI / f64::from(SIDES);
        // The mean width of a convex outline is its perimeter over π (Cauchy).
        let scale = 0.5 * half_side / half_side.sin();
        grid::mesh([self.pieces() as u32, SIDES], |u, v| {
            let frame = self.at(u);
            let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
            let out = frame.normal * cos + frame.normal.cross(frame.tangent) * sin;
            (frame.point + out * (scale * frame.width), out)
        })
    }

    fn ribbon(&self) -> TriangleMesh {
        grid::mesh([self.pieces() as u32, 1], |u, v| {
            let frame = self.at(u);
            let across = frame.normal.cross(frame.tangent);
            let offset = across * ((v - 0.5) * frame.width);
            (frame.point + offset, frame.normal)
        })
    }
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
