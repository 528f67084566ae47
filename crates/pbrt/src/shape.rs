//! Shapes: geometry brought to world space, or to that of its object.

use std::sync::Arc;

use antumbra_scene::{Geometry, Sphere, TriangleMesh};
use glam::{DMat4, DVec3, Vec2, Vec3};

use crate::directive::Quoted;
use crate::lookup::{Lookup, one_float};
use crate::params::{Param, ParamType, Values};
use crate::ply::load_ply;
use crate::report::Report;
use crate::{Error, suggest, transform};

const SUPPORTED: &[&str] = &["plymesh", "sphere", "trianglemesh"];
const UNSUPPORTED: &[&str] = &[
    "cone",
    "curve",
    "cylinder",
    "disk",
    "heightfield",
    "hyperboloid",
    "loopsubdiv",
    "nurbs",
    "paraboloid",
];

/// What [`Report::unsupported`] is told of a sphere that a transformation makes none.
pub(crate) const ELLIPSOID: &str = "a sphere under a scale that differs by axis (an ellipsoid) is";

/// The geometry of a shape in world space, or in that of its object. `None`: something was reported.
pub(crate) fn geometry(
    kind: &Quoted,
    lookup: &mut Lookup,
    to_world: &DMat4,
    report: &mut Report,
) -> Option<Geometry> {
    match kind.text.as_str() {
        "trianglemesh" => {
            let mut mesh = triangle_mesh(lookup, report)?;
            mesh.transform(to_world);
            Some(Geometry::Mesh(Arc::new(mesh)))
        }
        "plymesh" => {
            let mut mesh = ply_mesh(lookup, report)?;
            mesh.transform(to_world);
            Some(Geometry::Mesh(Arc::new(mesh)))
        }
        "sphere" => sphere(lookup, to_world, report).map(Geometry::Sphere),
        name => {
            if UNSUPPORTED.contains(&name) {
                report.unsupported(kind.span, format!("shape {name:?} is"));
            } else {
                report.error_help(
                    kind.span,
                    format!("unknown shape {name:?}"),
                    suggest::help(name, SUPPORTED),
                );
            }
            lookup.ignore_all();
            None
        }
    }
}

/// Parameters that both kinds of mesh have and that must keep their default.
fn mesh_options(lookup: &mut Lookup, names: &[&'static str], report: &mut Report) {
    for name in names {
        let Some(param) = lookup.find(name, &[ParamType::Texture, ParamType::Float]) else {
            continue;
        };
        let is_opaque =
            param.param_type == ParamType::Float && one_float(param, report) == Some(1.0);
        if !is_opaque && param.values != Values::Broken {
            let message = format!("cut-out shapes are not supported yet (parameter {name:?})");
            report.error_once(param.declaration, message, None);
        }
    }
    if lookup.bool("discarddegenerateUVs", false, report) {
        report.unsupported(lookup.at, "\"discarddegenerateUVs\" is");
    }
}

fn ply_mesh(lookup: &mut Lookup, report: &mut Report) -> Option<TriangleMesh> {
    mesh_options(lookup, &["alpha", "shadowalpha"], report);
    let Some((name, span)) = lookup.string("filename", report) else {
        report_missing(lookup, "filename", "string", report);
        return None;
    };
    let path = report.sources.folder.join(name);
    let (problem, help) = match load_ply(&path) {
        Ok(mesh) => return Some(mesh),
        Err(Error::Ply(error)) => (error.located(), error.help),
        Err(Error::Io { source, .. }) => {
            let help = "paths start at the folder of the main scene file";
            (source.to_string(), Some(help.to_owned()))
        }
        Err(error) => (error.to_string(), None),
    };
    let message = format!("cannot read mesh {name:?}: {problem}");
    match help {
        Some(help) => report.error_help(span, message, help),
        None => report.error(span, message),
    }
    None
}

fn report_missing(lookup: &Lookup, name: &str, param_type: &str, report: &mut Report) {
    // Of a wrong type or broken: that is reported elsewhere.
    if !lookup.has(name) {
        report.error_help(
            lookup.at,
            format!("{} needs a parameter {name:?}", lookup.what()),
            format!("add \"{param_type} {name}\""),
        );
    }
}

fn triangle_mesh(lookup: &mut Lookup, report: &mut Report) -> Option<TriangleMesh> {
    const UV: &[ParamType] = &[ParamType::Point2, ParamType::Float];
    mesh_options(lookup, &["alpha", "shadowalpha"], report);
    let errors_before = report.error_count();
    let indices = lookup.find("indices", &[ParamType::Integer]);
    let points = lookup.find("P", &[ParamType::Point3]);
    let normals = lookup.find("N", &[ParamType::Normal]);
    let tangents = lookup.find("S", &[ParamType::Vector3]);
    let uvs = lookup.find("uv", UV).or_else(|| lookup.find("st", UV));
    if indices.is_none() {
        report_missing(lookup, "indices", "integer", report);
    }
    if points.is_none() {
        report_missing(lookup, "P", "point", report);
    }
    let (Some(indices), Some(points)) = (indices, points) else {
        return None;
    };
    let (Values::Integers(index_values), Values::Floats(point_values)) =
        (&indices.values, &points.values)
    else {
        return None;
    };
    let count = point_values.len() / 3;
    check_indices(indices, index_values, count, report);
    for (param, components) in [(normals, 3), (tangents, 3), (uvs, 2)] {
        if let Some(param) = param {
            check_count(param, components, count, report);
        }
    }
    if let Some(param) = tangents {
        report.note(
            param.declaration,
            "\"S\" is left out: tangents come from texture coordinates",
        );
    }
    if report.error_count() > errors_before {
        return None;
    }
    let floats = |param: Option<&Param>, components: usize| match param.map(|p| &p.values) {
        Some(Values::Floats(v)) => v[..count * components].to_vec(),
        _ => Vec::new(),
    };
    Some(TriangleMesh {
        positions: triples(point_values).collect(),
        indices: index_values
            .chunks_exact(3)
            .map(|t| [t[0] as u32, t[1] as u32, t[2] as u32])
            .collect(),
        normals: triples(&floats(normals, 3))
            .map(|n| transform::unit(DVec3::from(n.map(f64::from))))
            .collect(),
        uvs: floats(uvs, 2)
            .chunks_exact(2)
            .map(|t| Vec2::new(t[0], t[1]))
            .collect(),
    })
}

fn triples(values: &[f32]) -> impl Iterator<Item = [f32; 3]> + '_ {
    values.chunks_exact(3).map(|t| [t[0], t[1], t[2]])
}

