//! Transformations as pbrt-v3 defines them, computed in double precision.

use glam::{DMat3, DMat4, DVec3, DVec4};

/// Rotation by degrees about an axis; `None` for an axis without length.
pub(crate) fn rotate([degrees, x, y, z]: [f64; 4]) -> Option<DMat4> {
    let axis = DVec3::new(x, y, z).try_normalize()?;
    Some(DMat4::from_axis_angle(axis, degrees.to_radians()))
}

/// World to camera: the eye at the origin, the target on +z, left-handed. `None` when eye and target
/// coincide or the up vector is parallel to the view.
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

/// Transforms a point, dividing by w where the matrix asks for it.
pub(crate) fn point(matrix: &DMat4, p: DVec3) -> DVec3 {
    let transformed = *matrix * DVec4::from((p, 1.0));
    let position = transformed.truncate();
    if transformed.w == 1.0 {
        position
    } else {
        position / transformed.w
    }
}

/// Whether a matrix has an inverse that can be used.
pub(crate) fn is_invertible(matrix: &DMat4) -> bool {
    let inverse = matrix.inverse();
    matrix.is_finite() && matrix.determinant() != 0.0 && inverse.is_finite()
}

/// Whether it mirrors: pbrt's `SwapsHandedness`.
pub(crate) fn swaps_handedness(matrix: &DMat4) -> bool {
    DMat3::from_mat4(*matrix).determinant() < 0.0
}

/// The scale of a matrix made of rotation, mirroring, translation and the same scale along every axis;
/// `None` for any other.
pub(crate) fn uniform_scale(matrix: &DMat4) -> Option<f64> {
    // Scenes carry matrices rounded to six digits.
    const TOLERANCE: f64 = 1e-4;
    let m = DMat3::from_mat4(*matrix);
    let lengths = [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()];
    let scale = lengths.iter().sum::<f64>() / 3.0;
    let is_even = lengths
        .iter()
        .all(|l| (l - scale).abs() <= TOLERANCE * scale);
    let skews = [
        m.x_axis.dot(m.y_axis),
        m.y_axis.dot(m.z_axis),
        m.z_axis.dot(m.x_axis),
    ];
    let is_square = skews.iter().all(|s| s.abs() <= TOLERANCE * scale * scale);
    let is_affine = matrix.row(3) == DVec4::W;
    (scale > 0.0 && is_even && is_square && is_affine).then_some(scale)
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

    #[test]
    fn uniform_scales_are_told_from_others() {
        let m =
            DMat4::from_scale(DVec3::new(-3.0, 3.0, 3.0)) * rotate([33.0, 1.0, 2.0, 3.0]).unwrap();
        assert!((uniform_scale(&m).unwrap() - 3.0).abs() < 1e-9);
        assert!(swaps_handedness(&m));
        assert_eq!(
            uniform_scale(&DMat4::from_scale(DVec3::new(1.0, 2.0, 1.0))),
            None
        );
        assert_eq!(uniform_scale(&DMat4::ZERO), None);
        assert!(!is_invertible(&DMat4::from_scale(DVec3::new(
            1.0, 0.0, 1.0
        ))));
    }

    #[test]
    fn points_are_divided_by_w() {
        let m = DMat4::from_cols_array(&[
            1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 2.0,
        ]);
        assert_near(
            point(&m, DVec3::new(2.0, 4.0, 6.0)),
            DVec3::new(1.0, 2.0, 3.0),
        );
    }
}
