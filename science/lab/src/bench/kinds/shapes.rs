//! One mesh as triangles, as quads, as user geometry, and with a filter.

use std::sync::Arc;

use antumbra::cutout::{Candidate, Opacity};
use antumbra::shapes::{TriangleMesh, UserGeometry, UserHit};
use antumbra::{Aabb, Geometry, Ray};
use antumbra_render::Lowered;

/// All meshes of a world as one.
#[derive(Clone, Debug, Default)]
pub struct Merged {
    pub positions: Vec<[f32; 3]>,
    pub indices: Vec<[u32; 3]>,
}

impl Merged {
    pub fn new(model: &Lowered) -> Self {
        let mut merged = Self::default();
        for geometry in &model.world {
            if let Geometry::Triangles(mesh) = geometry {
                let first = merged.positions.len() as u32;
                merged.positions.extend_from_slice(&mesh.positions);
                let indices = mesh.indices.iter();
                merged
                    .indices
                    .extend(indices.map(|triangle| triangle.map(|index| first + index)));
            }
        }
        merged
    }

    /// The mesh, for Embree.
    pub fn mesh(&self) -> TriangleMesh<'_> {
        TriangleMesh::new(&self.positions[..], &self.indices[..])
    }

    pub fn triangles(&self) -> Geometry<'_> {
        Geometry::Triangles(self.mesh())
    }

    /// Two triangles in a row that run along a common edge in opposite directions become a quad, others a quad with its last
    /// two corners in one place: the same surfaces.
    pub fn quads(&self) -> Geometry<'_> {
        let mut quads = Vec::with_capacity(self.indices.len());
        let mut rest = &self.indices[..];
        while let [first, others @ ..] = rest {
            let joined = others.first().and_then(|second| join(*first, *second));
            quads.push(joined.unwrap_or([first[0], first[1], first[2], first[2]]));
            rest = if joined.is_some() {
                &others[1..]
            } else {
                others
            };
        }
        Geometry::quads(&self.positions[..], quads)
    }

    pub fn user(&self) -> Geometry<'_> {
        let corners = (self.indices.iter())
            .map(|triangle| triangle.map(|index| self.positions[index as usize]))
            .collect();
        Geometry::user(self.indices.len() as u32, Arc::new(Triangles { corners }))
    }

    /// The mesh with a filter, for Embree.
    pub fn holes(&self) -> Geometry<'_> {
        Geometry::cutouts(&self.positions[..], &self.indices[..], Arc::new(Sieve))
    }
}

/// A model of one geometry.
pub fn lowered(geometry: Geometry<'_>) -> Lowered<'_> {
    Lowered {
        world: vec![geometry],
        ..Lowered::default()
    }
}

/// The quad `[a, b, c, d]` whose halves, the triangles (a, b, d) and (c, d, b), are two given ones.
fn join(first: [u32; 3], second: [u32; 3]) -> Option<[u32; 4]> {
    let turns = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]];
    for [a, b, d] in turns(first) {
        for [c, e, f] in turns(second) {
            if [e, f] == [d, b] {
                return Some([a, b, c, d]);
            }
        }
    }
    None
}

/// Stops rays at three of four primitives, by their numbers.
#[derive(Debug)]
pub struct Sieve;

impl Sieve {
    /// Whether hits on a primitive count.
    pub fn stops(&self, prim_id: u32) -> bool {
        prim_id.wrapping_mul(0x9e37_79b1) >> 30 != 0
    }
}

impl Opacity for Sieve {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        if self.stops(candidate.prim_id) {
            1.0
        } else {
            0.0
        }
    }
}

/// Triangles as user geometry: the test of Möller and Trumbore (1997).
#[derive(Debug)]
struct Triangles {
    corners: Vec<[[f32; 3]; 3]>,
}

impl UserGeometry for Triangles {
    fn bounds(&self, prim_id: u32) -> Aabb {
        let [a, b, c] = self.corners[prim_id as usize];
        Aabb {
            min: [0, 1, 2].map(|axis| a[axis].min(b[axis]).min(c[axis])),
            max: [0, 1, 2].map(|axis| a[axis].max(b[axis]).max(c[axis])),
        }
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        let minus = |p: [f32; 3], q: [f32; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let dot = |p: [f32; 3], q: [f32; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let cross = |p: [f32; 3], q: [f32; 3]| {
            [
                p[1] * q[2] - p[2] * q[1],
                p[2] * q[0] - p[0] * q[2],
                p[0] * q[1] - p[1] * q[0],
            ]
        };
        let [a, b, c] = self.corners[prim_id as usize];
        let (ab, ac, from) = (minus(b, a), minus(c, a), minus(ray.org, a));
        let p = cross(ray.dir, ac);
        let det = dot(ab, p);
        let u = dot(from, p) / det;
        let q = cross(from, ab);
        let v = dot(ray.dir, q) / det;
        let t = dot(ac, q) / det;
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        (inside && ray.tnear < t && t < ray.tfar).then_some(UserHit::new(t, u, v))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_become_quads() {
        // Both halves of a quad, however they are turned; no common edge; a common edge in the same direction.
        assert_eq!(join([0, 1, 3], [2, 3, 1]), Some([0, 1, 2, 3]));
        assert_eq!(join([3, 0, 1], [1, 2, 3]), Some([0, 1, 2, 3]));
        assert_eq!(join([0, 1, 2], [2, 3, 4]), None);
        assert_eq!(join([0, 1, 3], [3, 2, 1]), None);
        let merged = Merged {
            positions: vec![[0.0; 3]; 5],
            indices: vec![[4, 0, 1], [0, 1, 3], [1, 2, 3], [0, 1, 2]],
        };
        let Geometry::Quads(mesh) = merged.quads() else {
            panic!("not quads");
        };
        assert_eq!(mesh.indices[..], [[4, 0, 1, 1], [0, 1, 2, 3], [0, 1, 2, 2]]);
    }
}