/// Reports the first index that is not a vertex, and how many there are.
fn check_indices(param: &Param, indices: &[i32], count: usize, report: &mut Report) {
    if indices.is_empty() || !indices.len().is_multiple_of(3) {
        report.error(
            param.list,
            format!("{} indices do not make triangles", indices.len()),
        );
    }
    let is_wrong = |index: &i32| usize::try_from(*index).map_or(true, |i| i >= count);
    let Some(first) = indices.iter().position(is_wrong) else {
        return;
    };
    let more = indices[first + 1..].iter().filter(|i| is_wrong(i)).count();
    let and_more = match more {
        0 => String::new(),
        more => format!(" (and {more} more like it)"),
    };
    let span = param.value_span(first, report);
    report.error_help(
        span,
        format!(
            "vertex index {} is out of range: \"P\" has {count} points{and_more}",
            indices[first]
        ),
        match count {
            0 => "there are no points".to_owned(),
            count => format!("indices are 0 to {}", count - 1),
        },
    );
}

/// There is one value per vertex; texture coordinates may be more, as in pbrt.
fn check_count(param: &Param, components: usize, vertices: usize, report: &mut Report) {
    if param.values == Values::Broken {
        return;
    }
    let found = param.values.len() / components;
    if components == 2 && found > vertices {
        report.note(
            param.declaration,
            format!(
                "{:?} has {found} values for {vertices} points, the rest is left out",
                param.name
            ),
        );
    } else if found != vertices {
        report.error(
            param.list,
            format!(
                "{:?} has {found} values, but \"P\" has {vertices} points",
                param.name
            ),
        );
    }
}

fn sphere(lookup: &mut Lookup, to_world: &DMat4, report: &mut Report) -> Option<Sphere> {
    let positive = [f32::MIN_POSITIVE, f32::MAX];
    let radius = lookup.float_in("radius", 1.0, positive, report);
    let z_min = lookup.float("zmin", -radius, report);
    let z_max = lookup.float("zmax", radius, report);
    let phi_max = lookup.float("phimax", 360.0, report);
    if z_min.min(z_max) > -radius || z_min.max(z_max) < radius || phi_max < 360.0 {
        report.unsupported(lookup.at, "a part of a sphere is");
        return None;
    }
    let sphere = Sphere {
        center: Vec3::ZERO,
        radius,
    };
    let Some(sphere) = sphere.transformed(to_world) else {
        report.unsupported(lookup.at, ELLIPSOID);
        return None;
    };
    if !(sphere.center.is_finite() && sphere.radius.is_finite() && sphere.radius > 0.0) {
        report.error(
            lookup.at,
            "this sphere is beyond the range of 32-bit floats",
        );
        return None;
    }
    Some(sphere)
}
