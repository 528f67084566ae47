//! A point of a surface, and the rays that leave it.

use antumbra::{Hit, Isa, Ray};
use antumbra_scene::{Geometry, Shape, Sphere};
use glam::Vec3;

use super::block::SurfaceBlock;
use super::curve::tangent_near;
use super::origin_offset::{self, Room, offset, offset_distance, segment};
use super::shapes::{Placement, Shapes};
use super::triangle::{DEFAULT_UV, corners, gamma, inset};

/// A point of a surface, as shading needs it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Position in the world.
    pub point: Vec3,
    /// Point of the surface above which rays begin: the position, unless that is too close to an edge.
    pub start: Vec3,
    /// Distance from `start` at which rays begin.
    pub distance: f32,
    /// Largest origin offset of rays, see [`Shapes::origin_offset`].
    pub origin_offset: f32,
    /// Beginning of rays on the side from which the ray came.
    pub origin: Vec3,
    /// Unit geometric normal. Decides between reflection and transmission, and on which side a light emits.
    pub normal: Vec3,
    /// Unit shading normal.
    pub shading_normal: Vec3,
    /// Unit direction towards where the ray came from.
    pub wo: Vec3,
    /// Position in the scene's list of shapes.
    pub shape: usize,
    /// Instance of the kernel that was hit.
    pub inst_id: u32,
    /// Triangle of the mesh, or segment of the curves. 0 on a sphere.
    pub primitive: u32,
}

impl Surface {
    /// Surface at a hit that `ray` found among `shapes`: a block of one hit, see [`SurfaceBlock`].
    pub fn found(shapes: &Shapes, ray: &Ray, hit: &Hit) -> Self {
        let mut block = Box::<SurfaceBlock>::default();
        block.compute(Isa::best(), shapes, &[*ray], &[Some(*hit)], &[0]);
        block.surface(0)
    }

    /// Whether a direction lies on the side of the geometric surface from which the ray came.
    #[inline]
    pub fn faces_same_side(&self, wi: Vec3) -> bool {
        wi.dot(self.normal) * self.wo.dot(self.normal) > 0.0
    }

    /// Geometric normal, turned to the side from which the ray came.
    #[inline]
    pub fn facing_normal(&self) -> Vec3 {
        self.facing(self.normal)
    }

    /// A normal, turned to the side from which the ray came.
    #[inline]
    pub fn facing(&self, normal: Vec3) -> Vec3 {
        if normal.dot(self.wo) < 0.0 {
            -normal
        } else {
            normal
        }
    }

    /// Start of a ray along `dir`, without a branch, for loops in vectors.
    #[inline(always)]
    pub fn leave_in_columns(&self, dir: Vec3) -> Vec3 {
        let points = [self.start, self.origin];
        origin_offset::leave(points, [self.normal, self.wo], self.distance, dir)
    }

    /// Start of a ray along `dir`. Nearly all rays leave on the side from which the ray came.
    #[inline]
    fn leave(&self, dir: Vec3) -> Vec3 {
        if (dir.dot(self.normal) < 0.0) == (self.wo.dot(self.normal) < 0.0) {
            self.origin
        } else {
            offset(self.start, self.normal, self.distance, dir)
        }
    }

    /// Unbounded ray that leaves the surface along `dir`.
    #[inline]
    pub fn ray_along(&self, dir: Vec3) -> Ray {
        Ray {
            org: self.leave(dir).to_array(),
            dir: dir.to_array(),
            tnear: 0.0,
            tfar: f32::INFINITY,
        }
    }

    /// Ray to a point, just before which it ends.
    #[inline]
    pub fn ray_to(&self, target: Vec3) -> Ray {
        segment(self.leave(target - self.point), target)
    }

    /// Ray to a point of another surface, with error bound and normal. The ray ends just before that surface.
    #[inline]
    pub fn ray_to_surface(&self, target: Vec3, error: Vec3, normal: Vec3) -> Ray {
        let org = self.leave(target - self.point);
        let distance = offset_distance(error, normal, self.origin_offset, Room::OPEN);
        let target = offset(target, normal, distance, org - target);
        segment(org, target)
    }

