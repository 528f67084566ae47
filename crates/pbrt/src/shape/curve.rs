//! Curves: Bézier curves and B-splines with a width, as tubes and ribbons of triangles.
//!
//! A curve is divided so finely that no point is further from it than a twentieth of its width, the bound that
//! pbrt-v3 refines to. Tubes are regular octagons whose width, averaged over all directions, is that of the
//! curve. A flat curve turns towards every ray, which no mesh can: it becomes a tube, with the same outline but
//! round shading.

use antumbra_scene::TriangleMesh;
use glam::DVec3;

use super::grid;
use crate::lookup::Lookup;
use crate::params::{ParamType, Values};
use crate::report::Report;

/// Sides of a tube.
const SIDES: u32 = 8;
/// Pieces that a segment of a curve may be divided into.
const MOST_PIECES: f64 = 64.0;

/// Segments of one curve: each becomes up to 64 pieces of nine vertices.
const MOST_SEGMENTS: usize = 1 << 14;

/// What stands on the line of a curve.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Flat,
    Cylinder,
    Ribbon,
}

/// Angle by which a ribbon may turn in one piece.
const MOST_TWIST: f64 = std::f64::consts::PI / 32.0;

/// Control points of a cubic Bézier curve.
type Bezier = [DVec3; 4];

/// The mesh of a `curve`. `None`: something was reported.
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
    if segments.len() > MOST_SEGMENTS {
        let count = segments.len();
        let message = format!("a curve has {MOST_SEGMENTS} segments at most, found {count}");
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
    let line = Line::new(&segments, widths, normals.as_deref());
    Some(match kind {
        Kind::Ribbon => line.ribbon(),
        Kind::Flat | Kind::Cylinder => line.tube(),
    })
}

/// The control points as cubic Bézier curves, each of which begins where the one before it ends.
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
        let message = format!("{count} points \"P\" make no curve: it needs {needed}");
        report.error(lookup.at, message);
        return None;
    }
    let step = if is_spline { 1 } else { degree };
    let windows = points.windows(degree + 1).step_by(step);
    let segments = windows.map(|p| match (is_spline, degree) {
        (false, 3) => [p[0], p[1], p[2], p[3]],
        (false, _) => elevated([p[0], p[1], p[2]]),
        // Knots at the integers: the ends are blends of their neighbours (Boehm 1980).
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

/// A quadratic curve as a cubic one.
fn elevated([a, b, c]: [DVec3; 3]) -> Bezier {
    [a, a.lerp(b, 2.0 / 3.0), c.lerp(b, 2.0 / 3.0), c]
}

/// Points or normals; `None` if they are not there or wrong, which is reported.
fn triples(
    lookup: &mut Lookup,
    name: &'static str,
    types: &'static [ParamType],
    report: &mut Report,
) -> Option<Vec<DVec3>> {
    let param = lookup.find(name, types)?;
    let Values::Floats(values) = &param.values else {
        return None;
    };
    if !values.iter().all(|v| v.is_finite()) {
        report.error(param.list, format!("{name:?} must be finite"));
        return None;
    }
    let triple = |v: &[f32]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
    Some(values.chunks_exact(3).map(triple).collect())
}

/// A place on the line of a curve.
#[derive(Clone, Copy)]
struct Station {
    point: DVec3,
    /// Unit length.
    tangent: DVec3,
    width: f64,
    /// Unit length, normal to the tangent: where a tube begins, what a ribbon faces.
    normal: DVec3,
}

/// A curve as a polygon.
struct Line(Vec<Station>);

impl Line {
    /// `normals` are those of a ribbon, at the ends of the segments.
    fn new(segments: &[Bezier], widths: [f64; 2], normals: Option<&[DVec3]>) -> Self {
        let mut stations: Vec<Station> = Vec::new();
        let tolerance = widths[0].max(widths[1]) / 20.0;
        for (index, segment) in segments.iter().enumerate() {
            let mut pieces = pieces(segment, tolerance);
            if let Some(normals) = normals {
                let angle = normals[index].angle_between(normals[index + 1]);
                pieces = pieces.max((angle / MOST_TWIST).ceil() as u32);
            }
            for piece in u32::from(index > 0)..=pieces {
                let t = f64::from(piece) / f64::from(pieces);
                let along = (index as f64 + t) / segments.len() as f64;
                let tangent = tangent(segment, t);
                let toward = match (normals, stations.last()) {
                    (Some(normals), _) => between(normals[index], normals[index + 1], t),
                    // As little turned as possible from the one before.
                    (None, Some(last)) => last.normal,
                    (None, None) => tangent.any_orthonormal_vector(),
                };
                stations.push(Station {
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
        Self(stations)
    }

    /// The station at u in 0..=1, which is one of a grid's.
    fn at(&self, u: f64) -> Station {
        self.0[(u * self.pieces()).round() as usize]
    }

    fn pieces(&self) -> f64 {
        (self.0.len() - 1) as f64
    }

    fn tube(&self) -> TriangleMesh {
        let half_side = std::f64::consts::PI / f64::from(SIDES);
        // Perimeter over pi is the mean width of any convex outline (Cauchy).
        let scale = 0.5 * half_side / half_side.sin();
        grid::mesh([self.pieces() as u32, SIDES], |u, v| {
            let station = self.at(u);
            let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
            let out = station.normal * cos + station.normal.cross(station.tangent) * sin;
            (station.point + out * (scale * station.width), out)
        })
    }

    fn ribbon(&self) -> TriangleMesh {
        grid::mesh([self.pieces() as u32, 1], |u, v| {
            let station = self.at(u);
            let across = station.normal.cross(station.tangent);
            let offset = across * ((v - 0.5) * station.width);
            (station.point + offset, station.normal)
        })
    }
}

/// Pieces of equal parameter that stay within the tolerance: a chord of a curve is off by at most 1/8 of the
/// second derivative times the square of its length in the parameter.
fn pieces(c: &Bezier, tolerance: f64) -> u32 {
    let bend = (c[0] - 2.0 * c[1] + c[2]).length();
    let bend = bend.max((c[1] - 2.0 * c[2] + c[3]).length());
    (6.0 * bend / (8.0 * tolerance))
        .sqrt()
        .ceil()
        .clamp(1.0, MOST_PIECES) as u32
}

/// A point of the curve (de Casteljau).
fn point(c: &Bezier, t: f64) -> DVec3 {
    let [a, b, d] = [c[0].lerp(c[1], t), c[1].lerp(c[2], t), c[2].lerp(c[3], t)];
    a.lerp(b, t).lerp(b.lerp(d, t), t)
}

/// Unit tangent. Where the derivative is 0, as pbrt-v3 has it, the direction from the first to the last control point.
fn tangent(c: &Bezier, t: f64) -> DVec3 {
    let [a, b, d] = [c[1] - c[0], c[2] - c[1], c[3] - c[2]];
    let derivative = a.lerp(b, t).lerp(b.lerp(d, t), t);
    let unit = derivative.try_normalize();
    unit.or((c[3] - c[0]).try_normalize()).unwrap_or(DVec3::X)
}

/// Spherical interpolation of two normals, those of the file made unit length.
fn between(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    let [a, b] = [a, b].map(|n| n.normalize_or(DVec3::Z));
    let angle = a.dot(b).clamp(0.0, 1.0).acos();
    if angle < 1e-6 {
        return a.lerp(b, t);
    }
    (a * ((1.0 - t) * angle).sin() + b * (t * angle).sin()) / angle.sin()
}
