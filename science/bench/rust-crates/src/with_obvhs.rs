//! The three programs with `obvhs`, its wide compressed tree.

use std::time::Duration;

use glam::{Mat4, Vec3A, Vec4, vec3a};
use obvhs::aabb::Aabb;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::{build_cwbvh, build_cwbvh_from_tris};
use obvhs::ray::{Ray as ObvhsRay, RayHit};
use obvhs::triangle::Triangle;
use obvhs::{Boundable, BvhBuildParams};

use crate::input::{LIGHT, Mesh, Ray};
use crate::{Found, Timed};

/// Triangles in the order of the leaves, and the tree.
struct Tree {
    triangles: Vec<Triangle>,
    bvh: CwBvh,
}

fn build(mesh: &Mesh) -> Tree {
    let triangles: Vec<Triangle> = (0..mesh.indices.len())
        .map(|triangle| {
            let [v0, v1, v2] = mesh.corners(triangle).map(Vec3A::from);
            Triangle { v0, v1, v2 }
        })
        .collect();
    let bvh = build_cwbvh_from_tris(
        &triangles,
        BvhBuildParams::medium_build(),
        &mut Duration::default(),
    );
    let places = bvh.primitive_indices.iter();
    Tree {
        triangles: places.map(|index| triangles[*index as usize]).collect(),
        bvh,
    }
}

impl Tree {
    fn occluded(&self, ray: ObvhsRay) -> bool {
        !self
            .bvh
            .ray_traverse_miss(ray, |ray, id| self.triangles[id].intersect(ray))
    }

    fn distance(&self, ray: ObvhsRay) -> f32 {
        let mut hit = RayHit::none();
        self.bvh
            .ray_traverse(ray, &mut hit, |ray, id| self.triangles[id].intersect(ray));
        hit.t
    }
}

fn ray(ray: &Ray) -> ObvhsRay {
    ObvhsRay::new(ray.origin.into(), ray.dir.into(), ray.near, ray.far)
}

// baker
pub fn bake(mesh: &Mesh, rays: &[Ray], timed: &mut Timed) -> Found {
    let tree = timed.build(|| build(mesh));
    timed.trace(|| Found::of(rays.iter().map(|r| tree.occluded(ray(r))).collect()))
}

// visibility
pub fn see(mesh: &Mesh, points: &[[f32; 3]], timed: &mut Timed) -> Found {
    let tree = timed.build(|| build(mesh));
    timed.trace(|| {
        let mut occluded = Vec::with_capacity(points.len() * points.len() / 2);
        for (index, &from) in points.iter().enumerate() {
            let from = Vec3A::from(from);
            for &to in &points[..index] {
                // The interval is closed at both ends.
                let ray = ObvhsRay::new(
                    from,
                    Vec3A::from(to) - from,
                    f32::MIN_POSITIVE,
                    1.0f32.next_down(),
                );
                occluded.push(tree.occluded(ray));
            }
        }
        Found::of(occluded)
    })
}

// instances
struct Placed {
    bounds: Aabb,
    to_object: Mat4,
}

impl Boundable for Placed {
    fn aabb(&self) -> Aabb {
        self.bounds
    }
}

struct World {
    torus: Tree,
    placed: Vec<Placed>,
    bvh: CwBvh,
}

impl World {
    fn new(mesh: &Mesh, places: &[[[f32; 4]; 3]]) -> Self {
        let torus = build(mesh);
        let own = torus.bvh.total_aabb;
        let placed: Vec<Placed> = places
            .iter()
            .map(|[x, y, z]| {
                let rows = Mat4::from_cols((*x).into(), (*y).into(), (*z).into(), Vec4::W);
                let to_world = rows.transpose();
                let corners: Vec<Vec3A> = (0..8)
                    .map(|corner| {
                        let pick = |axis: usize| {
                            if corner >> axis & 1 == 1 {
                                own.max[axis]
                            } else {
                                own.min[axis]
                            }
                        };
                        to_world.transform_point3a(vec3a(pick(0), pick(1), pick(2)))
                    })
                    .collect();
                Placed {
                    bounds: Aabb::from_points(&corners),
                    to_object: to_world.inverse(),
                }
            })
            .collect();
        let bvh = build_cwbvh(
            &placed,
            BvhBuildParams::medium_build(),
            &mut Duration::default(),
        );
        Self { torus, placed, bvh }
    }

    /// The ray as an instance sees it: of the same length, since places turn and move only.
    fn in_object(&self, ray: &ObvhsRay, id: usize) -> ObvhsRay {
        let placed = &self.placed[self.bvh.primitive_indices[id] as usize];
        let origin = placed.to_object.transform_point3a(ray.origin);
        let dir = placed.to_object.transform_vector3a(ray.direction);
        ObvhsRay::new(origin, dir, ray.tmin, ray.tmax)
    }
}

pub fn shade(mesh: &Mesh, places: &[[[f32; 4]; 3]], rays: &[Ray], timed: &mut Timed) -> Found {
    let world = timed.build(|| World::new(mesh, places));
    timed.trace(|| {
        let (mut distances, mut occluded) = (Vec::new(), Vec::new());
        for r in rays {
            let ray = ray(r);
            let mut hit = RayHit::none();
            world.bvh.ray_traverse(ray, &mut hit, |ray, id| {
                world.torus.distance(world.in_object(ray, id))
            });
            distances.push(hit.t);
            if hit.t < f32::INFINITY {
                let point = ray.origin + hit.t * ray.direction;
                let to_light = ObvhsRay::new(point, LIGHT.into(), 1e-3, f32::INFINITY);
                occluded.push(!world.bvh.ray_traverse_miss(to_light, |ray, id| {
                    if world.torus.occluded(world.in_object(ray, id)) {
                        ray.tmin
                    } else {
                        f32::INFINITY
                    }
                }));
            }
        }
        Found {
            distances,
            occluded,
        }
    })
}
