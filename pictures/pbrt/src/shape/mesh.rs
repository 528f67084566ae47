//! Triangle meshes, given in the scene or in a separate file.

use std::sync::Arc;

use antumbra_scene::{Param as TexturedParam, Texture, TriangleMesh};
use glam::{DMat4, DVec3, Vec2};

use crate::lookup::Lookup;
use crate::mesh_file::MeshFile;
use crate::params::{Param, ParamType, Values};
use crate::report::Report;
use crate::shape::subdivision::{NoSurface, Surface};
use crate::texture::Textured;
use crate::transform;

/// Most memory of a subdivision, or of a grid of patches, in bytes, for its vertices must be numbered by 32 bits.
pub(super) const MAX_SUBDIVIDED: u64 = 64 << 30;

/// Memory per triangle while a mesh is subdivided, at its peak: 139 bytes were measured.
const BYTES_PER_TRIANGLE: u64 = 160;

/// Types of texture coordinates.
pub(super) const UV: &[ParamType] = &[ParamType::Point2, ParamType::Float];

/// Alpha masks of a mesh, which cut it out where a parameter is 0.
#[derive(Default)]
pub(crate) struct Cutouts {
    pub alpha: Option<TexturedParam<f32>>,
    pub shadow_alpha: Option<TexturedParam<f32>>,
}

/// Reads the parameters that all meshes have.
pub(super) fn cutouts(values: &mut Textured) -> Cutouts {
    let cutouts = Cutouts {
        alpha: cutout(values, "alpha"),
        shadow_alpha: cutout(values, "shadowalpha"),
    };
    let Textured { lookup, report, .. } = values;
    if lookup.bool("discarddegenerateUVs", false, report) {
        report.unsupported(lookup.at, "\"discarddegenerateUVs\" is");
    }
    cutouts
}

/// Reads an alpha mask. Only 0 cuts out, so other constants mean no mask. In pbrt-v4, a value is a probability.
fn cutout(values: &mut Textured, name: &'static str) -> Option<TexturedParam<f32>> {
    match values.find(name)?.0 {
        TexturedParam::Constant(value) if values.report.is_version4 && value >= 1.0 => None,
        alpha if values.report.is_version4 && alpha.constant().is_none_or(|&alpha| alpha > 0.0) => {
            Some(TexturedParam::Texture(Arc::new(Texture::Dither(alpha))))
        }
        TexturedParam::Constant(value) if value != 0.0 => None,
        alpha => Some(alpha),
    }
}

/// Reads the file name of a `plymesh`, whose mesh is measured from `middle`. `None`: a mistake was reported.
pub(super) fn ply_mesh(
    lookup: &mut Lookup,
    (to_world, middle): (&DMat4, DVec3),
    report: &mut Report,
) -> Option<MeshFile> {
    let (name, at) = lookup.needed_string("filename", report)?;
    Some(MeshFile {
        name: name.to_owned(),
        path: report.sources.folder.join(name),
        at,
        to_world: *to_world * DMat4::from_translation(middle),
        middle,
    })
}

/// Reads the mesh of a `trianglemesh`, in object space and measured from `middle`. `None`: a mistake was reported.
pub(super) fn triangle_mesh(
    lookup: &mut Lookup,
    middle: DVec3,
    report: &mut Report,
) -> Option<TriangleMesh> {
    let errors_before = report.error_count();
    let indices = lookup.needed("indices", &[ParamType::Integer], "integer", report);
    let points = lookup.needed("P", &[ParamType::Point3], "point", report);
    let normals = lookup.find("N", &[ParamType::Normal]);
    let tangents = lookup.find("S", &[ParamType::Vector3]);
    let uvs = lookup.find("uv", UV).or_else(|| lookup.find("st", UV));
    let (indices, points) = (indices?, points?);
    let (Values::Integers(index_values), Values::Points(point_values)) =
        (&indices.values, &points.values)
    else {
        return None;
    };
    let count = point_values.len() / 3;
    check_indices(indices, index_values, (3, "triangles"), count, report);
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
        positions: point_values
            .chunks_exact(3)
            .map(|p| (DVec3::from_slice(p) - middle).as_vec3().to_array())
            .collect(),
        indices: triangles(index_values).collect(),
        normals: triples(&floats(normals, 3))
            .map(|n| transform::unit(DVec3::from(n.map(f64::from))))
            .collect(),
        uvs: floats(uvs, 2)
            .chunks_exact(2)
            .map(|t| Vec2::new(t[0], t[1]))
            .collect(),
        colors: Vec::new(),
    })
}

