//! The sample that ray-driven builders judge splits by: training rays and the primitives that they hit.
//!
//! The rays are followed to their ends through a tree of binned SAH, so every primitive that they hit is
//! known, not only the nearest. An object has the rays of all its instances.

use super::Levels;
use antumbra::Primitives;
use antumbra::Ray;
use antumbra::parts::BinaryTree;
use antumbra::parts::RaySetup;
use antumbra::parts::{LeafHits, Witness, follow};
use antumbra::recipe::Builder;
use rayon::prelude::*;

/// At most this many rays are used. Of more rays, every second, third, ... is used.
const MOST_RAYS: usize = 1 << 14;

/// At most this many rays are kept for an object: instances multiply them.
const MOST_RAYS_IN_OBJECT: usize = 1 << 15;

/// Rays that one task follows.
const CHUNK: usize = 128;

/// Rays in the world or in an object, and their hits.
#[derive(Default)]
pub(crate) struct Evidence {
    pub rays: Vec<RaySetup>,
    /// A ray and a primitive that it hits, ray after ray.
    pub hits: Vec<(u32, u32)>,
}

impl Levels<Evidence> {
    /// Follows the rays. Those that cannot hit anything are left out.
    pub fn followed(primitives: &Primitives, rays: &[Ray]) -> Self {
        let nothing = || Self::new(primitives, |_| Evidence::default());
        let mut all = nothing();
        if rays.is_empty() || primitives.is_empty() {
            return all;
        }
        let tree = BinaryTree::build(primitives, Builder::BinnedSah);
        let stride = rays.len().div_ceil(MOST_RAYS);
        let rays: Vec<_> = rays.iter().copied().step_by(stride).collect();
        let chunks = rays.par_chunks(CHUNK).map(|rays| {
            let mut all = nothing();
            let Self { world, objects } = &mut all;
            follow(primitives, &tree, rays, world, objects);
            all
        });
        for chunk in chunks.collect::<Vec<_>>() {
            all.world.append(chunk.world);
            for (evidence, object) in all.objects.iter_mut().zip(chunk.objects) {
                if evidence.rays.len() < MOST_RAYS_IN_OBJECT {
                    evidence.append(object);
                }
            }
        }
        all
    }
}

impl Witness for Evidence {
    fn begin(&mut self, ray: &RaySetup) -> bool {
        // The world has fewer.
        let has_room = self.rays.len() < MOST_RAYS_IN_OBJECT;
        if has_room {
            self.rays.push(*ray);
        }
        has_room
    }

    fn node(&mut self, _node: u32) {}

    fn hits(&mut self, ray: &RaySetup, hits: LeafHits<'_>) {
        let of_ray = self.rays.len() as u32 - 1;
        self.hits
            .extend(hits.prims(ray).map(|(prim, _)| (of_ray, prim)));
    }

    fn end(&mut self) {}
}

impl Evidence {
    /// Adds the rays of `other` and what they hit.
    fn append(&mut self, other: Self) {
        let before = self.rays.len() as u32;
        self.rays.extend(other.rays);
        let hits = other.hits.into_iter();
        self.hits
            .extend(hits.map(|(ray, prim)| (before + ray, prim)));
    }
}
