//! Camera paths one at a time, with their rays.
//!
//! A batch of one sample queries in the order of its path. Consecutive rays are therefore as coherent as in a path
//! tracer that follows one path at a time. Nothing is sorted or shuffled afterwards.

use antumbra::{Bvh, Hit, Ray};
use antumbra_image::Window;

use crate::Error;
use crate::film::{Rules, Sample, Tiles};
use crate::integrator::{Batch, Integrator, Observe, Queries, Tracer};
use crate::sampler::warp::cosine_hemisphere;
use crate::sampler::{Method, Sampler};
use crate::surface::{Frame, Surface};
use crate::world::{Camera, World};

/// Camera paths of a picture.
#[derive(Debug)]
pub struct Paths<'a> {
    world: &'a World,
    camera: Camera,
    tiles: Tiles,
    window: Window,
    sampler: Sampler,
    /// Directions of rays around hits.
    around: Sampler,
    /// See [`Batch::step`].
    step: f32,
}

/// Rays of one path, in the order of the queries.
#[derive(Debug)]
pub struct PathRays {
    /// Ray from the camera.
    pub primary: Ray,
    /// Closest-hit rays with their hits.
    pub closest: Vec<(Ray, Option<Hit>)>,
    /// Shadow rays, as the integrator hands them to the occlusion query. Segments end just before an area light, rays
    /// towards sun and sky are unbounded.
    pub shadow: Vec<Ray>,
}

/// Buffers of a thread that traces paths.
#[derive(Debug)]
pub struct PathTracer<'p> {
    paths: &'p Paths<'p>,
    integrator: Integrator,
    batch: Batch,
}

impl<'a> Paths<'a> {
    /// Paths of a rendering of `world` with `spp` samples per pixel, by default the scene's, and this seed.
    pub fn new(world: &'a World, spp: Option<u32>, seed: u64) -> Self {
        let window = Rules::new(&world.film, false).sampled();
        let spp = spp.unwrap_or(world.sampler.pixel_samples);
        Self {
            world,
            camera: world.camera.clone(),
            tiles: Tiles::new(window),
            window,
            sampler: Sampler::new(Method::of(world.sampler.kind, spp), seed),
            around: Sampler::new(Method::Independent, !seed),
            step: 1.0 / (spp as f32).sqrt(),
        }
    }

    /// Paths whose textures are looked up at points.
    pub fn without_texture_filter(self) -> Self {
        Self { step: 0.0, ..self }
    }

    /// Paths of another camera.
    ///
    /// # Errors
    /// As for the camera of a scene.
    pub fn with_camera(self, camera: &antumbra_scene::Camera) -> Result<Self, Error> {
        let camera = Camera::new(camera, &self.world.film)?;
        Ok(Self { camera, ..self })
    }

    /// Pixels that are sampled.
    pub fn window(&self) -> Window {
        self.window
    }

    /// Number of tiles of the picture.
    pub fn tiles(&self) -> usize {
        self.tiles.count()
    }

    /// Window of the pixels of a tile.
    pub fn tile(&self, index: usize) -> Window {
        self.tiles.window(index)
    }

    /// Index of the tile of a pixel.
    pub fn tile_of(&self, [x, y]: [i32; 2]) -> usize {
        self.tiles.of(x, y)
    }

    /// Buffers of one more thread.
    pub fn tracer(&self) -> PathTracer<'_> {
        PathTracer {
            paths: self,
            integrator: Integrator::new(self.world),
            batch: Batch::default(),
        }
    }

    /// Unbounded ray `number` from a hit of the path of sample `index` of a pixel: cosine-weighted about the geometric
    /// normal that faces the path, whatever the material.
    pub fn around(
        &self,
        (ray, hit): (&Ray, &Hit),
        pixel: [i32; 2],
        index: u32,
        number: u32,
    ) -> Ray {
        let [x, y] = pixel;
        let surface = Surface::found(&self.world.shapes, ray, hit);
        let local = cosine_hemisphere(self.around.stream(x, y, index).pair(number));
        surface.ray_along(Frame::around(surface.facing_normal()).to_world(local))
    }
}

impl PathTracer<'_> {
    /// Traces the path of sample `index` of a pixel in a tree of the world.
    pub fn trace(&mut self, bvh: &Bvh, pixel: [i32; 2], index: u32) -> PathRays {
        let Self { paths, batch, .. } = self;
        batch.clear();
        batch.push(&paths.camera, &paths.sampler, Sample { pixel, index });
        batch.step = paths.step;
        let mut rays = PathRays {
            primary: batch.rays[0],
            closest: Vec::new(),
            shadow: Vec::new(),
        };
        let mut tracer = Tracer::new(bvh, Observe::Each(&mut rays));
        self.integrator
            .trace(paths.world, &mut tracer, batch, false);
        rays
    }
}

impl Queries for PathRays {
    fn intersect(&mut self, bvh: &Bvh, rays: &[Ray], hits: &mut [Option<Hit>]) {
        bvh.batch(rays).on_this_thread().intersect_into(hits);
        let found = rays.iter().copied().zip(hits.iter().copied());
        self.closest.extend(found);
    }

    fn occluded(&mut self, bvh: &Bvh, rays: &[Ray], occluded: &mut [bool]) {
        bvh.batch(rays).on_this_thread().occluded_into(occluded);
        self.shadow.extend_from_slice(rays);
    }
}
