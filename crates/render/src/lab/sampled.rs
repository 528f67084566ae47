//! Occlusion rays of a rendering in lots that have no sample in common: some to learn from, others to test
//! what was learned.
//!
//! All samples of the picture stand in one fixed sequence that jumps evenly over it; a lot is what the next
//! samples of the sequence ask. So the rays of two lots are of different samples, a lot of any size covers
//! the whole picture, and a smaller first lot is the beginning of a larger one.

use antumbra::{AnyBvh, Ray};
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

/// Ambient occlusion rays from what one camera ray meets.
const AMBIENT_RAYS: u32 = 4;
/// Most samples traced at a time, and those of one task.
const GROUP: u64 = 4096;
const TASK: usize = 128;
/// Small pictures are traced in so many groups, so that the first lot leaves some samples for the next.
const GROUPS: u64 = 16;

/// The samples of a picture in their sequence, and how many were taken.
#[derive(Debug)]
pub struct SampledRays<'a> {
    world: &'a World,
    bvh: &'a AnyBvh,
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

/// What some samples asked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lot {
    /// Shadow rays of the scene's integrator, as it hands them to the occlusion query.
    pub shadow: Vec<Ray>,
    /// Unbounded rays from what the camera sees, cosine-weighted about the geometric normal.
    pub ambient: Vec<Ray>,
    /// How many samples of the picture were traced for them.
    pub samples: u64,
    /// How many shadow rays these samples have: more than `shadow` holds if that was full.
    pub shadow_rays: u64,
}

/// The rays of one sample.
struct Asked {
    /// Where the sample stands in a rendering: tile, pixel, number.
    place: (usize, i32, i32, u32),
    shadow: Vec<Ray>,
    ambient: Vec<Ray>,
}

impl<'a> SampledRays<'a> {
    /// The samples of a rendering of `world` with `spp` samples per pixel and this seed, whose rays are
    /// followed through `bvh`, a tree of this world; which one does not matter.
    pub fn new(world: &'a World, bvh: &'a AnyBvh, spp: u32, seed: u64) -> Self {
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

    /// The same with the eye elsewhere.
    ///
    /// # Errors
    /// As for the camera of a scene.
    pub fn with_camera(mut self, camera: &antumbra_scene::Camera) -> Result<Self, Error> {
        self.camera = Camera::new(camera, &self.world.film)?;
        Ok(self)
    }

    /// How many samples the picture has.
    pub fn total(&self) -> u64 {
        self.window.area() as u64 * u64::from(self.spp)
    }

    /// The rays of as many further samples as have `shadow` shadow rays and `ambient` others, or of all that
    /// are left; in the order of the sequence. At most that many rays of each kind are returned.
    ///
    /// Uses the current rayon pool; the rays do not depend on the number of threads.
    pub fn take(&mut self, shadow: usize, ambient: usize) -> Lot {
        self.collect(shadow, ambient, false)
    }

    /// The same in the order in which a rendering would ask: tile by tile and pixel by pixel. Some rays
    /// of a tile are no more alike than those of distant pixels are in a rendering, but they are near each other.
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
        // What is too much is left out at the end of the sequence, wherever that lies in the picture.
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

    /// What the samples at these places of the sequence ask.
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
