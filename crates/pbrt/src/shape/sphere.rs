//! Spheres.

use antumbra_scene::Sphere;
use glam::{DMat4, Vec3};

use crate::lookup::Lookup;
use crate::report::Report;

/// What [`Report::unsupported`] is told of a sphere that a transformation makes none.
pub(crate) const ELLIPSOID: &str = "a sphere under a scale that differs by axis (an ellipsoid) is";

/// A whole sphere. `None`: something was reported.
pub(super) fn sphere(lookup: &mut Lookup, to_world: &DMat4, report: &mut Report) -> Option<Sphere> {
    let positive = [f32::MIN_POSITIVE, f32::MAX];
    let radius = lookup.float_in("radius", 1.0, positive, report);
    let z_min = lookup.float("zmin", -radius, report);
    let z_max = lookup.float("zmax", radius, report);
    let phi_max = lookup.float("phimax", 360.0, report);
    if z_min.min(z_max) > -radius || z_min.max(z_max) < radius || phi_max < 360.0 {
        report.unsupported(lookup.at, "a part of a sphere is");
        return None;
    }
    let sphere = Sphere {
        center: Vec3::ZERO,
        radius,
    };
    let Some(sphere) = sphere.transformed(to_world) else {
        report.unsupported(lookup.at, ELLIPSOID);
        return None;
    };
    if !(sphere.center.is_finite() && sphere.radius.is_finite() && sphere.radius > 0.0) {
        report.error(
            lookup.at,
            "this sphere is beyond the range of 32-bit floats",
        );
        return None;
    }
    Some(sphere)
}
