//! Rational B-spline surfaces (NURBS), diced to 30 x 30 vertices as in pbrt-v3.

use antumbra_scene::TriangleMesh;
use glam::{DVec3, DVec4, Vec2};

use crate::lookup::{FLOAT, INTEGER, Lookup};
use crate::params::ParamType;
use crate::shape::grid;

/// Vertices along a side.
const DICED: u32 = 30;
/// Largest order, which bounds the time of a vertex.
const MAX_ORDER: u32 = 64;
/// Most control points along a side.
const MAX_POINTS: u32 = 1 << 16;

/// B-spline basis along one side.
struct Basis {
    order: usize,
    knots: Vec<f64>,
    /// Part of the parameter that is diced.
    range: [f64; 2],
    points: usize,
}

/// Names of the parameters of a side: number of points, order, knots, and the ends of the part.
type Names = [&'static str; 5];
const U: Names = ["nu", "uorder", "uknots", "u0", "u1"];
const V: Names = ["nv", "vorder", "vknots", "v0", "v1"];

impl Basis {
    /// Reads the parameters of a side. `None`: a mistake was reported.
    fn read(lookup: &mut Lookup, [points, order, knots, start, end]: Names) -> Option<Self> {
        let errors_before = lookup.report.error_count();
        for name in [points, order] {
            lookup.needed(name, INTEGER);
        }
        let order_name = order;
        let count = lookup.integer_in(points, 2, [2, MAX_POINTS]) as usize;
        let order = lookup.integer_in(order, 2, [2, MAX_ORDER]) as usize;
        let param = lookup.needed(knots, FLOAT)?;
        let values = param.values.floats()?;
        lookup.report.clean_since(errors_before)?;
        if count < order {
            return lookup.fail(format!(
                "{points:?} is {count}, less than {order_name:?}, {order}"
            ));
        }
        if values.len() != count + order {
            let wanted = format!("{points:?} + {order_name:?} = {count} + {order}");
            let message = format!("{knots:?} has {} values, not {wanted}", values.len());
            return lookup.report.fail(param.list, message);
        }
        let descends = |pair: &[f32]| !(pair[0] <= pair[1] && (pair[1] - pair[0]).is_finite());
        if let Some(index) = values.windows(2).position(descends) {
            let span = param.value_span(index + 1, lookup.report);
            let message = format!("{knots:?} must not descend, found {}", values[index + 1]);
            return lookup.report.fail(span, message);
        }
        let limits = [values[order - 1], values[count]];
        let range = [
            lookup.float_in(start, limits[0], limits),
            lookup.float_in(end, limits[1], limits),
        ];
        lookup.report.clean_since(errors_before)?;
        if range[0] == range[1] {
            let message = format!("{} has no surface: {start:?} equals {end:?}", lookup.what());
            return lookup.fail(message);
        }
        Some(Self {
            order,
            knots: values.iter().copied().map(f64::from).collect(),
            range: range.map(f64::from),
            points: count,
        })
    }

    fn parameter(&self, share: f64) -> f64 {
        let [start, end] = self.range;
        start + share * (end - start)
    }

    /// First of the control points that count at a parameter, and the weights of all of them with their derivatives.
    fn weights(&self, t: f64) -> (usize, Vec<[f64; 2]>) {
        let knots = &self.knots;
        let is_span = |&s: &usize| t <= knots[s + 1] && knots[s] < knots[s + 1];
        let span = (self.order - 1..self.points).find(is_span);
        let span = span.unwrap_or(self.points - 1);
        // Cox and de Boor: each degree from the one below.
        let ratio = |a: f64, b: f64| if b == 0.0 { 0.0 } else { a / b };
        let mut values = vec![1.0];
        let mut below = Vec::new();
        for degree in 1..self.order {
            below = values;
            values = vec![0.0; degree + 1];
            for (index, value) in below.iter().enumerate() {
                let [low, high] = [knots[span + 1 + index - degree], knots[span + 1 + index]];
                let share = ratio(t - low, high - low);
                values[index] += (1.0 - share) * value;
                values[index + 1] += share * value;
            }
        }
        let degree = self.order - 1;
        let mut slopes = vec![0.0; self.order];
        for (index, value) in below.iter().enumerate() {
            let [low, high] = [knots[span + 1 + index - degree], knots[span + 1 + index]];
            let slope = ratio(degree as f64 * value, high - low);
            slopes[index] -= slope;
            slopes[index + 1] += slope;
        }
        let both = values.into_iter().zip(slopes).map(|(v, s)| [v, s]);
        (span - degree, both.collect())
    }
}

/// Reads the control points "P", or "Pw" with their weights. `None`: a mistake was reported.
fn control_points(lookup: &mut Lookup, wanted: usize) -> Option<Vec<DVec4>> {
    let plain = lookup.find("P", &[ParamType::Point3]);
    let weighted = lookup.find("Pw", FLOAT);
    let (param, size) = match (plain, weighted) {
        (Some(_), Some(_)) => {
            return lookup.fail("\"P\" and \"Pw\" are both given; remove one");
        }
        (None, None) => {
            if !lookup.has("Pw") {
                lookup.report_missing("P", "point");
            }
            return None;
        }
        (Some(param), None) => (param, 3),
        (None, Some(param)) => (param, 4),
    };
    let values = param.values.doubles()?;
    if !values.len().is_multiple_of(size) {
        let message = format!("{} values of \"Pw\" do not make points", values.len());
        let help = "a point has x, y, z and a weight";
        return lookup.report.fail_help(param.list, message, help);
    }
    let is_weight = |index: usize| size == 4 && index % 4 == 3;
    let is_wrong =
        |&index: &usize| !values[index].is_finite() || (is_weight(index) && values[index] < 0.0);
    if let Some(index) = (0..values.len()).find(is_wrong) {
        let (name, x) = (&param.name, values[index]);
        let message = match is_weight(index) && x.is_finite() {
            true => format!("a weight of {name:?} must not be negative, found {x}"),
            false => format!("{name:?} must be finite, found {x}"),
        };
        let span = param.value_span(index, lookup.report);
        return lookup.report.fail(span, message);
    }
    let found = values.len() / size;
    if found != wanted {
        let message = format!("found {found} control points, but nu x nv is {wanted}");
        return lookup.report.fail(param.list, message);
    }
    let point = |p: &[f64]| DVec3::from_slice(p).extend(p.get(3).copied().unwrap_or(1.0));
    Some(values.chunks_exact(size).map(point).collect())
}

/// Reads a `nurbs`. Texture coordinates are the parameters. `None`: a mistake was reported.
pub(super) fn nurbs(lookup: &mut Lookup) -> Option<TriangleMesh> {
    let bases = [U, V].map(|names| Basis::read(lookup, names));
    let [Some(along_u), Some(along_v)] = bases else {
        lookup.ignore_all();
        return None;
    };
    let wanted = along_u.points * along_v.points;
    let points = control_points(lookup, wanted)?;
    let cells = DICED - 1;
    let mut is_surface = true;
    let share = |index: u32| f64::from(index) / f64::from(cells);
    let mut vertices = Vec::new();
    for v in 0..DICED {
        let (first_v, weights_v) = along_v.weights(along_v.parameter(share(v)));
        for u in 0..DICED {
            let (first_u, weights_u) = along_u.weights(along_u.parameter(share(u)));
            let [mut at, mut by_u, mut by_v] = [DVec4::ZERO; 3];
            for (j, [value_v, slope_v]) in weights_v.iter().enumerate() {
                for (i, [value_u, slope_u]) in weights_u.iter().enumerate() {
                    let point = points[(first_v + j) * along_u.points + first_u + i];
                    at += point * (value_u * value_v);
                    by_u += point * (slope_u * value_v);
                    by_v += point * (value_u * slope_v);
                }
            }
            let position = at.truncate() / at.w;
            let slope = |by: DVec4| (by.truncate() - position * by.w) / at.w;
            is_surface &= position.is_finite();
            vertices.push((position, slope(by_u).cross(slope(by_v))));
        }
    }
    if !is_surface {
        return lookup.fail("the weights of \"Pw\" add up to 0 somewhere on the surface");
    }
    let index = |share: f64| (share * f64::from(cells)).round() as usize;
    let mut mesh = grid::mesh([cells; 2], |u, v| {
        vertices[index(v) * DICED as usize + index(u)]
    });
    for uv in &mut mesh.uvs {
        let [u, v] = [
            along_u.parameter(uv.x.into()),
            along_v.parameter(uv.y.into()),
        ];
        *uv = Vec2::new(u as f32, v as f32);
    }
    Some(mesh)
}