    /// Direction in which the texture coordinate u grows, for materials that brush along it.
    ///
    /// Meshes without usable texture coordinates have pbrt's default ones, (0,0) (1,0) (1,1). On spheres u turns around
    /// their own z axis.
    pub fn tangent(&self, shapes: &Shapes) -> Vec3 {
        let placement = shapes.placement_of(self.inst_id);
        let placement = placement.as_deref();
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
            Geometry::Sphere(sphere) => {
                let normal = placement.map_or(self.normal, |placement| {
                    placement.object_normal(self.normal)
                });
                let own = sphere.axes.transpose() * normal;
                sphere.axes * Vec3::new(-own.y, own.x, 0.0)
            }
            Geometry::Curves(curves) => {
                let point = placement.map_or(self.point, |to| to.object_point(self.point));
                tangent_near(shapes, (self.shape, curves), self.primitive, point)
            }
        };
        placement.map_or(tangent, |placement| placement.tangent(tangent))
    }
}

/// Point of a sphere at a hit, its error bound and its normal, in the space of the object if there is one.
pub(super) fn on_sphere(
    shape: &Shape,
    sphere: &Sphere,
    placement: Option<&Placement>,
    ray: &Ray,
    hit: &Hit,
) -> (Vec3, Vec3, Vec3) {
    let (org, dir) = (Vec3::from(ray.org), Vec3::from(ray.dir));
    let [org, dir] = placement.map_or([org, dir], |placement| placement.ray(org, dir));
    let rough = org + dir * hit.t - sphere.center;
    let outward = rough.normalize_or(-dir.normalize_or(Vec3::Z));
    let offset = outward * sphere.radius;
    let error = (offset.abs() + sphere.center.abs() + Vec3::splat(sphere.radius)) * gamma(8);
    let normal = if shape.reverse_orientation {
        -outward
    } else {
        outward
    };
    (sphere.center + offset, error, normal)
}

/// Point of the world at which rays begin whose own point is too close to an edge, and its distance from the edges.
/// Arguments as for [`inset`], in the space of the object.
pub(super) fn start_inside(
    corners: [Vec3; 3],
    weights: [f32; 3],
    distance: f32,
    wanted: f32,
    placement: Option<&Placement>,
) -> (Vec3, f32) {
    let (moved, edge) = inset(corners, weights, distance, wanted);
    let moved = placement.map_or(moved, |placement| placement.point(moved, Vec3::ZERO).0);
    (moved, edge)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use antumbra::INVALID_ID;
    use antumbra_scene::TriangleMesh;

    use crate::surface::origin_offset::MAX_ERRORS;

    fn shape(normals: Vec<Vec3>, reverse: bool, swaps: bool) -> Shape {
        Shape {
            geometry: Geometry::Mesh(Arc::new(TriangleMesh {
                positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
                indices: vec![[0, 1, 2]],
                normals,
                uvs: Vec::new(),
                colors: Vec::new(),
            })),
            material: 0,
            area_light: None,
            media: None,
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
            for (origin_offset, expected) in [
                (0.0, normal.abs().dot(error)),
                (4e-4, 4e-4),
                (1.0, MAX_ERRORS * error.max_element()),
            ] {
                for dir in [normal, -normal] {
                    let distance = offset_distance(error, normal, origin_offset, Room::OPEN);
                    let moved = offset(point, normal, distance, dir) - point;
                    let distance = moved.dot(dir);
                    // Coordinates of 20 are rounded to 1e-6.
                    let difference = (distance - expected).abs();
                    assert!(difference < 4e-6, "{origin_offset}: {distance} {expected}");
                }
            }
        }
        let mut shapes = world(&shape(Vec::new(), false, false));
        shapes.origin_offset = 1e-5;
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

    /// At the top of a ball that is turned so that its poles are on the y axis.
    #[test]
    fn tangents_turn_with_spheres() {
        let mut shape = shape(Vec::new(), false, false);
        let ball = antumbra_scene::Sphere::new(Vec3::new(0.25, 0.25, -1.0), 1.0);
        for (quarters, along) in [(0, Vec3::ZERO), (1, -Vec3::X), (3, Vec3::X)] {
            let turn =
                glam::DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2 * f64::from(quarters));
            let turned = ball.transformed(&turn).expect("a ball");
            let (center, radius) = (ball.center, ball.radius);
            shape.geometry = Geometry::Sphere(antumbra_scene::Sphere {
                center,
                radius,
                ..turned
            });
            let shapes = world(&shape);
            let tangent = hit(&shapes).tangent(&shapes);
            assert!((tangent - along).length() < 1e-6, "{quarters}: {tangent}");
        }
    }
}
