//! What the tests of several builders build over.

use antumbra_testkit::{Mesh, Rng};

use crate::geometry::{Geometry, Sphere};
use crate::primitives::Primitives;

/// The mesh, and some spheres among its triangles.
pub fn primitives(mesh: &Mesh, spheres: usize, rng: &mut Rng) -> Primitives {
    let spheres: Vec<Sphere> = (0..spheres)
        .map(|_| Sphere {
            center: rng.point(1.0),
            radius: 0.1,
        })
        .collect();
    let geometries = [
        Geometry::triangles(&mesh.positions[..], &mesh.indices[..]),
        Geometry::spheres(spheres),
    ];
    Primitives::new(&geometries).expect("indices in range")
}
