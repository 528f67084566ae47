//! Path tracing with next-event estimation and multiple importance sampling, with the expected values of pbrt-v3's
//! `path`.
//!
//! # Rays per vertex
//!
//! pbrt traces two rays per vertex for the light that it samples there: a shadow ray to a sample of the light, and a
//! ray along a sample of the BSDF. Here the second is the ray that continues the path, whose light is added with the
//! weight of BSDF sampling. Every continuation is traced, even the last, so the expectation is the same with a third
//! fewer rays. The last continuation needs only the light that it meets, which an occlusion query tells, see
//! [`crate::light::EmitterTree`].
//!
//! # Surfaces without a material
//!
//! A path goes on through a surface without a material, at the same depth. As in pbrt-v3, light that a BSDF sample
//! finds behind such a surface does not count. The surface blocks light samples, and would block the ray with which
//! pbrt looks for lights.
//!
//! # Blocks
//!
//! Vertices are shaded a block at a time, each step for all of them in a loop of its own. A step is a chain of roots
//! and divisions that leaves a CPU idle. Short loops let the chains of several vertices overlap.

use std::ops::Range;

use antumbra::{Hit, Ray};
use glam::Vec3;

use super::hits::{BLOCK, Hits};
use super::tracer::Tracer;
use super::{Batch, ShadowQueue, dimension, power_heuristic};
use crate::light::{LightSample, Receiver, before};
use crate::material::Material;
use crate::material::bsdf::Bsdf;
use crate::surface::{Frame, Surface};
use crate::world::World;

/// Dimensions used at each vertex of a path.
const LIGHT_CHOICE: u32 = 0;
const LIGHT: u32 = 1;
const LOBE: u32 = 2;
const DIRECTION: u32 = 3;
const ROULETTE: u32 = 4;
const PER_VERTEX: u32 = 5;

/// Russian roulette is played from this vertex on.
const ROULETTE_DEPTH: u32 = 4;

/// The path integrator with its buffers.
#[derive(Debug)]
pub struct PathTracer {
    max_depth: u32,
    rr_threshold: f32,
    current: Paths,
    next: Paths,
    /// Paths that go on through a surface without a material.
    through: Paths,
    hits: Hits,
    /// Emitters on the way of the last rays.
    lit: Vec<Option<Hit>>,
    vertices: Vec<Vertex>,
    /// BSDFs of the vertices whose material varies.
    bsdfs: Vec<Bsdf>,
    lights: Vec<Option<Arrival>>,
}

/// Paths under way, one array per property.
#[derive(Debug, Default)]
struct Paths {
    rays: Vec<Ray>,
    samples: Vec<u32>,
    throughput: Vec<Vec3>,
    /// Product of squared ratios of refraction so far. Radiance is compressed inside glass and expands again outside,
    /// for which roulette must not punish a path.
    expansion: Vec<f32>,
    origin: Vec<Origin>,
}

/// Origin of a ray, which decides the weight of the light that it meets.
#[derive(Clone, Copy, Debug)]
enum Origin {
    /// The camera or a delta lobe: no light sample could have found the light.
    Certain,
    /// A BSDF sample of this density from this point.
    Scattered { from: Receiver, pdf: f32 },
    /// A BSDF sample that went on through a surface without a material: light does not count.
    Hidden,
}

impl Paths {
    fn clear(&mut self) {
        self.rays.clear();
        self.samples.clear();
        self.throughput.clear();
        self.expansion.clear();
        self.origin.clear();
    }

    #[inline]
    fn push(&mut self, ray: Ray, sample: u32, throughput: Vec3, expansion: f32, origin: Origin) {
        self.rays.push(ray);
        self.samples.push(sample);
        self.throughput.push(throughput);
        self.expansion.push(expansion);
        self.origin.push(origin);
    }
}

impl PathTracer {
    /// Integrator of at most `max_depth` scattering events, with roulette for a throughput below `rr_threshold`.
    pub fn new(max_depth: u32, rr_threshold: f32) -> Self {
        Self {
            max_depth,
            rr_threshold,
            current: Paths::default(),
            next: Paths::default(),
            through: Paths::default(),
            hits: Hits::default(),
            lit: Vec::new(),
            vertices: Vec::new(),
            bsdfs: Vec::new(),
            lights: Vec::new(),
        }
    }

