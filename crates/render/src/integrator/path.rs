//! Path tracing with next-event estimation and multiple importance sampling, expecting what pbrt-v3's
//! `path` expects.
//!
//! pbrt traces two rays per vertex for the light it asks there: a shadow ray to a sample of the light, and a
//! ray along a sample of the BSDF to see whether it meets the light. Here the second is the ray that
//! continues the path: what it meets is added with the weight of that technique. Every continuation is
//! traced, the last one too, so the expectation is the same and a third of the rays is saved.

use antumbra::Ray;
use glam::Vec3;

use super::{ShadowQueue, Wave, dimension, power_heuristic};
use crate::frame::Frame;
use crate::hits::Hits;
use crate::light::Receiver;
use crate::sampler::Stream;
use crate::surface::Surface;
use crate::tracer::Tracer;
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
    hits: Hits,
}

/// Paths under way, one array per property.
#[derive(Debug, Default)]
struct Paths {
    rays: Vec<Ray>,
    samples: Vec<u32>,
    throughput: Vec<Vec3>,
    /// Squared ratios of refraction met so far: roulette must not punish paths inside glass, whose radiance
    /// is compressed and expands again when they leave.
    expansion: Vec<f32>,
    origin: Vec<Origin>,
}

/// How a ray came about, as far as the light it meets needs to know.
#[derive(Clone, Copy, Debug)]
enum Origin {
    /// The camera or a delta lobe: no light sample could have found what it meets.
    Certain,
    /// A BSDF sample of this density from this point.
    Scattered { from: Receiver, pdf: f32 },
}

impl Paths {
    fn clear(&mut self) {
        self.rays.clear();
        self.samples.clear();
        self.throughput.clear();
        self.expansion.clear();
        self.origin.clear();
    }

    fn push(&mut self, ray: Ray, sample: u32, throughput: Vec3, expansion: f32, origin: Origin) {
        self.rays.push(ray);
        self.samples.push(sample);
        self.throughput.push(throughput);
        self.expansion.push(expansion);
        self.origin.push(origin);
    }
}

impl PathTracer {
    /// `max_depth` scattering events at most; roulette once the throughput falls below `rr_threshold`.
    pub fn new(max_depth: u32, rr_threshold: f32) -> Self {
        Self {
            max_depth,
            rr_threshold,
            current: Paths::default(),
            next: Paths::default(),
            hits: Hits::default(),
        }
    }

    /// Traces a wave to its end.
    pub fn trace(
        &mut self,
        world: &World,
        tracer: &mut Tracer,
        wave: &mut Wave,
        shadows: &mut ShadowQueue,
    ) {
        self.current.clear();
        for (sample, &ray) in wave.rays.iter().enumerate() {
            let sample = sample as u32;
            self.current
                .push(ray, sample, Vec3::ONE, 1.0, Origin::Certain);
        }
        let mut depth = 0;
        while !self.current.rays.is_empty() {
            self.hits.find(&world.shapes, tracer, &self.current.rays);
            self.next.clear();
            for index in 0..self.current.rays.len() {
                self.advance(world, wave, shadows, index, depth);
            }
            shadows.flush(tracer, wave);
            std::mem::swap(&mut self.current, &mut self.next);
            depth += 1;
        }
    }

    /// Handles what one path met: its emission, a light sample, the next ray.
    fn advance(
        &mut self,
        world: &World,
        wave: &mut Wave,
        shadows: &mut ShadowQueue,
        index: usize,
        depth: u32,
    ) {
        let sample = self.current.samples[index];
        let ray = self.current.rays[index];
        let throughput = self.current.throughput[index];
        let origin = self.current.origin[index];
        let Some(surface) = self.hits.surface(&world.shapes, &ray, index) else {
            let escaped = escaped_light(world, &origin, Vec3::from(ray.dir));
            wave.emitted[sample as usize] += throughput * escaped;
            return;
        };
        wave.emitted[sample as usize] += throughput * emitted_light(world, &origin, &surface);
        if depth < self.max_depth {
            let vertex = Vertex {
                world,
                surface: &surface,
                stream: &wave.streams[sample as usize],
                dimension: dimension::FIRST.wrapping_add(depth.wrapping_mul(PER_VERTEX)),
                sample,
                throughput,
            };
            let expansion = self.current.expansion[index];
            self.scatter(&vertex, shadows, expansion, depth);
        }
    }

