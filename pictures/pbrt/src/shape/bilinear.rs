//! Bilinear patches of pbrt-v4: two triangles where a patch is a parallelogram, and a grid of them elsewhere.

use antumbra_scene::TriangleMesh;
use glam::{DVec3, Vec2};

use super::mesh::{MAX_SUBDIVIDED, UV, check_count, check_indices, floats};
use crate::lookup::{INTEGER, Lookup};
use crate::params::ParamType;
use crate::transform;

/// Cells along each side of a patch that is no parallelogram.
const CELLS: usize = 16;

/// Reads the patches of a `bilinearmesh`, in object space and measured from `middle`. `None`: a mistake was reported.
pub(super) fn bilinear_mesh(lookup: &mut Lookup, middle: DVec3) -> Option<TriangleMesh> {
    let errors_before = lookup.report.error_count();
    let points = lookup.find("P", &[ParamType::Point3]);
    let normals = lookup.find("N", &[ParamType::Normal]);
    let uvs = lookup.find("uv", UV);
    let indices = lookup.find("indices", INTEGER);
    if points.is_none() {
        lookup.report_missing("P", "point3");
    }
    let positions: Vec<DVec3> = points?.values.points()?.collect();
    for (param, components) in [(normals, 3), (uvs, 2)] {
        check_count(lookup, param, components, positions.len());
    }
    // A single patch needs no indices.
    let corners = match indices {
        Some(param) => {
            let values = param.values.integers()?;
            check_indices(lookup, param, (4, "patches"), positions.len());
            values
        }
        None if positions.len() == 4 => &[0, 1, 2, 3],
        None => {
            lookup.report_missing("indices", "integer");
            return None;
        }
    };
    lookup.report.clean_since(errors_before)?;
    let (normals, uvs) = (floats(normals), floats(uvs));
    let mut mesh = TriangleMesh::default();
    for corners in corners.chunks_exact(4) {
        let at = [0, 1, 2, 3].map(|k| corners[k] as usize);
        let p = at.map(|k| positions[k]);
        let n = (!normals.is_empty()).then(|| {
            at.map(|k| DVec3::from([0, 1, 2].map(|axis| f64::from(normals[3 * k + axis]))))
        });
        let uv = match uvs {
            [] => [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE],
            uvs => at.map(|k| Vec2::new(uvs[2 * k], uvs[2 * k + 1])),
        };
        patch(&mut mesh, p.map(|p| p - middle), n, uv);
        if mesh.bytes() > lookup.report.sources.limit.min(MAX_SUBDIVIDED) {
            let message = "the patches make more triangles than memory allows";
            return lookup.fail_help(message, "take fewer patches, or allow more memory");
        }
    }
    Some(mesh)
}

/// Adds a patch with the corners at (0, 0), (1, 0), (0, 1) and (1, 1).
fn patch(mesh: &mut TriangleMesh, p: [DVec3; 4], n: Option<[DVec3; 4]>, uv: [Vec2; 4]) {
    let twist = p[0] - p[1] - p[2] + p[3];
    let size = (p[3] - p[0]).length().max((p[2] - p[1]).length());
    let cells = match twist.length() <= 1e-6 * size {
        true => 1,
        false => CELLS,
    };
    let first = mesh.positions.len() as u32;
    for j in 0..=cells {
        for i in 0..=cells {
            let [u, v] = [i, j].map(|k| k as f64 / cells as f64);
            let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
            let sum = |of: &[DVec3; 4]| -> DVec3 { (0..4).map(|k| of[k] * weights[k]).sum() };
            mesh.positions.push(sum(&p).as_vec3().to_array());
            let normal = match &n {
                Some(n) => sum(n),
                None => {
                    let along_u = (p[1] - p[0]) * (1.0 - v) + (p[3] - p[2]) * v;
                    let along_v = (p[2] - p[0]) * (1.0 - u) + (p[3] - p[1]) * u;
                    along_u.cross(along_v)
                }
            };
            mesh.normals.push(transform::unit(normal));
            let at: Vec2 = (0..4).map(|k| uv[k] * weights[k] as f32).sum();
            mesh.uvs.push(at);
        }
    }
    let row = cells as u32 + 1;
    for j in 0..cells as u32 {
        for i in 0..cells as u32 {
            let corner = first + j * row + i;
            let [a, b, c, d] = [corner, corner + 1, corner + row, corner + row + 1];
            mesh.indices.extend([[a, b, d], [a, d, c]]);
        }
    }
}