    /// Traces a batch to its end.
    pub fn trace(
        &mut self,
        world: &World,
        tracer: &mut Tracer,
        batch: &mut Batch,
        shadows: &mut ShadowQueue,
    ) {
        self.current.clear();
        for (sample, &ray) in batch.rays.iter().enumerate() {
            let sample = sample as u32;
            self.current
                .push(ray, sample, Vec3::ONE, 1.0, Origin::Certain);
        }
        let mut depth = 0;
        while !self.current.rays.is_empty() && !tracer.is_stopped() {
            if depth == self.max_depth && world.ends_by_occlusion {
                self.end(world, batch, shadows);
                shadows.flush(tracer, batch);
                break;
            }
            self.next.clear();
            let mut from_camera = depth == 0;
            while !self.current.rays.is_empty() && !tracer.is_stopped() {
                self.hits.find(tracer, &self.current.rays);
                self.through.clear();
                let count = self.current.rays.len();
                for first in (0..count).step_by(BLOCK) {
                    let last = count.min(first + BLOCK);
                    self.meet(world, batch, first..last, depth, from_camera);
                    self.find_lights(world, batch, depth);
                    self.ask_lights(world, shadows);
                    self.scatter(world, batch, depth);
                }
                shadows.flush(tracer, batch);
                std::mem::swap(&mut self.current, &mut self.through);
                from_camera = false;
            }
            std::mem::swap(&mut self.current, &mut self.next);
            depth = depth.saturating_add(1);
        }
    }

    /// Adds the emission that some of the paths meet, and keeps the points where they scatter.
    fn meet(
        &mut self,
        world: &World,
        batch: &mut Batch,
        range: Range<usize>,
        depth: u32,
        from_camera: bool,
    ) {
        self.vertices.clear();
        self.bsdfs.clear();
        for index in range {
            let rays = &self.current.rays;
            let sample = self.current.samples[index] as usize;
            let throughput = self.current.throughput[index];
            let origin = &self.current.origin[index];
            let Some(surface) = self.hits.surface(&world.shapes, rays, index) else {
                let escaped = escaped_light(world, origin, Vec3::from(rays[index].dir));
                batch.emitted[sample] += throughput * escaped;
                continue;
            };
            batch.emitted[sample] += throughput * emitted_light(world, origin, &surface);
            if depth >= self.max_depth {
                continue;
            }
            let material = world.shapes[surface.shape].material;
            let (bsdf, frame) = match &world.materials[material] {
                Material::Constant(bsdf) => {
                    if bsdf.is_black() {
                        continue;
                    }
                    (bsdf, shading_frame(world, bsdf, &surface))
                }
                Material::Varying(varying) => {
                    let Some(hit) = self.hits.hit(index) else {
                        continue;
                    };
                    let neighbours = neighbours(world, batch, &rays[index], from_camera);
                    let (bsdf, frame) =
                        varying.shade(&world.shapes, &surface, hit, neighbours.as_ref());
                    if bsdf.is_black() {
                        continue;
                    }
                    self.bsdfs.push(bsdf);
                    (&self.bsdfs[self.bsdfs.len() - 1], frame)
                }
                Material::None => {
                    let origin = match origin {
                        Origin::Certain => Origin::Certain,
                        Origin::Scattered { .. } | Origin::Hidden => Origin::Hidden,
                    };
                    let ray = surface.ray_along(rays[index].dir.into());
                    let expansion = self.current.expansion[index];
                    self.through
                        .push(ray, sample as u32, throughput, expansion, origin);
                    continue;
                }
            };
            self.vertices.push(Vertex {
                path: index,
                material: material as u32,
                made: self.bsdfs.len().wrapping_sub(1) as u32,
                frame,
                wo: frame.to_local(surface.wo),
                receiver: receiver(bsdf, &surface),
                surface,
            });
        }
    }

    /// Queues the last rays, each as a shadow ray to the first light on its way. Other surfaces do not matter.
    fn end(&mut self, world: &World, batch: &mut Batch, shadows: &mut ShadowQueue) {
        let Paths {
            rays,
            samples,
            throughput,
            origin,
            ..
        } = &self.current;
        world.emitters.find(rays, &mut self.lit);
        for (index, (ray, hit)) in rays.iter().zip(&self.lit).enumerate() {
            let (throughput, origin) = (throughput[index], &origin[index]);
            // A throughput that is not finite spoils its sample, even without a hit.
            batch.emitted[samples[index] as usize] += throughput * Vec3::ZERO;
            let (light, ray) = match hit {
                None => (escaped_light(world, origin, Vec3::from(ray.dir)), *ray),
                Some(hit) => {
                    let surface = Surface::found(&world.shapes, ray, hit);
                    (emitted_light(world, origin, &surface), before(ray, hit))
                }
            };
            let brought = throughput * light;
            if brought != Vec3::ZERO {
                shadows.push(ray, samples[index], brought);
            }
        }
    }

