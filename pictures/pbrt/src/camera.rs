//! Directive for the camera, with the parameters and defaults of pbrt-v3.
//!
//! - `lens`: cameras with lens systems

mod lens;

use antumbra_scene::{Camera, Projection};
use glam::{DMat4, DVec3, DVec4, Mat3A, Mat4};

use crate::directive::Quoted;
use crate::lookup::Lookup;
use crate::params::{ParamType, Params};
use crate::report::Report;
use crate::source::Span;
use crate::state::{MIRRORS, MIRRORS_HELP, Transforms};
use crate::transform;

/// Supported cameras.
pub(crate) const SUPPORTED: &[&str] = &["environment", "orthographic", "perspective", "realistic"];

/// Supported cameras of pbrt-v4.
const SUPPORTED4: &[&str] = &["environment", "orthographic", "perspective", "spherical"];

/// Handles `Camera`. Returns the camera, which is measured from `origin`, and, in double precision, camera to world space at
/// the start and at the end of the exposure.
pub(crate) fn declare(
    at: Span,
    kind: &Quoted,
    params: &Params,
    (transforms, origin): (&Transforms, DVec3),
    report: &mut Report,
) -> (Camera, [DMat4; 2]) {
    let mut lookup = Lookup::new(at, format!("camera {:?}", kind.text), params);
    let (matrix, start) = world_from_camera_of(at, transforms.start, origin, report);
    let mut places = [start; 2];
    let mut end = None;
    if transforms.is_animated() {
        let (moved, place) = world_from_camera_of(at, transforms.end, origin, report);
        places[1] = place;
        if transforms.mirror_differently() {
            report.error_help(at, MIRRORS, MIRRORS_HELP);
        } else if [transforms.start, transforms.end]
            .iter()
            .any(|matrix| matrix.row(3) != DVec4::W)
        {
            report.unsupported(at, "a moving camera under a perspective transformation is");
        } else {
            end = (moved != matrix).then_some(moved);
        }
    }
    let mut camera = Camera::default();
    match kind.text.as_str() {
        "perspective" => camera = perspective(&mut lookup, report),
        "orthographic" => {
            let plane = plane(&mut lookup, report);
            camera = Camera {
                projection: Projection::Orthographic,
                ..plane
            };
        }
        "environment" => {
            // As in pbrt-v3, which reads the others without effect.
            camera.shutter = plane(&mut lookup, report).shutter;
            camera.projection = Projection::Spherical;
        }
        "spherical" if report.is_version4 => {
            camera.shutter = plane(&mut lookup, report).shutter;
            camera.projection = lookup.choice(
                "mapping",
                [
                    ("equalarea", Projection::EqualArea),
                    ("equirectangular", Projection::Spherical),
                ],
                report,
            );
        }
        "realistic" if report.is_version4 => {
            report.unsupported_kind(kind.span, "camera", "realistic", SUPPORTED4);
            lookup.ignore_all();
        }
        "realistic" => camera = lens::realistic(&mut lookup, report),
        name => {
            let known = match report.is_version4 {
                true => SUPPORTED4,
                false => SUPPORTED,
            };
            report.unknown(kind.span, "camera", name, known);
            lookup.ignore_all();
        }
    }
    lookup.finish(report);
    camera.world_from_camera = matrix;
    camera.end = end;
    (camera, places)
}

/// Camera to world space, twice: in single precision, measured from `origin`, and in double precision, as in the file.
fn world_from_camera_of(
    at: Span,
    camera_from_world: DMat4,
    origin: DVec3,
    report: &mut Report,
) -> (Mat4, DMat4) {
    let world_from_camera = if transform::is_invertible(&camera_from_world) {
        camera_from_world.inverse()
    } else {
        report.error_help(
            at,
            "the transformation in force here cannot be inverted",
            "no factor of a Scale may be 0",
        );
        DMat4::IDENTITY
    };
    let mut matrix = world_from_camera;
    matrix.w_axis -= origin.extend(0.0);
    let matrix = matrix.as_mat4();
    let determinant = Mat3A::from_mat4(matrix).determinant();
    if !matrix.is_finite() || !determinant.is_finite() || determinant == 0.0 {
        // Camera rays are computed in single precision.
        report.error_help(
            at,
            format!(
                "the camera to world transformation in force here cannot be used in single precision: its \
                 determinant is {determinant}"
            ),
            "the factors of a Scale must not be so small or so large",
        );
    }
    (matrix, world_from_camera)
}

fn perspective(lookup: &mut Lookup, report: &mut Report) -> Camera {
    let plane = plane(lookup, report);
    // A positive "halffov" takes precedence over "fov", as in pbrt.
    let half = lookup.float("halffov", -1.0, report);
    let full = lookup.float("fov", plane.fov, report);
    let fov = if half > 0.0 { 2.0 * half } else { full };
    if !(fov > 0.0 && fov < 180.0) {
        let name = if half > 0.0 { "halffov" } else { "fov" };
        let place = lookup
            .find(name, &[ParamType::Float])
            .map_or(lookup.at, |param| param.value);
        report.error(
            place,
            format!("a field of view of {fov} degrees is not between 0 and 180"),
        );
    }
    Camera { fov, ..plane }
}

/// Shutter, screen window and lens, which cameras share.
fn plane(lookup: &mut Lookup, report: &mut Report) -> Camera {
    let defaults = Camera::default();
    let shutter = shutter(lookup, report);
    let screen_window = lookup.floats::<4>("screenwindow", report);
    if let Some(window @ [x0, x1, y0, y1]) = screen_window
        && (x0 == x1 || y0 == y1)
    {
        let message = format!("the screen window {window:?} is empty");
        report.error(lookup.at, message);
    }
    let aspect = [f32::MIN_POSITIVE, f32::MAX];
    let has_aspect = lookup.has("frameaspectratio");
    let frame_aspect_ratio = lookup.float_in("frameaspectratio", 1.0, aspect, report);
    Camera {
        shutter,
        screen_window,
        frame_aspect_ratio: has_aspect.then_some(frame_aspect_ratio),
        lens_radius: lookup.float_in("lensradius", 0.0, [0.0, f32::MAX], report),
        focal_distance: lookup.float_in(
            "focaldistance",
            defaults.focal_distance,
            [f32::MIN_POSITIVE, f32::MAX],
            report,
        ),
        ..defaults
    }
}

/// Times at which the shutter opens and closes.
fn shutter(lookup: &mut Lookup, report: &mut Report) -> [f32; 2] {
    let [open, close] = Camera::default().shutter;
    let mut shutter = [
        lookup.float("shutteropen", open, report),
        lookup.float("shutterclose", close, report),
    ];
    // In version 4 they were refused with the exposure.
    if shutter[1] < shutter[0] && !report.is_version4 {
        report.note(
            lookup.at,
            "the shutter closes before it opens: the times are exchanged",
        );
        shutter.reverse();
    }
    shutter
}
