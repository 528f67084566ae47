//! A tree of only the emitting shapes: the light that a ray would hit if nothing else was there.
//!
//! A ray that looks for light needs no closest hit among all surfaces. The emitter is found among few shapes, and
//! then an occlusion query finds whether anything lies before the emitter. Most such rays find no emitter, and need
//! no query of the scene under a dark sky.

use antumbra::recipe::Order;
use antumbra::{Bvh, Geometry, Hit, INVALID_ID, Ray, Recipe};

use crate::Error;
use crate::surface::SEGMENT_SHARE;

/// A tree over the emitting shapes of the world.
#[derive(Debug)]
pub struct EmitterTree {
    bvh: Bvh,
    /// Position of every emitting shape in the scene.
    shapes: Vec<u32>,
}

impl EmitterTree {
    /// A tree of the geometries whose place `shines`.
    pub fn new(geometries: &[Geometry], shines: impl Fn(usize) -> bool) -> Result<Self, Error> {
        let shining = (0..geometries.len()).filter(|&shape| shines(shape));
        let shapes: Vec<u32> = shining.map(|shape| shape as u32).collect();
        let geometries: Vec<_> = shapes
            .iter()
            .map(|&shape| geometries[shape as usize].clone())
            .collect();
        // Closest hits do not notice the child order, so nothing is learned.
        let recipe = Recipe::fast().order(Order::Simple);
        Ok(Self {
            bvh: Bvh::build(&geometries, &recipe).map_err(Error::Geometry)?,
            shapes,
        })
    }

    /// First emitter on each ray, numbered as in the whole scene. Written over `hits`.
    pub fn find(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        hits.clear();
        hits.resize(rays.len(), None);
        if self.shapes.is_empty() {
            return;
        }
        self.bvh.batch(rays).on_this_thread().intersect_into(hits);
        for hit in hits.iter_mut().flatten() {
            hit.geom_id = self.shapes[hit.geom_id as usize];
            debug_assert_eq!(hit.inst_id, INVALID_ID);
        }
    }
}

/// Part of a ray before a hit, of the same share as a [segment](crate::surface::segment) to a light, so that the surface hit
/// does not count: the distance that decides what is hit is not quite the one that is reported.
pub fn before(ray: &Ray, hit: &Hit) -> Ray {
    Ray {
        tfar: hit.t * SEGMENT_SHARE,
        ..*ray
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::mix;

    /// A number from -1 to 1.
    fn number(seed: u64) -> f32 {
        (mix(seed) >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn point(seed: u64) -> [f32; 3] {
        [0, 1, 2].map(|axis| number(seed * 3 + axis))
    }

    /// If nothing lies before the first emitter, it is the closest hit of the whole scene.
    #[test]
    fn the_light_a_ray_meets_is_the_one_of_a_closest_hit() {
        let triangle = |seed: u64| {
            let corners = [0, 1, 2].map(|corner| {
                let (center, offset) = (point(seed), point(1_000 + 3 * seed + corner));
                [0, 1, 2].map(|axis| center[axis] + 0.4 * offset[axis])
            });
            Geometry::triangles(corners.to_vec(), vec![[0, 1, 2]])
        };
        let world: Vec<Geometry> = (0..60).map(triangle).collect();
        let shines = |shape: usize| shape % 4 == 1;
        let emitters = EmitterTree::new(&world, shines).expect("indices in range");
        let bvh = Bvh::build(&world, &Recipe::default()).expect("indices in range");
        let rays: Vec<Ray> = (0..4_000)
            .map(|seed| Ray::new(point(9_000 + seed), point(90_000 + seed)))
            .collect();
        let mut lights = Vec::new();
        emitters.find(&rays, &mut lights);
        let (mut met, mut hidden) = (0, 0);
        for (ray, light) in rays.iter().zip(&lights) {
            let closest = bvh.intersect(ray);
            let expected = closest.filter(|hit| shines(hit.geom_id as usize));
            let seen = light.filter(|hit| !bvh.occluded(&before(ray, hit)));
            assert_eq!(seen, expected, "{ray:?}");
            met += usize::from(seen.is_some());
            hidden += usize::from(light.is_some() && seen.is_none());
        }
        assert!(met > 100 && hidden > 40, "{met} {hidden}");
    }
}
