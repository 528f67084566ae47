//! Occlusion rays of a rendering in lots that share no sample: training rays and held-out rays.
//!
//! All samples of the picture stand in one fixed sequence that jumps evenly over it. A lot has the rays of the next
//! samples of the sequence. Two lots therefore have different samples, a lot of any size covers the whole picture,
//! and a smaller first lot is the beginning of a larger one.

use antumbra::{Bvh, Ray};
use rayon::prelude::*;

use crate::Error;
use crate::film::{Rules, Tiles};
use crate::integrator::{Batch, Integrator, Observe, Record, Tracer, dimension};
use crate::lab::rays::stride;
use crate::sampler::warp::cosine_hemisphere;
use crate::sampler::{Method, Sampler};
use crate::surface::{Frame, Surface};
use crate::world::{Camera, World};
use antumbra_image::Window;

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
    world: &'a World,
    bvh: &'a Bvh,
    camera: Camera,
    window: Window,
    tiles: Tiles,
    spp: u32,
    sampler: Sampler,
    /// Directions of the ambient occlusion rays.
    around: Sampler,
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
        let window = Rules::new(&world.film, false).sampled();
        let spp = spp.max(1);
        Self {
            world,
            bvh,
            camera: world.camera.clone(),
            window,
            tiles: Tiles::new(window),
            spp,
            sampler: Sampler::new(Method::of(world.sampler.kind, spp), seed),
            around: Sampler::new(Method::Independent, !seed),
            stride: stride(window.area() as u64 * u64::from(spp)),
            taken: 0,
        }
    }

    /// Samples of another camera.
    ///
    /// # Errors
    /// As for the camera of a scene.
    pub fn with_camera(mut self, camera: &antumbra_scene::Camera) -> Result<Self, Error> {
        self.camera = Camera::new(camera, &self.world.film)?;
        Ok(self)
    }

    /// Number of samples of the picture.
    pub fn total(&self) -> u64 {
        self.window.area() as u64 * u64::from(self.spp)
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
        let mut integrator = Integrator::new(self.world);
        let mut batch = Batch::default();
        let sample = |&turn| self.sample(turn, &mut integrator, &mut batch);
        turns.iter().map(sample).collect()
    }

    fn sample(&self, turn: u64, integrator: &mut Integrator, batch: &mut Batch) -> Asked {
        let id = (u128::from(turn) * u128::from(self.stride) % u128::from(self.total())) as u64;
        let (pixel, index) = (id / u64::from(self.spp), (id % u64::from(self.spp)) as u32);
        let width = self.window.width() as u64;
        let x = self.window.x0 + (pixel % width) as i32;
        let y = self.window.y0 + (pixel / width) as i32;
        let stream = self.sampler.stream(x, y, index);
        let [dx, dy] = stream.pair(dimension::FILM);
        let film = [x as f32 + dx, y as f32 + dy];
        batch.clear();
        batch
            .rays
            .push(self.camera.ray(film, stream.pair(dimension::LENS)));
        batch.streams.push(stream);
        batch.step = 1.0 / (self.spp as f32).sqrt();
        let mut tracer = Tracer::new(self.bvh, Observe::Record(Box::default()));
        integrator.trace(self.world, &mut tracer, batch, false);
        let Record { closest, shadow } = tracer.into_record();
        let mut ambient = Vec::new();
        if let Some((ray, Some(hit))) = closest.first() {
            let surface = Surface::found(&self.world.shapes, ray, hit);
            let frame = Frame::around(surface.facing_normal());
            let around = self.around.stream(x, y, index);
            for part in 0..AMBIENT_RAYS {
                let local = cosine_hemisphere(around.pair(part));
                ambient.push(surface.ray_along(frame.to_world(local)));
            }
        }
        Asked {
            place: (self.tiles.of(x, y), y, x, index),
            shadow,
            ambient,
        }
    }
}
