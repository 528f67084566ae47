//! Transformation of points, normals and orientation, in double precision.
//!
//! Readers use these functions to bring shapes to world space, and [`flatten`](crate::flatten) to place instances.

use glam::{DMat3, DMat4, DVec3, DVec4, Vec3};

/// Transforms a point, with perspective division where w is not 1. Not finite if w is 0.
pub fn point(matrix: &DMat4, p: DVec3) -> DVec3 {
    let transformed = *matrix * DVec4::from((p, 1.0));
    let position = transformed.truncate();
    if transformed.w == 1.0 {
        position
    } else {
        position / transformed.w
    }
}

/// Returns true if a matrix has a finite inverse; false for a matrix that is not finite.
pub fn is_invertible(matrix: &DMat4) -> bool {
    let inverse = matrix.inverse();
    matrix.is_finite() && matrix.determinant() != 0.0 && inverse.is_finite()
}

/// Returns true if a matrix contains a reflection (`SwapsHandedness` of pbrt); false for NaN.
pub fn swaps_handedness(matrix: &DMat4) -> bool {
    DMat3::from_mat4(*matrix).determinant() < 0.0
}

/// Uniform scale of a matrix; `None` for a matrix with NaN or with shear, projection or a non-uniform scale.
///
/// Rotation, reflection and translation are allowed.
pub fn uniform_scale(matrix: &DMat4) -> Option<f64> {
    // Scene files contain matrices rounded to six digits.
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

/// Matrix that transforms normals: the inverse transpose. Not finite if `matrix` is singular.
pub fn of_normals(matrix: &DMat4) -> DMat3 {
    DMat3::from_mat4(*matrix).inverse().transpose()
}

/// Scales a normal to unit length. Zero vectors and vectors that are not finite are returned unchanged.
pub fn unit(normal: DVec3) -> Vec3 {
    normal.try_normalize().unwrap_or(normal).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uniform_scales_are_told_from_others() {
        let m = DMat4::from_scale(DVec3::new(-3.0, 3.0, 3.0))
            * DMat4::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.6);
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
        assert_eq!(
            point(&m, DVec3::new(2.0, 4.0, 6.0)),
            DVec3::new(1.0, 2.0, 3.0)
        );
    }
}