    /// Samples one light for every vertex.
    fn find_lights(&mut self, world: &World, batch: &Batch, depth: u32) {
        let dimension = first_dimension(depth);
        let current = &self.current;
        self.lights.clear();
        self.lights.extend(self.vertices.iter().map(|vertex| {
            if vertex.bsdf(world, &self.bsdfs).delta_share() == 1.0 {
                return None;
            }
            let stream = &batch.streams[current.samples[vertex.path] as usize];
            let choice = stream.uniform(dimension + LIGHT_CHOICE);
            let (index, probability) = world.lights.choose(vertex.receiver.point, choice)?;
            let u = stream.pair(dimension + LIGHT);
            let light = world.lights.all()[index].sample(&vertex.receiver, u)?;
            let density = light.pdf * probability;
            Some(Arrival { light, density })
        }));
    }

    /// Queues the shadow rays to the light samples.
    fn ask_lights(&self, world: &World, shadows: &mut ShadowQueue) {
        for (vertex, arrival) in self.vertices.iter().zip(&self.lights) {
            let Some(Arrival { light, density }) = arrival else {
                continue;
            };
            let surface = &vertex.surface;
            let wi = vertex.frame.to_local(light.wi);
            let bsdf = vertex.bsdf(world, &self.bsdfs);
            let evaluation = bsdf.evaluate(vertex.wo, wi, surface.faces_same_side(light.wi));
            let technique = if light.is_delta {
                1.0
            } else {
                power_heuristic(*density, evaluation.pdf * (1.0 - bsdf.delta_share()))
            };
            let brought = self.current.throughput[vertex.path]
                * evaluation.value
                * light.radiance
                * (wi.z.abs() * technique / density);
            if brought != Vec3::ZERO {
                let sample = self.current.samples[vertex.path];
                shadows.push(light.shadow_ray(surface), sample, brought);
            }
        }
    }

    /// Continues the paths.
    fn scatter(&mut self, world: &World, batch: &Batch, depth: u32) {
        let dimension = first_dimension(depth);
        for vertex in &self.vertices {
            let Vertex { surface, frame, .. } = vertex;
            let sample = self.current.samples[vertex.path];
            let stream = &batch.streams[sample as usize];
            let bsdf = vertex.bsdf(world, &self.bsdfs);
            let lobe = stream.uniform(dimension + LOBE);
            let Some(scattered) = vertex.scatter(bsdf, lobe, stream.pair(dimension + DIRECTION))
            else {
                continue;
            };
            let mut throughput = self.current.throughput[vertex.path] * scattered.weight;
            if throughput == Vec3::ZERO {
                continue;
            }
            let mut expansion = self.current.expansion[vertex.path];
            if scattered.eta != 1.0 {
                let eta = scattered.eta;
                expansion *= if surface.wo.dot(surface.normal) > 0.0 {
                    eta * eta
                } else {
                    1.0 / (eta * eta)
                };
            }
            if depth >= ROULETTE_DEPTH {
                let chance = (throughput * expansion).max_element();
                if chance < self.rr_threshold {
                    let end = (1.0 - chance).max(0.05);
                    if stream.uniform(dimension + ROULETTE) < end {
                        continue;
                    }
                    throughput /= 1.0 - end;
                }
            }
            let ray = surface.ray_along(frame.to_world(scattered.wi));
            self.next
                .push(ray, sample, throughput, expansion, scattered.origin);
        }
    }
}

/// First dimension of the vertices at this depth.
fn first_dimension(depth: u32) -> u32 {
    dimension::FIRST.wrapping_add(depth.wrapping_mul(PER_VERTEX))
}

/// A point where a path scatters.
#[derive(Debug)]
struct Vertex {
    /// Place among the current paths.
    path: usize,
    /// Place among the world's materials.
    material: u32,
    /// Place of the BSDF in the block, if the material varies.
    made: u32,
    surface: Surface,
    frame: Frame,
    /// Direction towards the previous vertex, in the frame.
    wo: Vec3,
    receiver: Receiver,
}

