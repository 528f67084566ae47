//! The three programs with `antumbra`.

use antumbra::{Bvh, Geometry, Instance, Primitives, Ray as KernelRay, Recipe};

use crate::input::{LIGHT, Mesh, Ray};
use crate::{Found, Timed};

fn ray(ray: &Ray) -> KernelRay {
    KernelRay {
        tnear: ray.near,
        tfar: ray.far,
        ..KernelRay::new(ray.origin, ray.dir)
    }
}

fn build(mesh: &Mesh) -> Bvh {
    let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    Bvh::build(&geometry, &Recipe::default()).expect("indices in range")
}

// baker
pub fn bake(mesh: &Mesh, rays: &[Ray], timed: &mut Timed) -> Found {
    let bvh = timed.build(|| build(mesh));
    timed.trace(|| {
        let rays: Vec<KernelRay> = rays.iter().map(ray).collect();
        Found::of(bvh.batch(&rays).on_this_thread().occluded())
    })
}

// visibility
pub fn see(mesh: &Mesh, points: &[[f32; 3]], timed: &mut Timed) -> Found {
    let bvh = timed.build(|| build(mesh));
    timed.trace(|| {
        let mut occluded = Vec::with_capacity(points.len() * points.len() / 2);
        for (index, from) in points.iter().enumerate() {
            let rays: Vec<_> = points[..index]
                .iter()
                .map(|to| KernelRay::between(*from, *to))
                .collect();
            occluded.extend(bvh.batch(&rays).on_this_thread().occluded());
        }
        Found::of(occluded)
    })
}

// instances
pub fn shade(mesh: &Mesh, places: &[[[f32; 4]; 3]], rays: &[Ray], timed: &mut Timed) -> Found {
    let bvh = timed.build(|| {
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let places: Vec<_> = places
            .iter()
            .map(|&transform| Instance::new(0, transform))
            .collect();
        let scene = Primitives::with_instances(&[], &[geometry], &places);
        let scene = scene.expect("indices in range");
        Bvh::build(&scene, &Recipe::default()).expect("indices in range")
    });
    timed.trace(|| {
        let rays: Vec<KernelRay> = rays.iter().map(ray).collect();
        let hits = bvh.batch(&rays).on_this_thread().intersect();
        let mut to_light = Vec::new();
        for (ray, hit) in rays.iter().zip(&hits) {
            if let Some(hit) = hit {
                to_light.push(KernelRay {
                    tnear: 1e-3,
                    ..KernelRay::new(ray.at(hit.t), LIGHT)
                });
            }
        }
        let occluded = bvh.batch(&to_light).on_this_thread().occluded();
        let distances = hits
            .iter()
            .map(|hit| hit.map_or(f32::INFINITY, |hit| hit.t))
            .collect();
        Found {
            distances,
            occluded,
        }
    })
}
