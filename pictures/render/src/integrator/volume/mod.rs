//! Path tracing through participating media, with the expected values of pbrt-v3's `volpath`.
//!
//! A path has vertices on surfaces and inside media. Light sampling and sampling of the BSDF or phase function are
//! combined by the power heuristic, as in `path/`.
//!
//! Rays and light pass surfaces without a material, at the same depth, and change the medium there. A ray to a light is
//! therefore traced from surface to surface, and attenuated in between (`connections.rs`). Where every surface
//! blocks light, an occlusion query decides.
//!
//! Light that enters a body with subsurface scattering walks until it leaves (`wander.rs`).
//!
//! pbrt-v3 does not find the emission of a surface without a material by sampling the BSDF, and yet weights light samples
//! as if it did. Here both techniques find such light.

mod connections;
mod wander;

use antumbra::Ray;
use glam::Vec3;

use super::Batch;
use super::hits::Hits;
use super::path::{DIRECTION, LIGHT, LIGHT_CHOICE, LOBE, ROULETTE, ROULETTE_DEPTH};
use super::path::{
    Origin, Paths, draw, emitted_light, escaped_light, first_dimension, receiver, shade,
};
use super::tracer::Tracer;
use crate::light::{LightSample, Receiver};
use crate::material::Material;
use crate::material::bsdf::Bsdf;
use crate::medium::{Event, Medium, Random, phase};
use crate::sampler::Stream;
use crate::surface::{Frame, Surface};
use crate::world::World;
use connections::{Connection, Connections};
use wander::Walk;

/// Dimension of the seed for tracking through media. Far from the dimensions of all vertices.
const TRACKING: u32 = 0x8000_0000;

/// The integrator with its buffers.
#[derive(Debug)]
pub struct VolumePathTracer {
    max_depth: u32,
    rr_threshold: f32,
    current: Paths<State>,
    next: Paths<State>,
    hits: Hits,
    connections: Connections,
}

/// A path beside its ray.
#[derive(Clone, Copy, Debug)]
struct State {
    sample: u32,
    throughput: Vec3,
    /// Product of squared ratios of refraction so far, see `path/`.
    expansion: f32,
    origin: Origin,
    /// Number of scattering events so far.
    depth: u32,
    /// Medium in which the ray begins. `None` is vacuum.
    medium: Option<u32>,
    /// Walk inside of a body, if the path is on one.
    walk: Option<Walk>,
    /// Random numbers for tracking.
    random: Random,
    /// Whether the ray comes straight from the camera.
    from_camera: bool,
}

impl VolumePathTracer {
    /// Integrator of at most `max_depth` scattering events, with roulette for a throughput below `rr_threshold`.
    pub fn new(max_depth: u32, rr_threshold: f32) -> Self {
        Self {
            max_depth,
            rr_threshold,
            current: Paths::default(),
            next: Paths::default(),
            hits: Hits::default(),
            connections: Connections::default(),
        }
    }

    /// Traces a batch to its end.
    pub fn trace(&mut self, world: &World, tracer: &mut Tracer, batch: &mut Batch) {
        self.current.clear();
        for (sample, &ray) in batch.rays.iter().enumerate() {
            let state = State {
                sample: sample as u32,
                throughput: Vec3::ONE,
                expansion: 1.0,
                origin: Origin::Certain,
                depth: 0,
                medium: world.camera.medium(),
                walk: None,
                random: Random::new(batch.streams[sample].seed(TRACKING)),
                from_camera: true,
            };
            self.current.push(ray, state);
        }
        while !self.current.rays.is_empty() && !tracer.is_stopped() {
            let samples = self.current.states.iter().map(|state| state.sample);
            self.hits.find(tracer, &self.current.rays, samples);
            self.next.clear();
            for index in 0..self.current.rays.len() {
                self.advance(world, batch, index);
            }
            // A sample has one connection at most, so the order of its sums does not depend on other samples.
            self.connections.trace(world, tracer, batch);
            std::mem::swap(&mut self.current, &mut self.next);
        }
    }

