//! The three programs with `bvh`.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use bvh::ray::Ray as BvhRay;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::input::{LIGHT, Mesh, Ray};
use crate::{Found, Timed};

struct Triangle {
    corners: [Point3<f32>; 3],
    node: usize,
}

impl Bounded<f32, 3> for Triangle {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.corners
            .iter()
            .fold(Aabb::empty(), |bounds, corner| bounds.grow(corner))
    }
}

impl BHShape<f32, 3> for Triangle {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Triangle {
    /// From both sides: the crate's own test sees front faces only.
    fn distance(&self, ray: &BvhRay<f32, 3>) -> f32 {
        let [a, b, c] = &self.corners;
        let front = ray.intersects_triangle(a, b, c).distance;
        front.min(ray.intersects_triangle(a, c, b).distance)
    }
}

struct Tree {
    triangles: Vec<Triangle>,
    bvh: Bvh<f32, 3>,
}

fn build(mesh: &Mesh) -> Tree {
    let mut triangles: Vec<Triangle> = (0..mesh.indices.len())
        .map(|triangle| Triangle {
            corners: mesh.corners(triangle).map(Point3::from),
            node: 0,
        })
        .collect();
    let bvh = Bvh::build(&mut triangles);
    Tree { triangles, bvh }
}

impl Tree {
    /// Distances are along a direction of length 1.
    fn occluded(&self, ray: &BvhRay<f32, 3>, near: f32, far: f32) -> bool {
        let mut candidates = self.bvh.traverse_iterator(ray, &self.triangles);
        candidates.any(|triangle| {
            let distance = triangle.distance(ray);
            near < distance && distance < far
        })
    }

    fn distance(&self, ray: &BvhRay<f32, 3>) -> f32 {
        let candidates = self.bvh.traverse_iterator(ray, &self.triangles);
        candidates
            .map(|triangle| triangle.distance(ray))
            .fold(f32::INFINITY, f32::min)
    }
}

/// The ray, whose direction the crate makes one of length 1, and its interval in these lengths.
fn ray(ray: &Ray) -> (BvhRay<f32, 3>, f32, f32) {
    let dir = Vector3::from(ray.dir);
    let length = dir.norm();
    (
        BvhRay::new(ray.origin.into(), dir),
        ray.near * length,
        ray.far * length,
    )
}

// baker
pub fn bake(mesh: &Mesh, rays: &[Ray], timed: &mut Timed) -> Found {
    let tree = timed.build(|| build(mesh));
    timed.trace(|| {
        let occluded = rays.iter().map(|r| {
            let (ray, near, far) = ray(r);
            tree.occluded(&ray, near, far)
        });
        Found::of(occluded.collect())
    })
}

// visibility
pub fn see(mesh: &Mesh, points: &[[f32; 3]], timed: &mut Timed) -> Found {
    let tree = timed.build(|| build(mesh));
    timed.trace(|| {
        let mut occluded = Vec::with_capacity(points.len() * points.len() / 2);
        for (index, &from) in points.iter().enumerate() {
            for &to in &points[..index] {
                let dir = Point3::from(to) - Point3::from(from);
                occluded.push(tree.occluded(&BvhRay::new(from.into(), dir), 0.0, dir.norm()));
            }
        }
        Found::of(occluded)
    })
}

// instances
struct Placed {
    bounds: Aabb<f32, 3>,
    to_object: Isometry3<f32>,
    node: usize,
}

impl Bounded<f32, 3> for Placed {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.bounds
    }
}

impl BHShape<f32, 3> for Placed {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Placed {
    fn new(own: &Aabb<f32, 3>, [x, y, z]: &[[f32; 4]; 3]) -> Self {
        let rows = Matrix3::new(x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]);
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
        let to_world = Isometry3::from_parts(Translation3::new(x[3], y[3], z[3]), turn);
        let mut bounds = Aabb::empty();
        for corner in 0..8 {
            let pick = |axis: usize| {
                if corner >> axis & 1 == 1 {
                    own.max[axis]
                } else {
                    own.min[axis]
                }
            };
            bounds.grow_mut(&(to_world * Point3::new(pick(0), pick(1), pick(2))));
        }
        Self {
            bounds,
            to_object: to_world.inverse(),
            node: 0,
        }
    }

    fn in_object(&self, ray: &BvhRay<f32, 3>) -> BvhRay<f32, 3> {
        BvhRay::new(self.to_object * ray.origin, self.to_object * ray.direction)
    }
}

pub fn shade(mesh: &Mesh, places: &[[[f32; 4]; 3]], rays: &[Ray], timed: &mut Timed) -> Found {
    let (torus, placed, world) = timed.build(|| {
        let torus = build(mesh);
        let own = torus
            .triangles
            .iter()
            .fold(Aabb::empty(), |all, triangle| all.join(&triangle.aabb()));
        let mut placed: Vec<Placed> = places
            .iter()
            .map(|place| Placed::new(&own, place))
            .collect();
        let world = Bvh::build(&mut placed);
        (torus, placed, world)
    });
    timed.trace(|| {
        let (mut distances, mut occluded) = (Vec::new(), Vec::new());
        for r in rays {
            let (ray, ..) = ray(r);
            let candidates = world.traverse_iterator(&ray, &placed);
            let nearest = candidates
                .map(|placed| torus.distance(&placed.in_object(&ray)))
                .fold(f32::INFINITY, f32::min);
            distances.push(nearest);
            if nearest < f32::INFINITY {
                let to_light = BvhRay::new(ray.origin + nearest * ray.direction, LIGHT.into());
                let mut candidates = world.traverse_iterator(&to_light, &placed);
                occluded.push(candidates.any(|placed| {
                    torus.occluded(&placed.in_object(&to_light), 1e-3, f32::INFINITY)
                }));
            }
        }
        Found {
            distances,
            occluded,
        }
    })
}
