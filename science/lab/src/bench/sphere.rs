//! Spheres as triangle meshes.

use std::f32::consts::PI;

use antumbra_scene::{Sphere, TriangleMesh};
use glam::Vec3;

/// Rows and columns of a sphere made of triangles.
const RINGS: u32 = 24;
const SECTORS: u32 = 48;

/// A sphere as a closed mesh, its triangles facing outward.
pub fn triangulate(sphere: &Sphere) -> TriangleMesh {
    let point = |dir: Vec3| (sphere.center + sphere.radius * dir).to_array();
    let mut positions = vec![point(Vec3::Z)];
    for ring in 1..RINGS {
        let (sin, cos) = (PI * ring as f32 / RINGS as f32).sin_cos();
        for sector in 0..SECTORS {
            let (y, x) = (2.0 * PI * sector as f32 / SECTORS as f32).sin_cos();
            positions.push(point(Vec3::new(sin * x, sin * y, cos)));
        }
    }
    let last = positions.len() as u32;
    positions.push(point(-Vec3::Z));
    let vertex = |ring: u32, sector: u32| match ring {
        0 => 0,
        RINGS => last,
        _ => 1 + (ring - 1) * SECTORS + sector % SECTORS,
    };
    let mut indices = Vec::new();
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let [a, b] = [vertex(ring, sector), vertex(ring, sector + 1)];
            let [c, d] = [vertex(ring + 1, sector), vertex(ring + 1, sector + 1)];
            if ring > 0 {
                indices.push([a, c, b]);
            }
            if ring + 1 < RINGS {
                indices.push([b, c, d]);
            }
        }
    }
    TriangleMesh {
        positions,
        indices,
        ..TriangleMesh::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    fn corners(mesh: &TriangleMesh, triangle: [u32; 3]) -> [Vec3; 3] {
        triangle.map(|index| mesh.positions[index as usize].into())
    }

    #[test]
    fn spheres_become_closed_meshes_that_face_outward() {
        let (center, radius) = (Vec3::new(1.0, -2.0, 3.0), 0.5);
        let mesh = triangulate(&Sphere::new(center, radius));
        let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
        let mut volume = 0.0;
        for &triangle in &mesh.indices {
            let [a, b, c] = corners(&mesh, triangle).map(|corner| corner - center);
            assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
            volume += a.dot(b.cross(c)) / 6.0;
            let [a, b, c] = triangle;
            for edge in [[a, b], [b, c], [c, a]] {
                *edges.entry(edge).or_default() += 1;
                *edges.entry([edge[1], edge[0]]).or_default() -= 1;
            }
        }
        assert!(edges.values().all(|&count| count == 0), "a gap");
        let exact = 4.0 / 3.0 * PI * radius.powi(3);
        assert!((0.98..1.0).contains(&(volume / exact)), "{volume} {exact}");
    }
}
