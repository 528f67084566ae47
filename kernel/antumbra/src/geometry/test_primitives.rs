//! Primitives for the tests of several builders.

use alloc::sync::Arc;
use alloc::vec::Vec;

use antumbra_testkit::{Mesh, Rng};

use crate::geometry::primitives::Primitives;
use crate::geometry::{Candidate, Geometry, Opacity, Sphere};

#[derive(Debug)]
struct Veil;

impl Opacity for Veil {
    fn opacity(&self, _: &Candidate) -> f32 {
        0.5
    }
}

/// The mesh, and some spheres among its triangles; if there are any, a third of the triangles are partly
/// transparent.
pub fn primitives(mesh: &Mesh, spheres: usize, rng: &mut Rng) -> Primitives {
    let cutouts = if spheres > 0 {
        mesh.indices.len() / 3
    } else {
        0
    };
    let (cutouts, opaque) = mesh.indices.split_at(cutouts);
    let spheres: Vec<Sphere> = (0..spheres)
        .map(|_| Sphere {
            center: rng.point(1.0),
            radius: 0.1,
        })
        .collect();
    let geometries = [
        Geometry::cutouts(&mesh.positions[..], cutouts, Arc::new(Veil)),
        Geometry::triangles(&mesh.positions[..], opaque),
        Geometry::spheres(spheres),
    ];
    Primitives::new(&geometries).expect("indices in range")
}
