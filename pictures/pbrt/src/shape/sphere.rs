//! Spheres. Whole spheres stay exact, and parts and ellipsoids become meshes.

use std::sync::Arc;

use antumbra_scene::{Geometry, Sphere};
use glam::{DMat4, Vec3};

use super::quadric::{SpherePart, Tessellation};
use crate::lookup::Lookup;

/// Reads the geometry of a `sphere`. `None`: a mistake was reported.
pub(super) fn sphere(
    lookup: &mut Lookup,
    to_world: &DMat4,
    tessellation: Tessellation,
) -> Option<Geometry> {
    let part = SpherePart::read(lookup)?;
    let whole = Sphere::new(Vec3::ZERO, part.radius as f32);
    match whole.transformed(to_world).filter(|_| part.is_whole()) {
        Some(sphere) => {
            let is_finite = sphere.center.is_finite() && sphere.radius.is_finite();
            if !(is_finite && sphere.radius > 0.0) {
                return lookup.fail("the sphere is beyond the range of 32-bit floats");
            }
            Some(Geometry::Sphere(sphere))
        }
        None => {
            let mut mesh = part.mesh(tessellation);
            mesh.transform(to_world);
            Some(Geometry::Mesh(Arc::new(mesh)))
        }
    }
}
