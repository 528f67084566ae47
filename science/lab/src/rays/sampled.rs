//! Occlusion rays of a rendering in lots that share no sample: training rays and held-out rays.
//!
//! All samples of the picture are in one fixed sequence that jumps evenly over it. A lot has the rays of the next
//! samples of the sequence. Two lots therefore have different samples, a lot of any size covers the whole picture,
//! and a smaller first lot is the beginning of a larger one.

use antumbra::{Bvh, Ray};
use antumbra_render::{PathTracer, Paths, World};
use rayon::prelude::*;

use super::stride;
use crate::Error;
use crate::study::Kind;

/// Number of ambient occlusion rays from the hit of a camera ray.
const AMBIENT_RAYS: u32 = 4;
/// Largest number of samples traced at a time.
const GROUP: u64 = 4096;
/// Number of samples of one task.
const TASK: usize = 128;
/// Number of groups of a small picture, so that the first lot leaves some samples for the next.
const GROUPS: u64 = 16;

/// Samples of a picture in their sequence, and the number taken so far.
#[derive(Debug)]
pub struct SampledRays<'a> {
    paths: Paths<'a>,
    bvh: &'a Bvh,
    spp: u32,
    stride: u64,
    taken: u64,
}

/// Occlusion rays of some samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lot {
    /// Shadow rays of the scene's integrator, as it hands them to the occlusion query.
    pub shadow: Vec<Ray>,
    /// Unbounded rays from points that the camera sees, cosine-weighted about the geometric normal.
    pub ambient: Vec<Ray>,
    /// Number of samples traced for the lot.
    pub samples: u64,
    /// Number of shadow rays of these samples. `shadow` may hold fewer.
    pub shadow_rays: u64,
}

impl Lot {
    /// Rays of a kind.
    pub fn of(&self, kind: Kind) -> &[Ray] {
        match kind {
            Kind::Shadow => &self.shadow,
            Kind::Ao => &self.ambient,
        }
    }
}

/// Rays of one sample.
struct Asked {
    /// Place of the sample in a rendering: tile, pixel, number.
    place: (usize, i32, i32, u32),
    shadow: Vec<Ray>,
    ambient: Vec<Ray>,
}

impl<'a> SampledRays<'a> {
    /// Samples of a rendering of `world` with `spp` samples per pixel and this seed. Rays are traced in `bvh`, any
    /// tree of this world.
    pub fn new(world: &'a World, bvh: &'a Bvh, spp: u32, seed: u64) -> Self {
        let spp = spp.max(1);
        let paths = Paths::new(world, Some(spp), seed);
        Self {
            bvh,
            spp,
            stride: stride(paths.window().area() as u64 * u64::from(spp)),
            paths,
            taken: 0,
        }
    }

    /// Samples of another camera.
    ///
    /// # Errors
    /// As for the camera of a scene.
    pub fn with_camera(self, camera: &antumbra_scene::Camera) -> Result<Self, Error> {
        let paths = self.paths.with_camera(camera)?;
        Ok(Self { paths, ..self })
    }

    /// Number of samples of the picture.
    pub fn total(&self) -> u64 {
        self.paths.window().area() as u64 * u64::from(self.spp)
    }

    /// Takes the next samples until they have `shadow` shadow rays and `ambient` ambient occlusion rays, or until
    /// none is left. Rays come in the order of the sequence, at most that many of each kind.
    ///
    /// Uses the current rayon pool. The rays do not depend on the number of threads.
    pub fn take(&mut self, shadow: usize, ambient: usize) -> Lot {
        self.collect(shadow, ambient, false)
    }

    /// Takes the next samples as [`Self::take`] does, but with rays in the order of a rendering: tile by tile and
    /// pixel by pixel. Neighbouring rays are near each other, if less alike than in a full rendering.
    pub fn take_in_picture_order(&mut self, shadow: usize, ambient: usize) -> Lot {
        self.collect(shadow, ambient, true)
    }

    fn collect(&mut self, shadow: usize, ambient: usize, in_picture_order: bool) -> Lot {
        let mut asked: Vec<Asked> = Vec::new();
        let (mut shadows, mut others) = (0, 0);
        let first = self.taken;
        let group = self.total().div_ceil(GROUPS).min(GROUP);
        while (shadows < shadow || others < ambient) && self.taken < self.total() {
            let end = self.total().min(self.taken + group);
            let group: Vec<u64> = (self.taken..end).collect();
            let tasks: Vec<Vec<Asked>> = group
                .par_chunks(TASK)
                .map(|turns| self.trace(turns))
                .collect();
            self.taken = end;
            for sample in tasks.into_iter().flatten() {
                shadows += sample.shadow.len();
                others += sample.ambient.len();
                asked.push(sample);
            }
        }
        let mut lot = Lot {
            samples: self.taken - first,
            shadow_rays: shadows as u64,
            ..Lot::default()
        };
        // Surplus rays are cut off at the end of the sequence, wherever that lies in the picture.
        for sample in &mut asked {
            let room = shadow - lot.shadow.len().min(shadow);
            sample.shadow.truncate(room);
            lot.shadow.extend_from_slice(&sample.shadow);
            let room = ambient - lot.ambient.len().min(ambient);
            sample.ambient.truncate(room);
            lot.ambient.extend_from_slice(&sample.ambient);
        }
        if in_picture_order {
            asked.sort_by_key(|sample| sample.place);
            lot.shadow.clear();
            lot.ambient.clear();
            for sample in asked {
                lot.shadow.extend(sample.shadow);
                lot.ambient.extend(sample.ambient);
            }
        }
        lot
    }

    /// Rays of the samples at these places of the sequence.
    fn trace(&self, turns: &[u64]) -> Vec<Asked> {
        let mut tracer = self.paths.tracer();
        let sample = |&turn| self.sample(turn, &mut tracer);
        turns.iter().map(sample).collect()
    }

    fn sample(&self, turn: u64, tracer: &mut PathTracer<'_>) -> Asked {
        let id = (u128::from(turn) * u128::from(self.stride) % u128::from(self.total())) as u64;
        let (place, index) = (id / u64::from(self.spp), (id % u64::from(self.spp)) as u32);
        let window = self.paths.window();
        let width = window.width() as u64;
        let x = window.x0 + (place % width) as i32;
        let y = window.y0 + (place / width) as i32;
        let rays = tracer.trace(self.bvh, [x, y], index);
        let mut ambient = Vec::new();
        if let Some((ray, Some(hit))) = rays.closest.first() {
            let around = |part| self.paths.around((ray, hit), [x, y], index, part);
            ambient.extend((0..AMBIENT_RAYS).map(around));
        }
        Asked {
            place: (self.paths.tile_of([x, y]), y, x, index),
            shadow: rays.shadow,
            ambient,
        }
    }
}
