//! Triangle meshes, given in the scene or in a separate file.

use std::sync::Arc;

use antumbra_scene::{Param as TexturedParam, Texture, TriangleMesh};
use glam::{DMat4, DVec3, Vec2};

use crate::lookup::{INTEGER, Lookup};
use crate::mesh_file::MeshFile;
use crate::params::{Param, ParamType, Values};
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
    if values.bool("discarddegenerateUVs", false) {
        values.unsupported("\"discarddegenerateUVs\" is");
    }
    cutouts
}

/// Reads an alpha mask. Only 0 cuts out, so other constants mean no mask. In pbrt-v4, a value is a probability.
fn cutout(values: &mut Textured, name: &'static str) -> Option<TexturedParam<f32>> {
    match values.textured(name)?.0 {
        TexturedParam::Constant(value) if values.is_version4() && value >= 1.0 => None,
        alpha if values.is_version4() && alpha.constant().is_none_or(|&alpha| alpha > 0.0) => {
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
) -> Option<MeshFile> {
    let (name, at) = lookup.needed_string("filename")?;
    Some(MeshFile {
        name: name.to_owned(),
        path: lookup.report.sources.folder.join(name),
        at,
        to_world: *to_world * DMat4::from_translation(middle),
        middle,
    })
}

/// Corners of triangles and their points, which must be given. `None`: a mistake was reported.
fn triangles_and_points<'a>(
    lookup: &mut Lookup<'a>,
) -> Option<(
    Vec<[u32; 3]>,
    impl ExactSizeIterator<Item = DVec3> + use<'a>,
)> {
    let indices = lookup.needed("indices", INTEGER);
    let points = lookup.needed("P", &[ParamType::Point3]);
    let (indices, points) = (indices?, points?.values.points());
    let (values, points) = (indices.values.integers()?, points?);
    check_indices(lookup, indices, (3, "triangles"), points.len());
    let triangles = values.chunks_exact(3);
    let triangles = triangles.map(|t| [t[0] as u32, t[1] as u32, t[2] as u32]);
    Some((triangles.collect(), points))
}

/// Reads the mesh of a `trianglemesh`, in object space and measured from `middle`. `None`: a mistake was reported.
pub(super) fn triangle_mesh(lookup: &mut Lookup, middle: DVec3) -> Option<TriangleMesh> {
    let errors_before = lookup.report.error_count();
    let normals = lookup.find("N", &[ParamType::Normal]);
    let tangents = lookup.find("S", &[ParamType::Vector3]);
    let uvs = lookup.find("uv", UV).or_else(|| lookup.find("st", UV));
    let (indices, points) = triangles_and_points(lookup)?;
    for (param, components) in [(normals, 3), (tangents, 3), (uvs, 2)] {
        check_count(lookup, param, components, points.len());
    }
    if let Some(param) = tangents {
        let message = "\"S\" is left out: tangents come from texture coordinates";
        lookup.report.note(param.declaration, message);
    }
    lookup.report.clean_since(errors_before)?;
    let normal = |n: &[f32]| transform::unit(DVec3::new(n[0].into(), n[1].into(), n[2].into()));
    let uv = |t: &[f32]| Vec2::new(t[0], t[1]);
    Some(TriangleMesh {
        normals: floats(normals).chunks_exact(3).map(normal).collect(),
        uvs: (floats(uvs).chunks_exact(2).take(points.len()))
            .map(uv)
            .collect(),
        positions: points.map(|p| (p - middle).as_vec3().to_array()).collect(),
        indices,
        colors: Vec::new(),
    })
}

/// Most levels of subdivision: each of them makes four triangles of one.
const MAX_LEVELS: u32 = 24;

/// Reads a `loopsubdiv` and divides its mesh, in object space and measured from `middle`. `None`: a mistake was reported.
pub(super) fn subdivided(lookup: &mut Lookup, middle: DVec3) -> Option<TriangleMesh> {
    let errors_before = lookup.report.error_count();
    let older = lookup.integer_in("nlevels", 3, [0, MAX_LEVELS]);
    let levels = lookup.integer_in("levels", older, [0, MAX_LEVELS]);
    // There is one.
    lookup.choice("scheme", [("loop", ())]);
    let (indices, points) = triangles_and_points(lookup)?;
    let bytes = (indices.len() as u64)
        .checked_mul(1 << (2 * levels))
        .and_then(|triangles| triangles.checked_mul(BYTES_PER_TRIANGLE));
    if bytes.is_none_or(|bytes| bytes > lookup.report.sources.limit.min(MAX_SUBDIVIDED)) {
        let message =
            format!("{levels} levels of subdivision make more triangles than memory allows");
        lookup.error_help(message, "take fewer levels, or allow more memory");
    }
    lookup.report.clean_since(errors_before)?;
    let mut surface = match Surface::new(points.collect(), indices) {
        Ok(surface) => surface,
        Err(NoSurface([from, to])) => {
            let problem = match from == to {
                true => format!("the triangles at vertex {from} do not follow each other"),
                false => format!(
                    "the triangles at the edge from vertex {from} to {to} are no neighbours"
                ),
            };
            let message = format!("the mesh is no surface: {problem}");
            let help = "an edge has at most two triangles, with their corners in the same sense";
            return lookup.fail_help(message, help);
        }
    };
    for _ in 0..levels {
        surface.divide();
    }
    let (positions, normals) = surface.limit();
    let position = |p: DVec3| (p - middle).as_vec3().to_array();
    Some(TriangleMesh {
        positions: positions.into_iter().map(position).collect(),
        indices: surface.indices,
        normals: normals.into_iter().map(transform::unit).collect(),
        ..TriangleMesh::default()
    })
}

/// Values of a parameter that may be given.
pub(super) fn floats(param: Option<&Param>) -> &[f32] {
    let values = param.and_then(|param| param.values.floats());
    values.unwrap_or_default()
}

/// Reports the first index that is out of range, and the number of further ones.
///
/// `group` indices make one of `what`.
pub(super) fn check_indices(
    lookup: &mut Lookup,
    param: &Param,
    (group, what): (usize, &str),
    count: usize,
) {
    let report = &mut *lookup.report;
    let indices = param.values.integers().unwrap_or_default();
    if indices.is_empty() || !indices.len().is_multiple_of(group) {
        let message = format!("{} indices do not make {what}", indices.len());
        report.error(param.list, message);
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
    let index = indices[first];
    let message =
        format!("vertex index {index} is out of range: \"P\" has {count} points{and_more}");
    let help = match count {
        0 => "there are no points".to_owned(),
        count => format!("indices are 0 to {}", count - 1),
    };
    report.error_help(span, message, help);
}

/// Checks that there is one value per vertex. More texture coordinates are accepted, as in pbrt.
pub(super) fn check_count(
    lookup: &mut Lookup,
    param: Option<&Param>,
    components: usize,
    vertices: usize,
) {
    let Some(param) = param.filter(|param| param.values != Values::Broken) else {
        return;
    };
    let (name, found) = (&param.name, param.values.len() / components);
    if components == 2 && found > vertices {
        let message =
            format!("{name:?} has {found} values for {vertices} points, the rest is left out");
        lookup.report.note(param.declaration, message);
    } else if found != vertices {
        let message = format!("{name:?} has {found} values, but \"P\" has {vertices} points");
        lookup.report.error(param.list, message);
    }
}
