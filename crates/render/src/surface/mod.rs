//! From a hit to the point of the surface: position with error bound, normals, material and emitter.

pub mod frame;
pub mod shapes;

use crate::surface::shapes::Shapes;
use antumbra::{Hit, Ray};
use antumbra_scene::{Geometry, Shape, TriangleMesh};
use glam::{DVec3, Vec2, Vec3};

/// A point of a surface, as shading needs it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Position in the world.
    pub point: Vec3,
    /// Bound of the position's rounding error along each axis.
    pub error: Vec3,
    /// How far from it rays should begin, see [`Shapes::clearance`].
    pub clearance: f32,
    /// The position moved away from the surface, to the side from which the ray came.
    pub origin: Vec3,
    /// Unit geometric normal. It decides what is reflection, and on which side a light emits.
    pub normal: Vec3,
    /// Unit shading normal.
    pub shading_normal: Vec3,
    /// Unit direction towards where the ray came from.
    pub wo: Vec3,
    /// Position in the scene's list of shapes.
    pub shape: usize,
    /// The instance it belongs to, as the kernel has it.
    pub inst_id: u32,
    /// Triangle of the mesh; 0 on a sphere.
    pub primitive: u32,
}

/// Half the distance between 1 and the next `f32`.
const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// Bound of the relative error of n rounded operations (Higham 2002, lemma 3.1).
pub const fn gamma(n: u32) -> f32 {
    let n = n as f32 * UNIT_ROUNDOFF;
    n / (1.0 - n)
}

impl Surface {
    /// The surface at a hit that `ray` found among `shapes`, with the vertices of the triangle hit and its
    /// [`plane_normal`]; these are ignored on a sphere.
    #[inline]
    pub fn at(shapes: &Shapes, ray: &Ray, hit: &Hit, vertices: &Vertices, plane: Vec3) -> Self {
        let index = shapes.index_of(hit);
        let shape = &shapes[index];
        let placement = shapes.placement(hit);
        let dir = Vec3::from(ray.dir);
        // First in the space of the object, if it is one.
        let (point, error, normal, shading_normal) = match &shape.geometry {
            Geometry::Mesh(_) => {
                let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
                let (point, error) = interpolate(vertices.corners, weights);
                let (normal, shading) = triangle_normals(shape, vertices, plane, weights);
                (point, error, normal, shading)
            }
            Geometry::Sphere(sphere) => {
                let org = Vec3::from(ray.org);
                let [org, dir] = placement.map_or([org, dir], |placement| placement.ray(org, dir));
                let rough = org + dir * hit.t - sphere.center;
                let outward = rough.normalize_or(-dir.normalize_or(Vec3::Z));
                let offset = outward * sphere.radius;
                let error =
                    (offset.abs() + sphere.center.abs() + Vec3::splat(sphere.radius)) * gamma(8);
                let normal = if shape.reverse_orientation {
                    -outward
                } else {
                    outward
                };
                (sphere.center + offset, error, normal, normal)
            }
        };
        let (point, error, normal, shading_normal) = match placement {
            Some(placement) => {
                let (point, error) = placement.point(point, error);
                let normals = [normal, shading_normal].map(|normal| placement.normal(normal));
                (point, error, normals[0], normals[1])
            }
            None => (point, error, normal, shading_normal),
        };
        let wo = (-dir).normalize();
        Self {
            point,
            error,
            clearance: shapes.clearance,
            origin: offset(point, error, normal, wo, shapes.clearance),
            normal,
            shading_normal,
            wo,
            shape: index,
            inst_id: hit.inst_id,
            primitive: hit.prim_id,
        }
    }

    /// The same with vertices fetched from the mesh.
    pub fn found(shapes: &Shapes, ray: &Ray, hit: &Hit) -> Self {
        let vertices = match &shapes[shapes.index_of(hit)].geometry {
            Geometry::Mesh(mesh) => Vertices::new(mesh, mesh.indices[hit.prim_id as usize]),
            Geometry::Sphere(_) => Vertices::default(),
        };
        let plane = plane_normal(vertices.corners);
        Self::at(shapes, ray, hit, &vertices, plane)
    }

    /// Whether a direction lies on the side of the geometric surface from which the ray came.
    #[inline]
    pub fn faces_same_side(&self, wi: Vec3) -> bool {
        wi.dot(self.normal) * self.wo.dot(self.normal) > 0.0
    }

    /// The geometric normal turned to the side from which the ray came.
    #[inline]
    pub fn facing_normal(&self) -> Vec3 {
        if self.normal.dot(self.wo) < 0.0 {
            -self.normal
        } else {
            self.normal
        }
    }

