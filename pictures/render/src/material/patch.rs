//! Surroundings of a point of a surface, for textures and bumps. Only materials that vary need them.

use antumbra::{Hit, Ray};
use antumbra_scene::{Geometry, Sphere, TriangleMesh};
use glam::{Vec2, Vec3};

use crate::surface::{CurvePoint, DEFAULT_UV, Placement, Shapes, Surface, corners, vertex_color};
use crate::texture::Place;

/// Change of position and normal with the surface's own coordinates u and v.
#[derive(Clone, Copy, Debug)]
pub struct Patch {
    /// Position and texture coordinates of the point, with their change between samples.
    pub place: Place,
    /// Change of the position per unit of u and v.
    pub tangents: [Vec3; 2],
    /// Tangents that bumps are built on, see [`Patch::at`].
    pub bump_tangents: [Vec3; 2],
    /// Change of the shading normal per unit of u and v.
    pub normal_changes: [Vec3; 2],
}

impl Patch {
    /// Surroundings of `surface`, the point that a ray has hit.
    ///
    /// `neighbours` are the rays of the neighbouring samples of the picture, for a ray from the camera. Textures are
    /// not filtered without them. (pbrt-v3's `path` does likewise. Its `directlighting` also knows the neighbours of
    /// rays that mirrors and glass send on.)
    ///
    /// Triangles without usable coordinates have arbitrary tangents. Spheres have u around their own z axis, and v
    /// along it.
    ///
    /// Bumps are built on the tangents of pbrt-v3. Where a mesh has normals, these are unit vectors that point
    /// *against* u and v, whatever the scale of the coordinates. Bumps of such meshes are as high, and as inside out,
    /// as there.
    pub fn at(
        shapes: &Shapes,
        surface: &Surface,
        hit: &Hit,
        neighbours: Option<&[Ray; 2]>,
    ) -> Self {
        let placement = shapes.placement(hit);
        let placement = placement.as_deref();
        let mut patch = match &shapes[surface.shape].geometry {
            Geometry::Mesh(mesh) => Self::of_triangle(mesh, placement, surface, hit),
            Geometry::Sphere(sphere) => Self::of_sphere(sphere, placement, surface),
            Geometry::Curves(curves) => {
                let curves = (surface.shape, &**curves);
                Self::of_curve(CurvePoint::new(shapes, curves, hit, surface.wo, placement))
            }
        };
        if let Some(rays) = neighbours {
            let steps = rays.each_ref().map(|ray| step(surface, ray));
            if steps.iter().all(|step| step.is_finite()) {
                let [u, v] = patch.tangents;
                patch.place.point_steps = steps;
                patch.place.uv_steps = steps.map(|step| solve(u, v, surface.normal, step));
            }
        }
        patch
    }

    fn of_triangle(
        mesh: &TriangleMesh,
        placement: Option<&Placement>,
        surface: &Surface,
        hit: &Hit,
    ) -> Self {
        let indices = mesh.indices[surface.primitive as usize];
        let [p0, p1, p2] = corners(mesh, surface.primitive);
        let uvs = if mesh.uvs.is_empty() {
            DEFAULT_UV
        } else {
            indices.map(|i| mesh.uvs[i as usize])
        };
        let (duv0, duv1) = (uvs[0] - uvs[2], uvs[1] - uvs[2]);
        let determinant = duv0.perp_dot(duv1);
        let changes = |d0: Vec3, d1: Vec3| {
            [
                (d0 * duv1.y - d1 * duv0.y) / determinant,
                (d1 * duv0.x - d0 * duv1.x) / determinant,
            ]
        };
        let mut tangents = changes(p0 - p2, p1 - p2);
        if let Some(placement) = placement {
            tangents = tangents.map(|tangent| placement.tangent(tangent));
        }
        let [u, v] = tangents;
        let usable = determinant != 0.0 && u.is_finite() && v.is_finite();
        if !usable || u.cross(v) == Vec3::ZERO {
            let (u, v) = surface.normal.any_orthonormal_pair();
            tangents = [u, v];
        }
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let (mut bump_tangents, mut normal_changes) = (tangents, [Vec3::ZERO; 2]);
        if !mesh.normals.is_empty() {
            let [n0, n1, n2] = indices.map(|i| mesh.normals[i as usize]);
            if usable {
                normal_changes = changes(n0 - n2, n1 - n2);
                if let Some(placement) = placement {
                    let normal = n0 * weights[0] + n1 * weights[1] + n2 * weights[2];
                    let placed = |change| placement.normal_change(normal, change);
                    normal_changes = normal_changes.map(placed);
                }
            }
            let normal = surface.shading_normal;
            bump_tangents = match tangents[0].cross(normal).try_normalize() {
                Some(v) => [v.cross(normal), v],
                None => normal.any_orthonormal_pair().into(),
            };
        }
        Self {
            place: Place {
                point: surface.point,
                uv: uvs[0] * weights[0] + uvs[1] * weights[1] + uvs[2] * weights[2],
                color: vertex_color(mesh, surface.primitive, weights),
                ..Place::default()
            },
            tangents,
            bump_tangents,
            normal_changes,
        }
    }

