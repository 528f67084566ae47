//! Directive for the camera, with the parameters and defaults of pbrt-v3.
//!
//! - `lens`: cameras with lens systems

mod lens;

use antumbra_scene::{Camera, Projection};
use glam::{DMat4, DVec3, DVec4, Mat3A, Mat4};

use crate::lookup::{FLOAT, Lookup, NOT_NEGATIVE, POSITIVE};
use crate::state::{MIRRORS, MIRRORS_HELP, Transforms};
use crate::transform;

/// Supported cameras.
pub(crate) const SUPPORTED: &[&str] = &["environment", "orthographic", "perspective", "realistic"];

/// Supported cameras of pbrt-v4.
const SUPPORTED4: &[&str] = &["environment", "orthographic", "perspective", "spherical"];

/// Reads a `Camera`. Returns the camera, which is measured from `origin`, and, in double precision, camera to world space at
/// the start and at the end of the exposure.
pub(crate) fn read(
    lookup: &mut Lookup,
    transforms: &Transforms,
    origin: DVec3,
) -> (Camera, [DMat4; 2]) {
    let (matrix, start) = world_from_camera_of(lookup, transforms.start, origin);
    let (end, place) = match transforms.is_animated() {
        true => moved(lookup, transforms, origin, &matrix),
        false => (None, start),
    };
    let camera = Camera {
        world_from_camera: matrix,
        end,
        ..of_kind(lookup)
    };
    (camera, [start, place])
}

/// Camera to world space at the end of the exposure, in single precision where it differs from that at the start, `matrix`.
fn moved(
    lookup: &mut Lookup,
    transforms: &Transforms,
    origin: DVec3,
    matrix: &Mat4,
) -> (Option<Mat4>, DMat4) {
    let (moved, place) = world_from_camera_of(lookup, transforms.end, origin);
    let ends = [transforms.start, transforms.end];
    if transforms.mirror_differently() {
        lookup.error_help(MIRRORS, MIRRORS_HELP);
    } else if ends.iter().any(|matrix| matrix.row(3) != DVec4::W) {
        lookup.unsupported("a moving camera under a perspective transformation is");
    } else {
        return ((moved != *matrix).then_some(moved), place);
    }
    (None, place)
}

/// Reads the parameters of a camera by its kind.
fn of_kind(lookup: &mut Lookup) -> Camera {
    let is_version4 = lookup.is_version4();
    let projection = match lookup.kind.text.as_str() {
        "perspective" => return perspective(lookup),
        "orthographic" => {
            return Camera {
                projection: Projection::Orthographic,
                ..plane(lookup)
            };
        }
        "realistic" if !is_version4 => return lens::realistic(lookup),
        "environment" => Projection::Spherical,
        "spherical" if is_version4 => {
            let mappings = [
                ("equalarea", Projection::EqualArea),
                ("equirectangular", Projection::Spherical),
            ];
            lookup.choice("mapping", mappings)
        }
        "realistic" => {
            let span = lookup.kind.span;
            (lookup.report).unsupported_kind(span, "camera", "realistic", SUPPORTED4);
            lookup.ignore_all();
            return Camera::default();
        }
        _ => {
            lookup.unknown(if is_version4 { SUPPORTED4 } else { SUPPORTED });
            return Camera::default();
        }
    };
    // As in pbrt-v3, which reads the others without effect.
    Camera {
        shutter: plane(lookup).shutter,
        projection,
        ..Camera::default()
    }
}

/// Camera to world space, twice: in single precision, measured from `origin`, and in double precision, as in the file.
fn world_from_camera_of(
    lookup: &mut Lookup,
    camera_from_world: DMat4,
    origin: DVec3,
) -> (Mat4, DMat4) {
    let world_from_camera = if transform::is_invertible(&camera_from_world) {
        camera_from_world.inverse()
    } else {
        let message = "the transformation in force here cannot be inverted";
        lookup.error_help(message, "no factor of a Scale may be 0");
        DMat4::IDENTITY
    };
    let mut matrix = world_from_camera;
    matrix.w_axis -= origin.extend(0.0);
    let matrix = matrix.as_mat4();
    let determinant = Mat3A::from_mat4(matrix).determinant();
    if !matrix.is_finite() || !determinant.is_finite() || determinant == 0.0 {
        // Camera rays are computed in single precision.
        let message = format!(
            "the camera to world transformation in force here cannot be used in single precision: its \
             determinant is {determinant}"
        );
        let help = "the factors of a Scale must not be so small or so large";
        lookup.error_help(message, help);
    }
    (matrix, world_from_camera)
}

fn perspective(lookup: &mut Lookup) -> Camera {
    let plane = plane(lookup);
    // A positive "halffov" takes precedence over "fov", as in pbrt.
    let half = lookup.float("halffov", -1.0);
    let full = lookup.float("fov", plane.fov);
    let fov = if half > 0.0 { 2.0 * half } else { full };
    if !(fov > 0.0 && fov < 180.0) {
        let name = if half > 0.0 { "halffov" } else { "fov" };
        let found = lookup.find(name, FLOAT);
        let place = found.map_or(lookup.at, |param| param.value);
        let message = format!("a field of view of {fov} degrees is not between 0 and 180");
        lookup.report.error(place, message);
    }
    Camera { fov, ..plane }
}

/// Shutter, screen window and lens, which cameras share.
fn plane(lookup: &mut Lookup) -> Camera {
    let defaults = Camera::default();
    let shutter = shutter(lookup);
    let screen_window = lookup.floats::<4>("screenwindow");
    if let Some(window @ [x0, x1, y0, y1]) = screen_window
        && (x0 == x1 || y0 == y1)
    {
        lookup.error(format!("the screen window {window:?} is empty"));
    }
    let has_aspect = lookup.has("frameaspectratio");
    let frame_aspect_ratio = lookup.float_in("frameaspectratio", 1.0, POSITIVE);
    Camera {
        shutter,
        screen_window,
        frame_aspect_ratio: has_aspect.then_some(frame_aspect_ratio),
        lens_radius: lookup.float_in("lensradius", 0.0, NOT_NEGATIVE),
        focal_distance: lookup.float_in("focaldistance", defaults.focal_distance, POSITIVE),
        ..defaults
    }
}

/// Times at which the shutter opens and closes.
fn shutter(lookup: &mut Lookup) -> [f32; 2] {
    let [open, close] = Camera::default().shutter;
    let mut shutter = [
        lookup.float("shutteropen", open),
        lookup.float("shutterclose", close),
    ];
    // In version 4 they were refused with the exposure.
    if shutter[1] < shutter[0] && !lookup.is_version4() {
        lookup.note("the shutter closes before it opens: the times are exchanged");
        shutter.reverse();
    }
    shutter
}
