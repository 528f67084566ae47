//! The rays of a scene's camera paths, for benchmarks: the queries of a renderer, in its order.
//!
//! Single samples are traced pixel by pixel through whole tiles.

use antumbra::{Bvh, Ray};
use antumbra_render::{PathRays, Paths, World};
use rayon::prelude::*;

use super::stride;

/// Rays of camera paths, by purpose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rays {
    /// Rays from the camera.
    pub primary: Vec<Ray>,
    /// Rays to light samples, see [`PathRays::shadow`].
    pub shadow: Vec<Ray>,
    /// Unbounded rays, one from every vertex of the paths. Cosine-weighted about the geometric normal that faces the
    /// path, whatever the material.
    pub diffuse: Vec<Ray>,
}

/// Number of tiles traced at a time: enough for every thread, and few traced in vain.
const GROUP: usize = 32;
/// Number of paths per ray wanted, after which a kind that is rare in the scene is given up.
const PATHS_PER_RAY: usize = 8;

/// Collects `count` rays of each kind, or fewer if the paths do not have so many.
///
/// `bvh` is a tree of this world. Tiles are spread evenly over the picture. The rays depend on the scene (integrator,
/// sampler and film included), on `count` and on `seed`. They depend neither on the number of threads nor on the
/// width and order of `bvh`. Uses the current rayon pool.
pub fn collect_rays(world: &World, bvh: &Bvh, count: usize, seed: u64) -> Rays {
    let paths = Paths::new(world, None, seed).without_texture_filter();
    let total = paths.tiles();
    let stride = stride(total as u64) as usize;
    let mut rays = Rays::default();
    let mut traced = 0;
    for index in 0..=u32::MAX {
        for first in (0..total).step_by(GROUP) {
            let fewest = rays.primary.len().min(rays.shadow.len());
            if fewest.min(rays.diffuse.len()) >= count || traced >= count * PATHS_PER_RAY {
                return rays;
            }
            let group: Vec<Rays> = (first..total.min(first + GROUP))
                .into_par_iter()
                .map(|turn| tile(&paths, bvh, turn * stride % total, index))
                .collect();
            for tile in group {
                traced += tile.primary.len();
                fill(&mut rays.primary, tile.primary, count);
                fill(&mut rays.shadow, tile.shadow, count);
                fill(&mut rays.diffuse, tile.diffuse, count);
            }
        }
    }
    rays
}

/// Appends rays until there are `count`.
fn fill(rays: &mut Vec<Ray>, more: Vec<Ray>, count: usize) {
    let missing = count - rays.len();
    rays.extend(more.into_iter().take(missing));
}

/// Rays of sample `index` of every pixel of a tile.
fn tile(paths: &Paths<'_>, bvh: &Bvh, tile: usize, index: u32) -> Rays {
    let mut tracer = paths.tracer();
    let mut rays = Rays::default();
    let window = paths.tile(tile);
    for y in window.y0..window.y1 {
        for x in window.x0..window.x1 {
            let PathRays {
                primary,
                closest,
                shadow,
            } = tracer.trace(bvh, [x, y], index);
            rays.primary.push(primary);
            rays.shadow.extend(shadow);
            for ((ray, hit), vertex) in closest.iter().zip(0u32..) {
                if let Some(hit) = hit {
                    let around = paths.around((ray, hit), [x, y], index, vertex);
                    rays.diffuse.push(around);
                }
            }
        }
    }
    rays
}