    fn scatter(&mut self, vertex: &Vertex, shadows: &mut ShadowQueue, expansion: f32, depth: u32) {
        let Vertex {
            world,
            surface,
            stream,
            dimension,
            sample,
            throughput,
        } = *vertex;
        let bsdf = world.bsdf(surface.shape);
        if bsdf.is_black() {
            return;
        }
        let frame = shading_frame(world, surface);
        let wo = frame.to_local(surface.wo);
        let lobe = stream.uniform(dimension + LOBE);
        let (wi, weight, origin, refracted) = if let Some(specular) = bsdf.specular() {
            let Some(lobe) = specular.sample(wo, lobe) else {
                return;
            };
            (
                frame.to_world(lobe.wi),
                lobe.weight,
                Origin::Certain,
                lobe.transmits,
            )
        } else {
            let receiver = receiver(world, surface);
            vertex.ask_light(&frame, wo, &receiver, shadows);
            let Some(local) = bsdf.sample(wo, lobe, stream.pair(dimension + DIRECTION)) else {
                return;
            };
            let wi = frame.to_world(local);
            let evaluation = bsdf.evaluate(wo, local, surface.faces_same_side(wi));
            if evaluation.pdf == 0.0 {
                return;
            }
            let origin = Origin::Scattered {
                from: receiver,
                pdf: evaluation.pdf,
            };
            let weight = evaluation.value * (local.z.abs() / evaluation.pdf);
            (wi, weight, origin, bsdf.transmits() && wo.z * local.z < 0.0)
        };
        let mut throughput = throughput * weight;
        if throughput == Vec3::ZERO {
            return;
        }
        let mut expansion = expansion;
        if refracted {
            let eta = bsdf.eta();
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
                    return;
                }
                throughput /= 1.0 - end;
            }
        }
        self.next
            .push(surface.ray_along(wi), sample, throughput, expansion, origin);
    }
}

/// A point where a path scatters.
struct Vertex<'a> {
    world: &'a World,
    surface: &'a Surface,
    stream: &'a Stream,
    /// First dimension of this vertex.
    dimension: u32,
    sample: u32,
    throughput: Vec3,
}

impl Vertex<'_> {
    /// Queues a shadow ray to a sample of one light.
    fn ask_light(&self, frame: &Frame, wo: Vec3, receiver: &Receiver, shadows: &mut ShadowQueue) {
        let lights = &self.world.lights;
        let choice = self.stream.uniform(self.dimension + LIGHT_CHOICE);
        let Some((index, probability)) = lights.choose(receiver.point, choice) else {
            return;
        };
        let u = self.stream.pair(self.dimension + LIGHT);
        let Some(light) = lights.all()[index].sample(receiver, u) else {
            return;
        };
        let wi = frame.to_local(light.wi);
        let bsdf = self.world.bsdf(self.surface.shape);
        let evaluation = bsdf.evaluate(wo, wi, self.surface.faces_same_side(light.wi));
        let density = light.pdf * probability;
        let technique = if light.is_delta {
            1.0
        } else {
            power_heuristic(density, evaluation.pdf)
        };
        let brought = self.throughput
            * evaluation.value
            * light.radiance
            * (wi.z.abs() * technique / density);
        if brought != Vec3::ZERO {
            shadows.push(light.shadow_ray(self.surface), self.sample, brought);
        }
    }
}

/// The frame in which the material of a surface is evaluated.
pub(super) fn shading_frame(world: &World, surface: &Surface) -> Frame {
    if world.bsdf(surface.shape).is_anisotropic() {
        Frame::along(surface.shading_normal, surface.tangent(&world.shapes))
    } else {
        Frame::around(surface.shading_normal)
    }
}

/// The surface as lights see it.
pub(super) fn receiver(world: &World, surface: &Surface) -> Receiver {
    Receiver {
        point: surface.point,
        normal: surface.facing_normal(),
        both_sides: world.bsdf(surface.shape).transmits(),
    }
}

/// Emission of a surface towards the path, weighted against the light samples that could have found it.
fn emitted_light(world: &World, origin: &Origin, surface: &Surface) -> Vec3 {
    let Some((index, emitter)) = world.lights.emitter(surface.shape) else {
        return Vec3::ZERO;
    };
    let radiance = emitter.radiance(surface.normal, surface.wo);
    match origin {
        Origin::Certain => radiance,
        Origin::Scattered { from, pdf } if radiance != Vec3::ZERO => {
            let choice = world.lights.probability(from.point, index);
            radiance * power_heuristic(*pdf, choice * emitter.pdf(from, surface))
        }
        Origin::Scattered { .. } => Vec3::ZERO,
    }
}

/// Light from outside the scene, weighted likewise.
fn escaped_light(world: &World, origin: &Origin, dir: Vec3) -> Vec3 {
    let lights = world.lights.all().iter().enumerate();
    lights
        .filter(|(_, light)| light.escaped_radiance() != Vec3::ZERO)
        .map(|(index, light)| {
            let weight = match origin {
                Origin::Certain => 1.0,
                Origin::Scattered { from, pdf } => {
                    let choice = world.lights.probability(from.point, index);
                    power_heuristic(*pdf, choice * light.escaped_pdf(from, dir))
                }
            };
            light.escaped_radiance() * weight
        })
        .sum()
}
