//! Cameras and lights, placed by nodes.

use antumbra_scene::{Camera, Light, Rgb};
use glam::{Mat3, Mat4, Vec3};
use gltf::camera::Projection;
use gltf::khr_lights_punctual::{Kind, Light as Punctual};

use crate::{Model, View};

/// Keeps the first perspective camera of a file.
pub(super) fn add_camera(camera: &gltf::Camera, to_world: Mat4, model: &mut Model) {
    let Projection::Perspective(lens) = camera.projection() else {
        model.note("orthographic cameras are not supported and are left out");
        return;
    };
    if model.camera.is_some() {
        model.note("the file has several cameras; the first is used");
        return;
    }
    let (yfov, aspect_ratio) = (lens.yfov(), lens.aspect_ratio());
    // The angle of a scene's camera is that of the shorter side.
    let half = f64::from(yfov) / 2.0;
    let half = match aspect_ratio.filter(|&aspect| aspect > 0.0 && aspect < 1.0) {
        Some(aspect) => libm::atan(libm::tan(half) * f64::from(aspect)),
        None => half,
    };
    let axes = Mat3::from_mat4(to_world);
    let unit = |axis: Vec3| axis.normalize_or_zero();
    // Cameras look along -z. Scales of nodes do not matter.
    let matrix = Mat4::from_cols(
        unit(axes.x_axis).extend(0.0),
        unit(axes.y_axis).extend(0.0),
        unit(-axes.z_axis).extend(0.0),
        to_world.w_axis,
    );
    let fov = (2.0 * half).to_degrees() as f32;
    if !(matrix.is_finite() && matrix.determinant() != 0.0 && fov > 0.0 && fov < 180.0) {
        model.note("a camera that sees nothing is left out");
        return;
    }
    model.camera = Some(View {
        camera: Camera {
            world_from_camera: matrix,
            fov,
            ..Camera::default()
        },
        aspect_ratio: aspect_ratio.filter(|aspect| aspect.is_finite() && *aspect > 0.0),
    });
}

/// Adds a light. Lux, candela and nit are taken for the units of radiance.
pub(super) fn add_light(light: &Punctual, to_world: Mat4, model: &mut Model) {
    let color = Rgb::from(light.color()) * light.intensity();
    let position = to_world.transform_point3(Vec3::ZERO);
    let back = to_world.transform_vector3(Vec3::Z).normalize_or_zero();
    if light.range().is_some() {
        model.note("ranges of lights are left out: light falls off with the squared distance");
    }
    if !(color.is_finite() && position.is_finite() && back.is_finite()) || back == Vec3::ZERO {
        model.note("a light that is not finite is left out");
        return;
    }
    model.lights.push(match light.kind() {
        Kind::Directional => Light::Distant {
            to_light: back,
            radiance: color,
        },
        Kind::Point => Light::Point {
            position,
            intensity: color,
        },
        Kind::Spot {
            inner_cone_angle,
            outer_cone_angle,
        } => {
            let outer = libm::cosf(outer_cone_angle);
            Light::Spot {
                position,
                axis: -back,
                intensity: color,
                cos_total_width: outer,
                cos_falloff_start: libm::cosf(inner_cone_angle).max(outer),
            }
        }
    });
}