/// Light that may arrive at a vertex.
#[derive(Debug)]
struct Arrival {
    light: LightSample,
    /// Density of this sample of this light.
    density: f32,
}

/// Continuation of a path.
struct Scattered {
    /// Direction in the frame.
    wi: Vec3,
    /// BSDF and cosine over density.
    weight: Vec3,
    origin: Origin,
    /// Index of refraction inside over outside, if the path passes to the other side. Otherwise 1.
    eta: f32,
}

impl Vertex {
    /// BSDF of the vertex.
    #[inline]
    fn bsdf<'a>(&self, world: &'a World, made: &'a [Bsdf]) -> &'a Bsdf {
        match &world.materials[self.material as usize] {
            Material::Constant(bsdf) => bsdf,
            _ => &made[self.made as usize],
        }
    }

    /// Draws a direction. `None` where the path ends.
    #[inline]
    fn scatter(&self, bsdf: &Bsdf, mut lobe: f32, u: [f32; 2]) -> Option<Scattered> {
        let wo = self.wo;
        let delta_share = bsdf.delta_share();
        if lobe < delta_share {
            let sample = bsdf.sample_delta(wo, lobe / delta_share)?;
            return Some(Scattered {
                wi: sample.wi,
                weight: sample.weight / delta_share,
                origin: Origin::Certain,
                eta: sample.eta,
            });
        }
        if delta_share > 0.0 {
            lobe = (lobe - delta_share) / (1.0 - delta_share);
        }
        let wi = bsdf.sample(wo, lobe, u)?;
        let same_side = self.surface.faces_same_side(self.frame.to_world(wi));
        let evaluation = bsdf.evaluate(wo, wi, same_side);
        let pdf = evaluation.pdf * (1.0 - delta_share);
        (pdf != 0.0).then(|| Scattered {
            wi,
            weight: evaluation.value * (wi.z.abs() / pdf),
            origin: Origin::Scattered {
                from: self.receiver,
                pdf,
            },
            eta: if wo.z * wi.z < 0.0 { bsdf.eta() } else { 1.0 },
        })
    }
}

/// Rays of the neighbouring samples, for a ray straight from the camera. See [`crate::material::Patch::at`].
pub(super) fn neighbours(
    world: &World,
    batch: &Batch,
    ray: &Ray,
    from_camera: bool,
) -> Option<[Ray; 2]> {
    (from_camera && batch.step > 0.0).then(|| world.camera.neighbours(ray, batch.step))
}

/// Frame in which a constant material is evaluated.
#[inline]
pub(super) fn shading_frame(world: &World, bsdf: &Bsdf, surface: &Surface) -> Frame {
    if bsdf.is_anisotropic() {
        Frame::along(surface.shading_normal, surface.tangent(&world.shapes))
    } else {
        Frame::around(surface.shading_normal)
    }
}

/// Surface as lights see it.
#[inline]
pub(super) fn receiver(bsdf: &Bsdf, surface: &Surface) -> Receiver {
    Receiver {
        point: surface.point,
        normal: surface.facing_normal(),
        both_sides: bsdf.transmits(),
    }
}

/// Emission of a surface towards the path, weighted against the light samples that could have found it.
#[inline]
fn emitted_light(world: &World, origin: &Origin, surface: &Surface) -> Vec3 {
    let Some((index, emitter)) = world.lights.emitter(surface.shape) else {
        return Vec3::ZERO;
    };
    let radiance = emitter.radiance_of(surface);
    match origin {
        Origin::Certain => radiance,
        Origin::Scattered { from, pdf } if radiance != Vec3::ZERO => {
            let choice = world.lights.probability(from.point, index);
            radiance * power_heuristic(*pdf, choice * emitter.pdf(from, surface))
        }
        Origin::Scattered { .. } | Origin::Hidden => Vec3::ZERO,
    }
}

/// Light from outside the scene, weighted against the light samples that could have found it.
fn escaped_light(world: &World, origin: &Origin, dir: Vec3) -> Vec3 {
    let lights = &world.lights;
    match origin {
        Origin::Certain => lights.escaped(dir),
        Origin::Scattered { from, pdf } => lights
            .escaped_from(from, dir)
            .map(|(light, radiance, density)| {
                let choice = lights.probability(from.point, light);
                radiance * power_heuristic(*pdf, choice * density)
            })
            .sum(),
        Origin::Hidden => Vec3::ZERO,
    }
}