    /// Carries a path to its next vertex.
    fn advance(&mut self, world: &World, batch: &mut Batch, index: usize) {
        let ray = self.current.rays[index];
        let mut state = self.current.states[index];
        if let Some(walk) = state.walk {
            self.wander(world, batch, index, (walk, state));
            return;
        }
        let dir = Vec3::from(ray.dir);
        let hit = self.hits.hit(index).copied();
        if let Some(medium) = medium(world, state.medium) {
            let end = hit.map_or(f32::INFINITY, |hit| hit.t);
            let (org, throughput) = (Vec3::from(ray.org), state.throughput);
            match medium.event(org, dir, end, throughput, &mut state.random) {
                Event::Scattered { distance, weight } => {
                    state.throughput *= weight;
                    self.scatter_in(world, batch, medium, org + dir * distance, dir, state);
                    return;
                }
                Event::Passed { weight } => state.throughput *= weight,
            }
        }
        let sample = state.sample as usize;
        let (Some(hit), Some(surface)) = (
            hit,
            self.hits.surface(&world.shapes, &self.current.rays, index),
        ) else {
            batch.emitted[sample] += state.throughput * escaped_light(world, &state.origin, dir);
            return;
        };
        batch.emitted[sample] += state.throughput * emitted_light(world, &state.origin, &surface);
        let own = (&ray, state.sample, state.from_camera);
        let Some((bsdf, frame)) = shade(world, batch, own, &surface, &hit) else {
            state.medium = medium_beyond(world, &surface, dir, state.medium);
            state.from_camera = false;
            if state.throughput != Vec3::ZERO {
                self.next.push(surface.ray_along(dir), state);
            }
            return;
        };
        if state.depth < self.max_depth && !bsdf.is_black() {
            self.scatter_at(world, batch, &surface, (&bsdf, frame), state);
        }
    }

    /// Scatters a path at a surface.
    fn scatter_at(
        &mut self,
        world: &World,
        batch: &Batch,
        surface: &Surface,
        (bsdf, frame): (&Bsdf, Frame),
        mut state: State,
    ) {
        let stream = batch.streams[state.sample as usize];
        let dimension = first_dimension(state.depth);
        let wo = frame.to_local(surface.wo);
        if let Some(body) = bsdf.body() {
            let enters = body.chance_to_enter(wo.z, !bsdf.is_black_surface());
            if state.random.next() < enters {
                self.enter(world, surface, (body, frame), enters, state);
                return;
            }
            state.throughput /= 1.0 - enters;
        }
        let at = receiver(bsdf, surface);
        let delta_share = bsdf.delta_share();
        if delta_share < 1.0
            && let Some((light, chance)) = light_sample(world, &at, &stream, dimension)
        {
            let wi = frame.to_local(light.wi);
            let found = bsdf.evaluate(wo, wi, surface.faces_same_side(light.wi));
            let density = light.pdf * chance;
            let technique = light.technique(density, found.pdf * (1.0 - delta_share));
            let brought = found.value * light.radiance * (wi.z.abs() * technique / density);
            self.connections.push(Connection {
                ray: light.shadow_ray(surface),
                light: state.throughput * brought,
                sample: state.sample,
                medium: medium_beyond(world, surface, light.wi, state.medium),
                random: state.random,
            });
            state.random.skip();
        }
        let lobe = stream.uniform(dimension.wrapping_add(LOBE));
        let u = stream.pair(dimension.wrapping_add(DIRECTION));
        let is_on_same_side = |wi| surface.faces_same_side(frame.to_world(wi));
        let Some(found) = draw(bsdf, wo, lobe, u, is_on_same_side) else {
            return;
        };
        if found.eta != 1.0 {
            let square = found.eta * found.eta;
            let enters = surface.wo.dot(surface.normal) > 0.0;
            state.expansion *= if enters { square } else { 1.0 / square };
        }
        state.throughput *= found.weight;
        state.origin = match found.pdf {
            Some(pdf) => Origin::Scattered { from: at, pdf },
            None => Origin::Certain,
        };
        let dir = frame.to_world(found.wi);
        state.medium = medium_beyond(world, surface, dir, state.medium);
        self.go_on(surface.ray_along(dir), state, &stream, dimension);
    }

