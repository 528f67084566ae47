//! The rays of a scene's camera paths, for benchmarks: the queries of a renderer, in its order.
//!
//! The integrator traces single samples through a recording tracer, pixel by pixel through whole tiles. A batch of
//! one sample queries in the order of its path. Consecutive rays are therefore as coherent as in a path tracer that
//! follows one path at a time. Nothing is sorted or shuffled afterwards.

use antumbra::{Bvh, Hit, Ray};
use rayon::prelude::*;

use crate::film::{Rules, Sample, Tiles, batches};
use crate::integrator::{Batch, Integrator, Observe, Record, Tracer, dimension};
use crate::sampler::warp::cosine_hemisphere;
use crate::sampler::{Method, Sampler};
use crate::surface::{Frame, Surface};
use crate::world::World;

/// Rays of camera paths, by purpose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rays {
    /// Rays from the camera.
    pub primary: Vec<Ray>,
    /// Rays to light samples, as the integrator hands them to the occlusion query. Segments end just before an area
    /// light, rays towards sun and sky are unbounded.
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
    let tiles = Tiles::new(Rules::new(&world.film, false).sampled());
    let method = Method::of(world.sampler.kind, world.sampler.pixel_samples);
    let collector = Collector {
        world,
        bvh,
        tiles,
        sampler: Sampler::new(method, seed),
        bounces: Sampler::new(Method::Independent, !seed),
    };
    let (total, stride) = (tiles.count(), stride(tiles.count() as u64) as usize);
    let mut rays = Rays::default();
    let mut paths = 0;
    for index in 0..=u32::MAX {
        for first in (0..total).step_by(GROUP) {
            let fewest = rays.primary.len().min(rays.shadow.len());
            if fewest.min(rays.diffuse.len()) >= count || paths >= count * PATHS_PER_RAY {
                return rays;
            }
            let group: Vec<Rays> = (first..total.min(first + GROUP))
                .into_par_iter()
                .map(|turn| collector.tile(turn * stride % total, index))
                .collect();
            for tile in group {
                paths += tile.primary.len();
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

/// Step that visits each of `total` tiles once, and any number of them evenly: near the golden section of `total`,
/// and without a common divisor.
pub(crate) fn stride(total: u64) -> u64 {
    let divides = |a: u64, b: u64| {
        let (mut a, mut b) = (a, b);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    let golden = (total as f64 * 0.618_033_988_749_895) as u64;
    (golden.max(1)..=total)
        .find(|&step| divides(step, total))
        .unwrap_or(1)
}

/// State that all tiles share.
struct Collector<'a> {
    world: &'a World,
    bvh: &'a Bvh,
    tiles: Tiles,
    sampler: Sampler,
    /// Directions of the diffuse rays.
    bounces: Sampler,
}

impl Collector<'_> {
    /// Rays of sample `index` of every pixel of a tile.
    fn tile(&self, tile: usize, index: u32) -> Rays {
        let mut integrator = Integrator::new(self.world);
        let mut batch = Batch::default();
        let mut rays = Rays::default();
        for pixels in batches(self.tiles.window(tile), 1) {
            for Sample { pixel: [x, y], .. } in pixels {
                let stream = self.sampler.stream(x, y, index);
                let [dx, dy] = stream.pair(dimension::FILM);
                let film = [x as f32 + dx, y as f32 + dy];
                let ray = self.world.camera.ray(film, stream.pair(dimension::LENS));
                batch.clear();
                batch.rays.push(ray);
                batch.streams.push(stream);
                let mut tracer = Tracer::new(self.bvh, Observe::Record(Box::default()));
                integrator.trace(self.world, &mut tracer, &mut batch, false);
                let Record { closest, shadow } = tracer.into_record();
                rays.primary.push(ray);
                rays.shadow.extend(shadow);
                let bounces = self.bounces.stream(x, y, index);
                for ((ray, hit), vertex) in closest.iter().zip(0u32..) {
                    if let Some(hit) = hit {
                        let surface = self.surface(ray, hit);
                        let local = cosine_hemisphere(bounces.pair(vertex));
                        let dir = Frame::around(surface.facing_normal()).to_world(local);
                        rays.diffuse.push(surface.ray_along(dir));
                    }
                }
            }
        }
        rays
    }

    fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        Surface::found(&self.world.shapes, ray, hit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stride_visits_every_tile_once() {
        for total in 1..500 {
            let step = stride(total);
            let mut seen = vec![false; total as usize];
            for turn in 0..total {
                seen[(turn * step % total) as usize] = true;
            }
            assert!(seen.iter().all(|&seen| seen), "{total} by {step}");
        }
    }
}
