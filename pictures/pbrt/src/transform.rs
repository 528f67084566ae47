//! Transformations of pbrt-v3's directives, in double precision.

use glam::{DMat3, DMat4, DVec3};

pub(crate) use antumbra_scene::transform::{
    is_invertible, point, swaps_handedness, uniform_scale, unit,
};

/// Rotation by degrees about an axis; `None` for an axis without length.
pub(crate) fn rotate([degrees, x, y, z]: [f64; 4]) -> Option<DMat4> {
    let axis = DVec3::new(x, y, z).try_normalize()?;
    Some(DMat4::from_axis_angle(axis, degrees.to_radians()))
}

/// World to camera: the eye at the origin, the target on +z, left-handed.
///
/// `None` if eye and target coincide, or if the up vector is parallel to the view.
pub(crate) fn look_at(numbers: [f64; 9]) -> Option<DMat4> {
    let [ex, ey, ez, tx, ty, tz, ux, uy, uz] = numbers;
    let eye = DVec3::new(ex, ey, ez);
    let forward = (DVec3::new(tx, ty, tz) - eye).try_normalize()?;
    let right = DVec3::new(ux, uy, uz)
        .try_normalize()?
        .cross(forward)
        .try_normalize()?;
    let up = forward.cross(right);
    // The inverse of a rotation is its transpose.
    let rotation = DMat3::from_cols(right, up, forward).transpose();
    Some(DMat4::from_mat3(rotation) * DMat4::from_translation(-eye))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(a: DVec3, b: DVec3) {
        assert!((a - b).length() < 1e-12, "{a} is not {b}");
    }

    #[test]
    fn a_quarter_turn_about_z_takes_x_to_y() {
        let m = rotate([90.0, 0.0, 0.0, 2.0]).unwrap();
        assert_near(point(&m, DVec3::X), DVec3::Y);
        assert_near(point(&m, DVec3::Y), -DVec3::X);
        assert_near(point(&m, DVec3::Z), DVec3::Z);
        assert_eq!(rotate([90.0, 0.0, 0.0, 0.0]), None);
    }

    #[test]
    fn a_third_turn_about_the_diagonal_permutes_the_axes() {
        let m = rotate([120.0, 1.0, 1.0, 1.0]).unwrap();
        assert_near(point(&m, DVec3::X), DVec3::Y);
        assert_near(point(&m, DVec3::Y), DVec3::Z);
        assert_near(point(&m, DVec3::Z), DVec3::X);
    }

    #[test]
    fn look_at_by_hand() {
        // From (0, -10, 2) along +y with z up. pbrt's camera space is left-handed: right is
        // up × forward = z × y = -x.
        let m = look_at([0.0, -10.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 5.0]).unwrap();
        assert_near(point(&m, DVec3::new(0.0, -10.0, 2.0)), DVec3::ZERO);
        assert_near(
            point(&m, DVec3::new(0.0, 0.0, 2.0)),
            DVec3::new(0.0, 0.0, 10.0),
        );
        assert_near(
            point(&m, DVec3::new(1.0, -10.0, 2.0)),
            DVec3::new(-1.0, 0.0, 0.0),
        );
        assert_near(point(&m, DVec3::new(0.0, -10.0, 3.0)), DVec3::Y);
        assert_eq!(look_at([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]), None);
        assert_eq!(look_at([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0]), None);
    }
}
