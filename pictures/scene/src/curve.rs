//! Thin curves, such as hairs, fur and grass.

use glam::{DMat3, DMat4, DVec3};
use serde::Serialize;

use crate::transform;

/// Cubic Bézier curves whose radius changes along them.
///
/// Curves are flat and face every ray, as the flat and cylindrical curves of pbrt-v3 do. `u` of a curve goes from 0 at its
/// first control point to 1 at its last one, and `v` from 0 to 1 across it.
///
/// Readers guarantee that every index is followed by three more points, and that radii are at least 0. Points may be NaN or
/// infinite: the kernel drops such segments and counts them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Curves {
    /// Control points with radii, `[points, 4]`: x, y, z, radius.
    #[serde(serialize_with = "crate::raw")]
    pub points: Vec<[f32; 4]>,
    /// First of the four control points of each curve, `[curves]`. A curve that begins at the last control point of the curve
    /// before it goes on there without a gap.
    #[serde(serialize_with = "crate::raw")]
    pub first: Vec<u32>,
    /// Direction of the normals.
    pub profile: CurveProfile,
}

/// Direction of the normals across a curve, as pbrt-v3 has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum CurveProfile {
    /// Normals are parallel to the ray, as seen along the curve.
    #[default]
    Flat,
    /// Normals turn by half a circle from one side of the curve to the other.
    Round,
}

impl Curves {
    /// The four control points of a curve.
    pub fn control(&self, curve: u32) -> [[f32; 4]; 4] {
        let first = self.first[curve as usize] as usize;
        std::array::from_fn(|i| self.points[first + i])
    }

    /// Adds curves of the same profile.
    pub fn append(&mut self, more: &Self) {
        let offset = self.points.len() as u32;
        self.points.extend_from_slice(&more.points);
        self.first.extend(more.first.iter().map(|i| i + offset));
    }

    /// Size of the lists in bytes.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.points[..]) + size_of_val(&self.first[..])) as u64
    }

    /// Transforms the curves in place, in double precision.
    ///
    /// A matrix that scales differently by axis would make cross-sections elliptical. They stay round, with the same area.
    pub fn transform(&mut self, matrix: &DMat4) {
        if *matrix == DMat4::IDENTITY {
            return;
        }
        match transform::uniform_scale(matrix) {
            Some(scale) => {
                for [.., radius] in &mut self.points {
                    *radius = (f64::from(*radius) * scale) as f32;
                }
            }
            None => self.stretch(&DMat3::from_mat4(*matrix)),
        }
        for [x, y, z, _] in &mut self.points {
            let moved = transform::point(matrix, DVec3::from([*x, *y, *z].map(f64::from)));
            [*x, *y, *z] = moved.as_vec3().into();
        }
    }

    /// Scales the radii of curves that `linear` will transform. What lengths along the curve do not take of the change of
    /// volumes is left for the area of the cross-section.
    fn stretch(&mut self, linear: &DMat3) {
        let volume = linear.determinant().abs();
        let mut radii: Vec<f32> = self.points.iter().map(|[.., radius]| *radius).collect();
        for curve in 0..self.first.len() {
            let first = self.first[curve] as usize;
            let point = |i: usize| {
                let [x, y, z, _] = self.points[first + i];
                DVec3::new(x.into(), y.into(), z.into())
            };
            for i in 0..4_usize {
                let along = point((i + 1).min(3)) - point(i.saturating_sub(1));
                let length = (linear * along.normalize_or_zero()).length();
                let scale = match length > 0.0 {
                    true => (volume / length).sqrt(),
                    false => volume.cbrt(),
                };
                let [.., radius] = self.points[first + i];
                radii[first + i] = (f64::from(radius) * scale) as f32;
            }
        }
        for ([.., radius], scaled) in self.points.iter_mut().zip(radii) {
            *radius = scaled;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hair along x, with its radius.
    fn hair(radius: f32) -> Curves {
        Curves {
            points: (0..4).map(|i| [i as f32, 1.0, 2.0, radius]).collect(),
            first: vec![0],
            profile: CurveProfile::Flat,
        }
    }

    #[test]
    fn cross_sections_keep_the_scale_of_their_area() {
        let radius = |scale: DVec3| {
            let mut hair = hair(0.5);
            let turn = DMat4::from_rotation_z(0.7);
            hair.transform(&(turn * DMat4::from_scale(scale)));
            let [x, y, _, radius] = hair.points[3];
            let expected = turn.transform_point3(scale * DVec3::new(3.0, 1.0, 2.0));
            assert!((DVec3::new(x.into(), y.into(), expected.z) - expected).length() < 1e-6);
            radius
        };
        assert_eq!(radius(DVec3::splat(-3.0)), 1.5);
        assert!((radius(DVec3::new(9.0, 1.0, 1.0)) - 0.5).abs() < 1e-6);
        assert!((radius(DVec3::new(9.0, 4.0, 1.0)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn curves_that_are_added_keep_their_points() {
        let mut curves = hair(1.0);
        let mut more = hair(2.0);
        more.append(&hair(3.0));
        curves.append(&more);
        assert_eq!(curves.first, [0, 4, 8]);
        assert_eq!(
            curves.control(2),
            [0, 1, 2, 3].map(|i| [i as f32, 1.0, 2.0, 3.0])
        );
        assert_eq!(curves.bytes(), 12 * 16 + 12);
    }
}