    /// Where a ray along `dir` starts. Nearly all rays leave on the side from which one came.
    #[inline]
    fn leave(&self, dir: Vec3) -> Vec3 {
        if (dir.dot(self.normal) < 0.0) == (self.wo.dot(self.normal) < 0.0) {
            self.origin
        } else {
            offset(self.point, self.error, self.normal, dir, self.clearance)
        }
    }

    /// A ray that leaves the surface along `dir` and does not meet it again by rounding.
    #[inline]
    pub fn ray_along(&self, dir: Vec3) -> Ray {
        Ray {
            org: self.leave(dir).to_array(),
            dir: dir.to_array(),
            tnear: 0.0,
            tfar: f32::INFINITY,
        }
    }

    /// A ray to a point; it ends just before it.
    #[inline]
    pub fn ray_to(&self, target: Vec3) -> Ray {
        segment(self.leave(target - self.point), target)
    }

    /// A ray to a point of another surface, with its error bound and normal; it ends just before it.
    #[inline]
    pub fn ray_to_surface(&self, target: Vec3, error: Vec3, normal: Vec3) -> Ray {
        let org = self.leave(target - self.point);
        let target = offset(target, error, normal, org - target, self.clearance);
        segment(org, target)
    }

    /// Direction in which the texture coordinate u grows, for materials that brush along it.
    ///
    /// Without usable texture coordinates it is that of pbrt's default ones, (0,0) (1,0) (1,1). On spheres,
    /// which keep no rotation of their own, u turns around the z axis of the world or of the object.
    pub fn tangent(&self, shapes: &Shapes) -> Vec3 {
        let placement = shapes.placement_of(self.inst_id);
        let tangent = match &shapes[self.shape].geometry {
            Geometry::Mesh(mesh) => {
                let [p0, p1, p2] = corners(mesh, self.primitive);
                let uv = match mesh.indices[self.primitive as usize] {
                    _ if mesh.uvs.is_empty() => DEFAULT_UV,
                    corners => corners.map(|i| mesh.uvs[i as usize]),
                };
                let (duv02, duv12) = (uv[0] - uv[2], uv[1] - uv[2]);
                let determinant = duv02.perp_dot(duv12);
                let tangent = ((p0 - p2) * duv12.y - (p1 - p2) * duv02.y) / determinant;
                if !(determinant != 0.0 && tangent.is_finite()) {
                    return self.shading_normal.any_orthogonal_vector();
                }
                tangent
            }
            Geometry::Sphere(_) => {
                let normal = placement.map_or(self.normal, |placement| {
                    placement.object_normal(self.normal)
                });
                Vec3::new(-normal.y, normal.x, 0.0)
            }
        };
        placement.map_or(tangent, |placement| placement.tangent(tangent))
    }
}

/// Texture coordinates of the vertices of triangles whose mesh has none, as in pbrt.
pub const DEFAULT_UV: [Vec2; 3] = [Vec2::ZERO, Vec2::X, Vec2::ONE];

/// Fraction of a segment that a shadow ray covers, as pbrt-v3's shadow epsilon has it.
const SEGMENT_SHARE: f32 = 1.0 - 0.0001;

#[inline]
fn segment(org: Vec3, target: Vec3) -> Ray {
    Ray {
        org: org.to_array(),
        dir: (target - org).to_array(),
        tnear: 0.0,
        tfar: SEGMENT_SHARE,
    }
}

/// A ray begins at most so many rounding errors from its surface: where a scene has a huge ground, what is near the
/// origin is not to lose its contact shadows.
const MAX_ERRORS: f32 = 64.0;

/// `point` moved out of its error box along the normal, to the side of `dir` (Pharr, Jakob and Humphreys
/// 2016, section 3.9.5), and as far as `clearance` if that is not too far. A normal of zero leaves it in place.
#[inline]
fn offset(point: Vec3, error: Vec3, normal: Vec3, dir: Vec3, clearance: f32) -> Vec3 {
    let least = normal.abs().dot(error);
    // The error on another axis may be the largest: a floor at height 0 has none of its own.
    let most = MAX_ERRORS * error.max_element();
    let distance = clearance.min(most).max(least);
    let step = if dir.dot(normal) < 0.0 {
        normal * -distance
    } else {
        normal * distance
    };
    let moved = point + step;
    Vec3::new(
        away(moved.x, step.x),
        away(moved.y, step.y),
        away(moved.z, step.z),
    )
}

/// `value`, or the next number after it in the direction of `step`: [`f32::next_up`] and [`f32::next_down`]
/// without a branch, since the sign of a step is anyone's guess.
#[inline]
fn away(value: f32, step: f32) -> f32 {
    let bits = value.to_bits() as i32;
    // Sign and magnitude to a number of its own: neighbours differ by one.
    let rank = if bits < 0 {
        i32::MIN.wrapping_sub(bits)
    } else {
        bits
    };
    let next = rank + i32::from(step > 0.0) - i32::from(step < 0.0);
    let bits = if next < 0 {
        i32::MIN.wrapping_sub(next)
    } else {
        next
    };
    // What is infinite or NaN has no neighbour; what need not move keeps the sign of its zero.
    if value.is_finite() && step != 0.0 {
        f32::from_bits(bits as u32)
    } else {
        value
    }
}

