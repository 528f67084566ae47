//! Vectors of three numbers.

use antumbra::Bvh;

/// Scalar product.
pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector scaled to length 1; `None` if it is 0 or not finite.
///
/// Made for vectors whose squares are in the range of `f64`, such as all of `f32`.
pub(crate) fn unit(vector: [f64; 3]) -> Option<[f64; 3]> {
    // Scaled first, because areas of huge or tiny triangles have squares beyond `f64`.
    let largest = vector.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    if !(largest > 0.0) || !vector.iter().all(|x| x.is_finite()) {
        return None;
    }
    let scaled = vector.map(|x| x / largest);
    let length = scaled.iter().map(|x| x * x).sum::<f64>().sqrt();
    Some(scaled.map(|x| x / length))
}

/// Difference of two vectors.
pub(crate) fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

/// Difference of two points.
pub(crate) fn less(a: &[f32; 3], b: &[f32; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| f64::from(a[axis]) - f64::from(b[axis]))
}

/// Cross product.
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// The point moved by its origin offset along its normal of length 1.
pub(crate) fn above(bvh: &Bvh, point: &[f32; 3], normal: [f64; 3]) -> [f32; 3] {
    moved(point, bvh.origin_offset(*point), normal)
}

/// The point moved along its normal of length 1.
pub(crate) fn moved(point: &[f32; 3], offset: f32, normal: [f64; 3]) -> [f32; 3] {
    std::array::from_fn(|axis| (f64::from(point[axis]) + f64::from(offset) * normal[axis]) as f32)
}
