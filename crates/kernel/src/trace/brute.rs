//! No tree at all: every primitive against every ray, in plain scalar code. The oracle that every tree,
//! order and level is compared with, and the first thing to try when an answer is in doubt.

use super::setup::RaySetup;
use crate::geometry::triangle;
use crate::primitives::Primitives;
use crate::ray::{Hit, INVALID_ID, Ray};

/// A scene without an acceleration structure, with the queries of [`crate::AnyBvh`].
#[derive(Clone, Debug)]
pub struct Brute {
    primitives: Primitives,
    reach: f32,
}

impl Brute {
    /// Keeps the primitives as they are.
    pub fn new(primitives: Primitives) -> Self {
        let reach = primitives.bounds().reach();
        Self { primitives, reach }
    }

    /// Whether anything lies in the ray's interval.
    pub fn occluded(&self, ray: &Ray) -> bool {
        let Some(setup) = RaySetup::new(ray, self.reach) else {
            return false;
        };
        self.primitives
            .triangles
            .iter()
            .any(|corners| triangle::hit(corners, &setup).is_some())
            || self
                .primitives
                .spheres
                .iter()
                .any(|sphere| sphere.hit(&setup).is_some())
    }

    /// The closest hit in the ray's interval; at equal distances the smallest (geom_id, prim_id).
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let setup = RaySetup::new(ray, self.reach)?;
        let Primitives {
            triangles,
            triangle_refs,
            spheres,
            sphere_refs,
            ..
        } = &self.primitives;
        let mut best = Hit::none(ray.tfar);
        for (corners, id) in triangles.iter().zip(triangle_refs) {
            if let Some((t, u, v)) = triangle::hit(corners, &setup) {
                Hit {
                    t,
                    u,
                    v,
                    prim_id: id.prim_id,
                    geom_id: id.geom_id,
                    inst_id: INVALID_ID,
                }
                .improve(&mut best);
            }
        }
        for (sphere, id) in spheres.iter().zip(sphere_refs) {
            if let Some(t) = sphere.hit(&setup) {
                Hit {
                    t,
                    u: 0.0,
                    v: 0.0,
                    prim_id: id.prim_id,
                    geom_id: id.geom_id,
                    inst_id: INVALID_ID,
                }
                .improve(&mut best);
            }
        }
        best.found()
    }

    /// [`Brute::occluded`] for every ray.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.occluded(ray);
        }
    }

    /// [`Brute::intersect`] for every ray.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "one answer per ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.intersect(ray);
        }
    }
}
