//! The emitting shapes alone in a tree of their own: which light would a ray meet if nothing else was there?
//!
//! A ray that only wants to know which light it meets need not find its closest hit among all surfaces. It
//! finds the emitter first, among few, and then asks whether anything lies before it: an occlusion query.
//! Most such rays find no emitter, and where the sky is dark nothing is asked of the scene at all.

use antumbra::{AnyBvh, BuildOptions, Collapse, Geometry, Hit, INVALID_ID, Ray};

use crate::Error;

/// A tree over the emitting shapes of the world.
#[derive(Debug)]
pub struct Emitters {
    bvh: AnyBvh,
    /// Position of each in the scene.
    shapes: Vec<u32>,
}

impl Emitters {
    /// Those of the world's geometries that `shines` says are lights.
    pub fn new(geometries: &[Geometry], shines: impl Fn(usize) -> bool) -> Result<Self, Error> {
        let shining = (0..geometries.len()).filter(|&shape| shines(shape));
        let shapes: Vec<u32> = shining.map(|shape| shape as u32).collect();
        let geometries: Vec<_> = shapes
            .iter()
            .map(|&shape| geometries[shape as usize].clone())
            .collect();
        let options = BuildOptions {
            collapse: Collapse::Area,
            ..Default::default()
        };
        Ok(Self {
            bvh: AnyBvh::build(&geometries, &options).map_err(Error::Geometry)?,
            shapes,
        })
    }

    /// The first emitter on each ray, as a query of the whole scene would report it; written over `hits`.
    pub fn find(&self, rays: &[Ray], hits: &mut Vec<Option<Hit>>) {
        hits.clear();
        hits.resize(rays.len(), None);
        if self.shapes.is_empty() {
            return;
        }
        self.bvh.tracer().intersect_batch(rays, hits);
        for hit in hits.iter_mut().flatten() {
            hit.geom_id = self.shapes[hit.geom_id as usize];
            debug_assert_eq!(hit.inst_id, INVALID_ID);
        }
    }
}

/// The part of a ray before a hit. It ends a few roundings earlier, so that the surface hit does not count.
pub fn before(ray: &Ray, hit: &Hit) -> Ray {
    Ray {
        tfar: hit.t * (1.0 - 16.0 * f32::EPSILON),
        ..*ray
    }
}
