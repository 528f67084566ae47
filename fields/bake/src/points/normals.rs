//! Normals of vertices from the triangles around them.

use crate::vector::{cross, less, unit};

/// Normal of every vertex, `[n, 3]`: the mean of the normals of its triangles, weighted by area, of length 1.
///
/// Corners of a triangle turn counter-clockwise around its normal. A vertex has the normal 0 if it is in no triangle of
/// some area, or if the normals of its triangles cancel. Triangles with an index beyond the positions or with a
/// coordinate that is not finite are left out.
///
/// Vertices at the same place do not share triangles: a mesh whose vertices are split has a crease there.
pub fn vertex_normals(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Vec<[f32; 3]> {
    let mut sums = vec![[0.0_f64; 3]; positions.len()];
    for corners in indices {
        let corners = corners.map(|index| index as usize);
        let [Some(a), Some(b), Some(c)] = corners.map(|index| positions.get(index)) else {
            continue;
        };
        let area = cross(less(b, a), less(c, a));
        if area.iter().all(|x| x.is_finite()) {
            for index in corners {
                let sum = &mut sums[index];
                *sum = std::array::from_fn(|axis| sum[axis] + area[axis]);
            }
        }
    }
    let unit = |sum: [f64; 3]| unit(sum).unwrap_or_default();
    sums.into_iter()
        .map(|sum| unit(sum).map(|x| x as f32))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_triangles_weigh_more() {
        // Two triangles share the x axis: one of area 3/2 faces z, one of area 1/2 faces -y.
        let positions = [
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 3.0, 0.0],
            [0.0, 0.0, 1.0],
            [9.0, 9.0, 9.0],
        ];
        let normals = vertex_normals(&positions, &[[0, 1, 2], [0, 1, 3], [0, 1, 77]]);
        assert_eq!(normals[2], [0.0, 0.0, 1.0]);
        assert_eq!(normals[3], [0.0, -1.0, 0.0]);
        let expected = [0.0, -1.0 / 10.0_f32.sqrt(), 3.0 / 10.0_f32.sqrt()];
        for (found, expected) in normals[0].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{normals:?}");
        }
        assert_eq!(normals[4], [0.0; 3], "in no triangle");
    }

    #[test]
    fn sizes_do_not_matter_and_bad_triangles_are_left_out() {
        for size in [1e-30_f32, 1.0, 1e30] {
            let mut positions = vec![[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0]];
            positions.push([f32::NAN, 0.0, 0.0]);
            let normals = vertex_normals(&positions, &[[0, 1, 2], [0, 1, 3], [1, 1, 2]]);
            assert_eq!(normals[..3], [[0.0, 0.0, 1.0]; 3], "{size}");
            assert_eq!(normals[3], [0.0; 3]);
        }
    }
}