    /// Scatters a path inside a medium.
    fn scatter_in(
        &mut self,
        world: &World,
        batch: &Batch,
        medium: &Medium,
        point: Vec3,
        dir: Vec3,
        mut state: State,
    ) {
        if state.depth >= self.max_depth {
            return;
        }
        let stream = batch.streams[state.sample as usize];
        let dimension = first_dimension(state.depth);
        let at = Receiver {
            point,
            normal: dir,
            both_sides: true,
        };
        if let Some((light, chance)) = light_sample(world, &at, &stream, dimension) {
            let value = phase::density(medium.asymmetry, dir.dot(light.wi));
            let density = light.pdf * chance;
            let technique = light.technique(density, value);
            let brought = light.radiance * (value * technique / density);
            self.connections.push(Connection {
                ray: light.ray_from(point, world.shapes.origin_offset),
                light: state.throughput * brought,
                sample: state.sample,
                medium: state.medium,
                random: state.random,
            });
            state.random.skip();
        }
        let u = stream.pair(dimension.wrapping_add(DIRECTION));
        let wi = phase::sample(medium.asymmetry, dir, u);
        state.origin = Origin::Scattered {
            from: at,
            pdf: phase::density(medium.asymmetry, dir.dot(wi)),
        };
        let ray = Ray {
            org: point.to_array(),
            dir: wi.to_array(),
            tnear: 0.0,
            tfar: f32::INFINITY,
        };
        self.go_on(ray, state, &stream, dimension);
    }

    /// Queues the ray that continues a path, unless roulette ends it.
    fn go_on(&mut self, ray: Ray, mut state: State, stream: &Stream, dimension: u32) {
        let chance = (state.throughput * state.expansion).max_element();
        if state.throughput == Vec3::ZERO {
            return;
        }
        if state.depth >= ROULETTE_DEPTH && chance < self.rr_threshold {
            let end = (1.0 - chance).max(0.05);
            if stream.uniform(dimension.wrapping_add(ROULETTE)) < end {
                return;
            }
            state.throughput /= 1.0 - end;
        }
        state.depth += 1;
        state.from_camera = false;
        self.next.push(ray, state);
    }
}

/// Medium by its index.
fn medium(world: &World, index: Option<u32>) -> Option<&Medium> {
    index.map(|index| &world.media[index as usize])
}

/// Whether rays and light go on straight through a surface, which has no material.
fn lets_pass(world: &World, surface: &Surface) -> bool {
    matches!(world.material(surface.shape), Material::None)
}

/// Medium of a ray along `dir` that leaves a surface, which it reached through the medium `here`.
fn medium_beyond(world: &World, surface: &Surface, dir: Vec3, here: Option<u32>) -> Option<u32> {
    match &world.shapes[surface.shape].media {
        None => here,
        Some(media) if dir.dot(surface.normal) > 0.0 => media.outside,
        Some(media) => media.inside,
    }
}

/// Sample of one of the lights, with the probability of choosing that light.
fn light_sample(
    world: &World,
    at: &Receiver,
    stream: &Stream,
    dimension: u32,
) -> Option<(LightSample, f32)> {
    let u = stream.uniform(dimension.wrapping_add(LIGHT_CHOICE));
    let (light, chance) = world.lights.choose(at.point, u)?;
    let u = stream.pair(dimension.wrapping_add(LIGHT));
    let sample = world.lights.all()[light].sample(at, u)?;
    (chance > 0.0).then_some((sample, chance))
}
