//! Tessellation of smooth surfaces by a grid of vertices over the unit square of texture coordinates.

use antumbra_scene::TriangleMesh;
use glam::{DVec3, Vec2};

/// Makes a mesh of `columns` times `rows` quads.
///
/// `vertex` returns position and normal at (u, v). The normal has the direction of the cross product of the derivatives
/// along u and v. Triangles with two equal vertices, as at the poles of a sphere, are dropped.
pub(super) fn mesh(
    [columns, rows]: [u32; 2],
    vertex: impl Fn(f64, f64) -> (DVec3, DVec3),
) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for row in 0..=rows {
        for column in 0..=columns {
            let u = f64::from(column) / f64::from(columns);
            let v = f64::from(row) / f64::from(rows);
            let (position, normal) = vertex(u, v);
            mesh.positions.push(position.as_vec3().into());
            mesh.normals.push(crate::transform::unit(normal));
            mesh.uvs.push(Vec2::new(u as f32, v as f32));
        }
    }
    let index = |column: u32, row: u32| row * (columns + 1) + column;
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [index(column, row), index(column + 1, row)];
            let [c, d] = [index(column + 1, row + 1), index(column, row + 1)];
            for triangle in [[a, b, c], [a, c, d]] {
                let [p, q, r] = triangle.map(|i| mesh.positions[i as usize]);
                if p != q && q != r && r != p {
                    mesh.indices.push(triangle);
                }
            }
        }
    }
    mesh
}

/// Total area of the triangles.
pub(super) fn area(mesh: &TriangleMesh) -> f64 {
    let corner = |i: u32| DVec3::from(mesh.positions[i as usize].map(f64::from));
    let areas = mesh.indices.iter().map(|triangle| {
        let [a, b, c] = triangle.map(corner);
        0.5 * (b - a).cross(c - a).length()
    });
    areas.sum()
}