    fn of_curve(found: CurvePoint) -> Self {
        Self {
            place: Place {
                point: found.point,
                uv: found.uv,
                ..Place::default()
            },
            tangents: found.tangents,
            bump_tangents: found.tangents,
            normal_changes: [Vec3::ZERO; 2],
        }
    }

    fn of_sphere(sphere: &Sphere, placement: Option<&Placement>, surface: &Surface) -> Self {
        use std::f32::consts::{PI, TAU};
        let radius = sphere.radius;
        let point = placement.map_or(surface.point, |placement| {
            placement.object_point(surface.point)
        });
        let offset = sphere.axes.transpose() * (point - sphere.center);
        let flat = offset.truncate().length();
        // At the poles any meridian will do.
        let (cos, sin) = if flat > 0.0 {
            (offset.x / flat, offset.y / flat)
        } else {
            (1.0, 0.0)
        };
        let turn = libm::atan2f(sin, cos) / TAU;
        let height = (offset.z / radius).clamp(-1.0, 1.0);
        let flat = flat.max(radius * 1e-5);
        let tangents = [
            Vec3::new(-sin, cos, 0.0) * (flat * TAU),
            Vec3::new(-offset.z * cos, -offset.z * sin, flat) * PI,
        ];
        let mut tangents = tangents.map(|tangent| sphere.axes * tangent);
        let mut normal_changes = tangents.map(|t| t / radius);
        if let Some(placement) = placement {
            let normal = (point - sphere.center) / radius;
            normal_changes = normal_changes.map(|change| placement.normal_change(normal, change));
            tangents = tangents.map(|tangent| placement.tangent(tangent));
        }
        Self {
            place: Place {
                point: surface.point,
                uv: Vec2::new(
                    if turn < 0.0 { turn + 1.0 } else { turn },
                    1.0 - libm::acosf(height) / PI,
                ),
                ..Place::default()
            },
            tangents,
            bump_tangents: tangents,
            normal_changes,
        }
    }
}

/// Step from a surface point to the point where a ray intersects the tangent plane.
fn step(surface: &Surface, ray: &Ray) -> Vec3 {
    let (org, dir) = (Vec3::from(ray.org), Vec3::from(ray.dir));
    let distance = (surface.point - org).dot(surface.normal) / dir.dot(surface.normal);
    org + dir * distance - surface.point
}

/// Coordinates of a `step` in the plane of `u` and `v`, whose normal is `normal`. 0 if `u` and `v` are parallel.
fn solve(u: Vec3, v: Vec3, normal: Vec3, step: Vec3) -> Vec2 {
    // Projected along the axis nearest to the normal.
    let size = normal.abs();
    let flat = |w: Vec3| {
        if size.x > size.y && size.x > size.z {
            Vec2::new(w.y, w.z)
        } else if size.y > size.z {
            Vec2::new(w.x, w.z)
        } else {
            Vec2::new(w.x, w.y)
        }
    };
    let (u, v, step) = (flat(u), flat(v), flat(step));
    let found = Vec2::new(step.perp_dot(v), u.perp_dot(step)) / u.perp_dot(v);
    if found.is_finite() { found } else { Vec2::ZERO }
}

#[cfg(test)]
mod tests;