/// The three vertices of a triangle.
#[inline]
pub fn corners(mesh: &TriangleMesh, triangle: u32) -> [Vec3; 3] {
    mesh.indices[triangle as usize].map(|i| Vec3::from(mesh.positions[i as usize]))
}

/// What a mesh has to say about a triangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct Vertices {
    /// The three vertices.
    pub corners: [Vec3; 3],
    /// Normals at the vertices; all 0 if the mesh has none.
    pub normals: [Vec3; 3],
}

impl Vertices {
    /// The vertices of these indices.
    #[inline]
    pub fn new(mesh: &TriangleMesh, indices: [u32; 3]) -> Self {
        Self {
            corners: indices.map(|i| Vec3::from(mesh.positions[i as usize])),
            normals: if mesh.normals.is_empty() {
                [Vec3::ZERO; 3]
            } else {
                indices.map(|i| mesh.normals[i as usize])
            },
        }
    }
}

/// A point of a triangle with its error bound.
///
/// Besides the rounding of the interpolation, the bound covers that of a later intersection test with the
/// same triangle, which grows with its extent; that test has no epsilon of its own.
#[inline]
pub fn interpolate([p0, p1, p2]: [Vec3; 3], [w0, w1, w2]: [f32; 3]) -> (Vec3, Vec3) {
    let point = p0 * w0 + p1 * w1 + p2 * w2;
    let rounding = (p0 * w0).abs() + (p1 * w1).abs() + (p2 * w2).abs();
    let extent = p0.max(p1).max(p2) - p0.min(p1).min(p2);
    let error = rounding * gamma(7) + Vec3::splat(extent.max_element() * gamma(8));
    (point, error)
}

/// Unit geometric and shading normal of a triangle, whose [`plane_normal`] is `plane`, at barycentric
/// `weights`, oriented as pbrt-v3 does.
///
/// Without vertex normals both are `(p1 - p0) x (p2 - p0)`, flipped when exactly one of
/// `reverse_orientation` and a mirroring transformation is in force. With vertex normals the shading normal
/// is their interpolation, flipped by `reverse_orientation` alone, and the geometric one takes its side.
#[inline]
pub fn triangle_normals(
    shape: &Shape,
    vertices: &Vertices,
    plane: Vec3,
    weights: [f32; 3],
) -> (Vec3, Vec3) {
    let flip = shape.reverse_orientation != shape.transform_swaps_handedness;
    let normal = if flip { -plane } else { plane };
    let [n0, n1, n2] = vertices.normals;
    let mean = n0 * weights[0] + n1 * weights[1] + n2 * weights[2];
    let Some(mean) = mean.try_normalize() else {
        return (normal, normal);
    };
    let shading = if shape.reverse_orientation {
        -mean
    } else {
        mean
    };
    if normal.dot(shading) < 0.0 {
        (-normal, shading)
    } else {
        (normal, shading)
    }
}

