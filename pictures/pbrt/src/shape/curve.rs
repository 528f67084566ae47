//! Curves: Bézier curves and B-splines with a width.
//!
//! Flat and cylindrical curves face every ray, and stay curves. Ribbons become meshes.

use std::sync::Arc;

use antumbra_scene::{CurveProfile, Curves, Geometry};
use glam::{DMat4, DVec3};

use super::ribbon;
use crate::lookup::{Lookup, NOT_NEGATIVE};
use crate::params::ParamType;

/// Largest number of segments of a curve. Each becomes up to 256 pieces.
const MAX_SEGMENTS: usize = 1 << 14;

/// Control points of a cubic Bézier curve.
pub(super) type Bezier = [DVec3; 4];

/// Reads a `curve`, whose points are measured from `middle` before they are rounded, and moves it from there. `None`: a mistake
/// was reported.
pub(super) fn curve(lookup: &mut Lookup, middle: DVec3, from_middle: &DMat4) -> Option<Geometry> {
    let kinds = [
        ("flat", Some(CurveProfile::Flat)),
        ("cylinder", Some(CurveProfile::Round)),
        ("ribbon", None),
    ];
    let profile = lookup.choice("type", kinds);
    let width = lookup.float_in("width", 1.0, NOT_NEGATIVE);
    let widths = [
        lookup.float_in("width0", width, NOT_NEGATIVE),
        lookup.float_in("width1", width, NOT_NEGATIVE),
    ]
    .map(f64::from);
    let why = "curves are divided as finely as they are curved";
    let types = &[ParamType::Integer, ParamType::Float];
    lookup.left_out("splitdepth", types, why);
    let errors_before = lookup.report.error_count();
    let mut segments = segments(lookup)?;
    if segments.len() > MAX_SEGMENTS {
        let count = segments.len();
        return lookup.fail(format!(
            "a curve has {MAX_SEGMENTS} segments at most, found {count}"
        ));
    }
    let normals = triples(lookup, "N", &[ParamType::Normal]);
    lookup.report.clean_since(errors_before)?;
    if widths == [0.0; 2] {
        return lookup.fail(format!("{} has no width", lookup.what()));
    }
    if (normals.iter().flatten()).any(|normal| *normal == DVec3::ZERO) {
        return lookup.fail("a normal \"N\" is zero, so it has no direction");
    }
    for point in segments.iter_mut().flatten() {
        *point -= middle;
    }
    match (profile, normals) {
        (Some(profile), _) => {
            let mut curves = curves(&segments, widths, profile);
            curves.transform(from_middle);
            Some(Geometry::Curves(Arc::new(curves)))
        }
        (None, Some(normals)) if normals.len() == segments.len() + 1 => {
            let mut mesh = ribbon::mesh(&segments, widths, &normals);
            mesh.transform(from_middle);
            Some(Geometry::Mesh(Arc::new(mesh)))
        }
        (None, found) => {
            let (found, needed) = (found.map_or(0, |n| n.len()), segments.len() + 1);
            lookup.fail(format!(
                "a ribbon needs {needed} normals \"N\", found {found}"
            ))
        }
    }
}

/// Curves that each begin where the previous one ends. Their radius changes linearly over all of them.
fn curves(segments: &[Bezier], widths: [f64; 2], profile: CurveProfile) -> Curves {
    let last = 3 * segments.len();
    let point = |index: usize, point: DVec3| {
        let share = index as f64 / last as f64;
        let radius = 0.5 * (widths[0] + share * (widths[1] - widths[0]));
        let [x, y, z] = point.as_vec3().to_array();
        [x, y, z, radius as f32]
    };
    let mut points = vec![point(0, segments[0][0])];
    for control in segments.iter().flat_map(|segment| &segment[1..]) {
        points.push(point(points.len(), *control));
    }
    Curves {
        points,
        first: (0..last as u32).step_by(3).collect(),
        profile,
    }
}

/// Reads the control points as cubic Bézier curves, each of which begins where the previous one ends.
fn segments(lookup: &mut Lookup) -> Option<Vec<Bezier>> {
    let degree = lookup.integer_from("degree", 3, 2) as usize;
    let is_spline = lookup.choice("basis", [("bezier", false), ("bspline", true)]);
    if degree > 3 {
        return lookup.fail(format!("curves have degree 2 or 3, found {degree}"));
    }
    let Some(points) = triples(lookup, "P", &[ParamType::Point3]) else {
        if !lookup.has("P") {
            let message = format!("{} needs a parameter \"P\"", lookup.what());
            lookup.error_help(message, "add \"point P\"");
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
        return lookup.fail(format!(
            "{count} points \"P\" make no curve; a curve needs {needed}"
        ));
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
) -> Option<Vec<DVec3>> {
    let param = lookup.find(name, types)?;
    let values = param.values.doubles()?;
    if !values.iter().all(|v| v.is_finite()) {
        return (lookup.report).fail(param.list, format!("{name:?} must be finite"));
    }
    Some(values.chunks_exact(3).map(DVec3::from_slice).collect())
}
