//! Spheres: whole ones are kept as such, parts and ellipsoids become meshes.

use std::sync::Arc;

use antumbra_scene::{Geometry, Sphere};
use glam::{DMat4, Vec3};

use super::quadric::{Fineness, SpherePart};
use crate::lookup::Lookup;
use crate::report::Report;

/// The geometry of a `sphere`. `None`: something was reported.
pub(super) fn sphere(
    lookup: &mut Lookup,
    to_world: &DMat4,
    fineness: Fineness,
    report: &mut Report,
) -> Option<Geometry> {
    let part = SpherePart::read(lookup, report)?;
    let whole = Sphere {
        center: Vec3::ZERO,
        radius: part.radius as f32,
    };
    match whole.transformed(to_world).filter(|_| part.is_whole()) {
        Some(sphere) => {
            let is_finite = sphere.center.is_finite() && sphere.radius.is_finite();
            if !(is_finite && sphere.radius > 0.0) {
                let message = "this sphere is beyond the range of 32-bit floats";
                report.error(lookup.at, message);
                return None;
            }
            Some(Geometry::Sphere(sphere))
        }
        None => {
            let mut mesh = part.mesh(fineness);
            mesh.transform(to_world);
            Some(Geometry::Mesh(Arc::new(mesh)))
        }
    }
}
