//! Primitives for the tests of several builders.

use std::sync::Arc;

use antumbra::cutout::{Candidate, Opacity};
use antumbra::shapes::Sphere;
use antumbra::{Geometry, Primitives};
use antumbra_testkit::{Mesh, Rng};

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
    let cutouts = match spheres {
        0 => 0,
        _ => mesh.indices.len() / 3,
    };
    let (cutouts, opaque) = mesh.indices.split_at(cutouts);
    let spheres = (0..spheres).map(|_| Sphere {
        center: rng.point(1.0),
        radius: 0.1,
    });
    let geometries = [
        Geometry::cutouts(&mesh.positions[..], cutouts, Arc::new(Veil)),
        Geometry::triangles(&mesh.positions[..], opaque),
        Geometry::spheres(spheres.collect::<Vec<_>>()),
    ];
    Primitives::new(&geometries).expect("indices in range")
}
