//! One mesh as triangles, as quads, as user geometry, and with a filter.

use std::sync::Arc;

use antumbra::cutout::{Candidate, Opacity};
use antumbra::shapes::{UserGeometry, UserHit};
use antumbra::{Aabb, Geometry, Ray};
use glam::Vec3;

use crate::harness::Mesh;

/// Two triangles in a row that run along a common edge in opposite directions become a quad, others a quad with its last
/// two corners in one place: the same surfaces.
pub fn quads(mesh: &Mesh) -> Geometry<'_> {
    let mut quads = Vec::with_capacity(mesh.indices.len());
    let mut rest = &mesh.indices[..];
    while let [first, others @ ..] = rest {
        let joined = others.first().and_then(|second| join(*first, *second));
        quads.push(joined.unwrap_or([first[0], first[1], first[2], first[2]]));
        rest = if joined.is_some() {
            &others[1..]
        } else {
            others
        };
    }
    Geometry::quads(&mesh.positions[..], quads)
}

pub fn user(mesh: &Mesh) -> Geometry<'_> {
    let count = mesh.indices.len();
    let corners = (0..count).map(|index| mesh.corners(index)).collect();
    Geometry::user(count as u32, Arc::new(Triangles { corners }))
}

/// The mesh with a filter, for Embree.
pub fn holes(mesh: &Mesh) -> Geometry<'_> {
    Geometry::cutouts(&mesh.positions[..], &mesh.indices[..], Arc::new(Sieve))
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
        Aabb::around(&self.corners[prim_id as usize])
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        let [a, b, c] = self.corners[prim_id as usize].map(Vec3::from);
        let (org, dir) = (Vec3::from(ray.org), Vec3::from(ray.dir));
        let (ab, ac, from) = (b - a, c - a, org - a);
        let p = dir.cross(ac);
        let det = ab.dot(p);
        let u = from.dot(p) / det;
        let q = from.cross(ab);
        let v = dir.dot(q) / det;
        let t = ac.dot(q) / det;
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
        let merged = Mesh {
            positions: vec![[0.0; 3]; 5],
            indices: vec![[4, 0, 1], [0, 1, 3], [1, 2, 3], [0, 1, 2]],
        };
        let Geometry::Quads(mesh) = quads(&merged) else {
            panic!("not quads");
        };
        assert_eq!(mesh.indices[..], [[4, 0, 1, 1], [0, 1, 2, 3], [0, 1, 2, 2]]);
    }
}