/// The direction of `(p1 - p0) x (p2 - p0)`; any unit vector for a degenerate triangle. In double precision,
/// since thin ones cancel.
#[inline]
pub fn plane_normal(corners: [Vec3; 3]) -> Vec3 {
    let [p0, p1, p2] = corners.map(DVec3::from);
    let cross = (p1 - p0).cross(p2 - p0);
    cross.normalize_or(DVec3::Z).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra::INVALID_ID;
    use std::sync::Arc;

    fn shape(normals: Vec<Vec3>, reverse: bool, swaps: bool) -> Shape {
        Shape {
            geometry: Geometry::Mesh(Arc::new(TriangleMesh {
                positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
                indices: vec![[0, 1, 2]],
                normals,
                uvs: Vec::new(),
            })),
            material: 0,
            area_light: None,
            alpha: None,
            shadow_alpha: None,
            reverse_orientation: reverse,
            transform_swaps_handedness: swaps,
        }
    }

    fn world(shape: &Shape) -> Shapes {
        Shapes::of_world(std::slice::from_ref(shape))
    }

    fn hit(shapes: &Shapes) -> Surface {
        let ray = Ray {
            org: [0.25, 0.25, 5.0],
            dir: [0.0, 0.0, -2.0],
            tnear: 0.0,
            tfar: f32::INFINITY,
        };
        let hit = Hit {
            t: 2.5,
            u: 0.25,
            v: 0.25,
            prim_id: 0,
            geom_id: 0,
            inst_id: INVALID_ID,
        };
        Surface::found(shapes, &ray, &hit)
    }

    #[test]
    fn normals_without_vertex_normals_flip_when_exactly_one_flag_is_set() {
        for (reverse, swaps, z) in [
            (false, false, 1.0),
            (true, false, -1.0),
            (false, true, -1.0),
            (true, true, 1.0),
        ] {
            let surface = hit(&world(&shape(Vec::new(), reverse, swaps)));
            assert_eq!(surface.normal, Vec3::Z * z);
            assert_eq!(surface.shading_normal, Vec3::Z * z);
            assert_eq!(surface.wo, Vec3::Z);
            assert_eq!(surface.facing_normal(), Vec3::Z);
        }
    }

    #[test]
    fn vertex_normals_decide_the_side() {
        let tilted = Vec3::new(0.6, 0.0, -0.8);
        for (reverse, swaps, sign) in [
            (false, false, 1.0),
            (false, true, 1.0),
            (true, false, -1.0),
            (true, true, -1.0),
        ] {
            let surface = hit(&world(&shape(vec![tilted; 3], reverse, swaps)));
            assert!((surface.shading_normal - tilted * sign).length() < 1e-6);
            assert_eq!(surface.normal, -Vec3::Z * sign);
        }
        let zero = hit(&world(&shape(vec![Vec3::ZERO; 3], false, true)));
        assert_eq!(
            zero.shading_normal,
            -Vec3::Z,
            "normals of zero are no normals"
        );
    }

    #[test]
    fn neighbours_are_those_of_the_standard_library() {
        let small = f32::from_bits(1);
        for value in [0.0, small, 2.0 * small, 1.0, 1.5, 3e38, f32::MAX] {
            for value in [value, -value] {
                let bits = |value: f32| value.to_bits();
                assert_eq!(bits(away(value, 0.0)), bits(value));
                assert_eq!(away(value, 2.0), value.next_up());
                assert_eq!(away(value, -small), value.next_down());
            }
        }
        for step in [1.0, -1.0, 0.0] {
            assert_eq!(away(f32::INFINITY, step), f32::INFINITY);
            assert!(away(f32::NAN, step).is_nan());
        }
    }

    #[test]
    fn rays_leave_on_the_side_they_are_sent_to() {
        let surface = hit(&world(&shape(Vec::new(), false, false)));
        for dir in [Vec3::Z, -Vec3::Z, Vec3::new(1.0, 0.0, 1e-3)] {
            let ray = surface.ray_along(dir);
            assert!(ray.org[2] * dir.z > 0.0, "{ray:?}");
            assert!(ray.org[2].abs() < 1e-5);
        }
        let ray = surface.ray_to(Vec3::new(0.25, 0.25, 3.0));
        assert!((Vec3::from(ray.org) + Vec3::from(ray.dir)).z == 3.0 && ray.tfar < 1.0);
    }

    /// Both ends of a ray, on a floor without a rounding error of its own and on a tilted one.
    #[test]
    fn rays_begin_clear_of_the_surface_but_not_too_far_from_it() {
        let point = Vec3::new(3.0, -20.0, 0.0);
        let error = point.abs() * gamma(7);
        for normal in [Vec3::Z, Vec3::new(0.48, -0.64, 0.6)] {
            for (clearance, expected) in [
                (0.0, normal.abs().dot(error)),
                (4e-4, 4e-4),
                (1.0, MAX_ERRORS * error.max_element()),
            ] {
                for dir in [normal, -normal] {
                    let moved = offset(point, error, normal, dir, clearance) - point;
                    let distance = moved.dot(dir);
                    // Coordinates of 20 are rounded to 1e-6.
                    let difference = (distance - expected).abs();
                    assert!(difference < 4e-6, "{clearance}: {distance} {expected}");
                }
            }
        }
        let mut shapes = world(&shape(Vec::new(), false, false));
        shapes.clearance = 1e-5;
        let surface = hit(&shapes);
        let ray = surface.ray_to_surface(Vec3::new(0.5, 0.5, 2.0), Vec3::splat(1e-6), -Vec3::Z);
        let height = ray.org[2] + ray.dir[2];
        assert!((ray.org[2] - 1e-5).abs() < 1e-9, "{ray:?}");
        assert!((height - (2.0 - 1e-5)).abs() < 1e-6, "{ray:?}");
    }

    #[test]
    fn tangents_follow_texture_coordinates() {
        let mut shape = shape(Vec::new(), false, false);
        let surface = hit(&world(&shape));
        assert_eq!(surface.tangent(&world(&shape)), Vec3::X);
        if let Geometry::Mesh(mesh) = &mut shape.geometry {
            Arc::get_mut(mesh).expect("not shared").uvs = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]
                .map(glam::Vec2::from)
                .to_vec();
        }
        assert_eq!(surface.tangent(&world(&shape)), Vec3::Y);
    }
}