/// Most levels of subdivision: each of them makes four triangles of one.
const MAX_LEVELS: u32 = 24;

/// Reads a `loopsubdiv` and divides its mesh, in object space and measured from `middle`. `None`: a mistake was reported.
pub(super) fn subdivided(
    lookup: &mut Lookup,
    middle: DVec3,
    report: &mut Report,
) -> Option<TriangleMesh> {
    let errors_before = report.error_count();
    let older = lookup.integer_in("nlevels", 3, [0, MAX_LEVELS], report);
    let levels = lookup.integer_in("levels", older, [0, MAX_LEVELS], report);
    // There is one.
    lookup.choice("scheme", [("loop", ())], report);
    let indices = lookup.needed("indices", &[ParamType::Integer], "integer", report);
    let points = lookup.needed("P", &[ParamType::Point3], "point", report);
    let (indices, points) = (indices?, points?);
    let (Values::Integers(index_values), Values::Points(point_values)) =
        (&indices.values, &points.values)
    else {
        return None;
    };
    let count = point_values.len() / 3;
    check_indices(indices, index_values, (3, "triangles"), count, report);
    let bytes = (index_values.len() as u64 / 3)
        .checked_mul(1 << (2 * levels))
        .and_then(|triangles| triangles.checked_mul(BYTES_PER_TRIANGLE));
    if bytes.is_none_or(|bytes| bytes > report.sources.limit.min(MAX_SUBDIVIDED)) {
        report.error_help(
            lookup.at,
            format!("{levels} levels of subdivision make more triangles than memory allows"),
            "take fewer levels, or allow more memory",
        );
    }
    if report.error_count() > errors_before {
        return None;
    }
    let positions = point_values
        .chunks_exact(3)
        .map(DVec3::from_slice)
        .collect();
    let mut surface = match Surface::new(positions, triangles(index_values).collect()) {
        Ok(surface) => surface,
        Err(NoSurface([from, to])) => {
            let where_ = match from == to {
                true => format!("the triangles at vertex {from} do not follow each other"),
                false => format!(
                    "the triangles at the edge from vertex {from} to {to} are no neighbours"
                ),
            };
            report.error_help(
                lookup.at,
                format!("the mesh is no surface: {where_}"),
                "an edge has at most two triangles, with their corners in the same sense",
            );
            return None;
        }
    };
    for _ in 0..levels {
        surface.divide();
    }
    let (positions, normals) = surface.limit();
    Some(TriangleMesh {
        positions: positions
            .iter()
            .map(|p| (*p - middle).as_vec3().to_array())
            .collect(),
        indices: surface.indices,
        normals: normals.into_iter().map(transform::unit).collect(),
        ..TriangleMesh::default()
    })
}

fn triangles(indices: &[i32]) -> impl Iterator<Item = [u32; 3]> + '_ {
    let triangles = indices.chunks_exact(3);
    triangles.map(|t| [t[0] as u32, t[1] as u32, t[2] as u32])
}

fn triples(values: &[f32]) -> impl Iterator<Item = [f32; 3]> + '_ {
    values.chunks_exact(3).map(|t| [t[0], t[1], t[2]])
}

/// Reports the first index that is out of range, and the number of further ones.
///
/// `group` indices make one of `what`.
pub(super) fn check_indices(
    param: &Param,
    indices: &[i32],
    (group, what): (usize, &str),
    count: usize,
    report: &mut Report,
) {
    if indices.is_empty() || !indices.len().is_multiple_of(group) {
        report.error(
            param.list,
            format!("{} indices do not make {what}", indices.len()),
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

/// Checks that there is one value per vertex. More texture coordinates are accepted, as in pbrt.
pub(super) fn check_count(param: &Param, components: usize, vertices: usize, report: &mut Report) {
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
