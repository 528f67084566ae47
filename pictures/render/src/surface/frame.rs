//! Directions at a surface: orthonormal frames, reflection and refraction.

use glam::Vec3;

/// An orthonormal frame whose z axis is a surface normal.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    x: Vec3,
    y: Vec3,
    z: Vec3,
}

impl Frame {
    /// Some frame around the unit vector `z` (Duff et al. 2017, *Building an Orthonormal Basis, Revisited*).
    #[inline]
    pub fn around(z: Vec3) -> Self {
        let sign = if z.z < 0.0 { -1.0 } else { 1.0 };
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        Self {
            x: Vec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x),
            y: Vec3::new(b, sign + z.y * z.y * a, -z.y),
            z,
        }
    }

    /// Frame around the unit vector `z` whose x axis lies closest to `tangent`. Some frame if the two are parallel.
    #[inline]
    pub fn along(z: Vec3, tangent: Vec3) -> Self {
        let y = z.cross(tangent);
        if y.length_squared() > 0.0 {
            let y = y.normalize();
            Self {
                x: y.cross(z),
                y,
                z,
            }
        } else {
            Self::around(z)
        }
    }

    /// Frame of these axes, which must be orthonormal.
    #[inline(always)]
    pub fn of_axes([x, y, z]: [Vec3; 3]) -> Self {
        Self { x, y, z }
    }

    /// Axes x, y and z of the frame in world space.
    #[inline(always)]
    pub fn axes(self) -> [Vec3; 3] {
        [self.x, self.y, self.z]
    }

    /// Coordinates of a world vector in the frame.
    #[inline]
    pub fn to_local(self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// World vector of coordinates in the frame.
    #[inline]
    pub fn to_world(self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

/// `v` mirrored about the unit vector `n`. Both point away from the surface.
pub fn reflect(v: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * v.dot(n)) - v
}

/// `v` bent by Snell's law at a surface with unit normal `n` on the side of `v`.
///
/// `eta` is the index of refraction on the side of `v` over that on the other side. `None` is total
/// internal reflection.
pub fn refract(v: Vec3, n: Vec3, eta: f32) -> Option<Vec3> {
    let cos_i = n.dot(v);
    let sin2_t = eta * eta * (1.0 - cos_i * cos_i).max(0.0);
    if sin2_t >= 1.0 {
        return None;
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    Some(n * (eta * cos_i - cos_t) - v * eta)
}

/// Whether both directions leave the local surface on the same side.
#[inline]
pub fn same_hemisphere(a: Vec3, b: Vec3) -> bool {
    a.z * b.z > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::warp::{uniform_hemisphere, uniform_sphere};
    use crate::sampler::{Method, Sampler};

    fn points(count: u32) -> impl Iterator<Item = [f32; 2]> {
        let sampler = Sampler::new(Method::OwenSobol, 11);
        (0..count).map(move |i| sampler.stream(0, 0, i).pair(0))
    }

    #[test]
    fn frames_are_orthonormal_and_right_handed() {
        for u in points(1000) {
            let z = uniform_sphere(u);
            for frame in [Frame::around(z), Frame::along(z, Vec3::new(0.3, -2.0, 0.7))] {
                let Frame { x, y, z } = frame;
                assert!((x.cross(y) - z).length() < 1e-5, "{frame:?}");
                assert!((y.cross(z) - x).length() < 1e-5, "{frame:?}");
                let v = Vec3::new(0.3, 0.8, -0.4);
                assert!((frame.to_world(frame.to_local(v)) - v).length() < 1e-5);
            }
        }
        assert_eq!(
            Frame::along(Vec3::Z, Vec3::Z).to_world(Vec3::Z),
            Vec3::Z,
            "a parallel tangent falls back to any frame"
        );
    }

    #[test]
    fn refraction_obeys_snell_and_is_reversible() {
        let n = Vec3::Z;
        for u in points(200) {
            let v = uniform_hemisphere(u);
            let Some(t) = refract(v, n, 1.0 / 1.5) else {
                panic!("no total reflection when entering");
            };
            let (sin_i, sin_t) = (v.truncate().length(), t.truncate().length());
            assert!((sin_i - 1.5 * sin_t).abs() < 1e-5);
            assert!((t.length() - 1.0).abs() < 1e-5 && t.z < 0.0);
            if v.z > 1e-3 {
                let back = refract(t, -n, 1.5).expect("the way back exists");
                assert!((back - v).length() < 1e-2, "{back} {v}");
            }
        }
        assert!(refract(Vec3::new(0.8, 0.0, 0.6), n, 1.5).is_none());
    }
}
