//! Path tracing with next-event estimation and multiple importance sampling, with the expected values of pbrt-v3's
//! `path`.
//!
//! # Rays per vertex
//!
//! pbrt traces two rays per vertex for the light that it samples there: a shadow ray to a sample of the light, and a
//! ray along a sample of the BSDF. Here the second is the ray that continues the path, whose light is added with the
//! weight of BSDF sampling. Every continuation is traced, even the last, so the expectation is the same with a third
//! fewer rays. The last continuation needs only the light that it hits. An occlusion query finds it, see
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
//! Vertices are shaded a block at a time, in columns ([`crate::columns`]). Lambert surfaces, area lights and skies are
//! computed in vectors. Other materials and lights fill their lanes one by one, between the vector loops.
//!
//! - `vertices.rs`: the points where paths scatter
//! - `scatter.rs`: the rays that continue the paths

mod scatter;
mod vertices;

use std::borrow::Cow;

use antumbra::{Hit, Ray};
use glam::Vec3;

use super::arrival::Arrivals;
use super::hits::Hits;
use super::tracer::Tracer;
use super::{Batch, ShadowQueue, dimension, power_heuristic};
use crate::columns::BLOCK;
use crate::light::{LightBlock, Receiver};
use crate::material::Material;
use crate::material::bsdf::{Bsdf, Evaluation};
use crate::surface::{Frame, Surface};
use crate::world::World;
use scatter::Continuations;
use vertices::Vertices;

/// Dimensions used at each vertex of a path.
pub(super) const LIGHT_CHOICE: u32 = 0;
pub(super) const LIGHT: u32 = 1;
pub(super) const LOBE: u32 = 2;
pub(super) const DIRECTION: u32 = 3;
pub(super) const ROULETTE: u32 = 4;
const PER_VERTEX: u32 = 5;

/// Russian roulette is played from this vertex on.
pub(super) const ROULETTE_DEPTH: u32 = 4;

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
    lit: Hits,
    /// Places of the rays that hit something.
    met: Vec<u32>,
    block: Box<Block>,
}

/// Columns of the block of vertices under way.
#[derive(Debug, Default)]
struct Block {
    vertices: Vertices,
    lights: LightBlock,
    arrivals: Arrivals,
    continuations: Continuations,
}

/// Paths under way.
#[derive(Debug)]
pub(super) struct Paths<T = State> {
    pub rays: Vec<Ray>,
    pub states: Vec<T>,
}

/// A path beside its ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    sample: u32,
    throughput: Vec3,
    /// Product of squared ratios of refraction so far. Radiance is compressed inside glass and expands again outside,
    /// for which roulette must not punish a path.
    expansion: f32,
    origin: Origin,
}

/// Origin of a ray, which decides the weight of the light that it hits.
#[derive(Clone, Copy, Debug)]
pub(super) enum Origin {
    /// The camera or a delta lobe: no light sample could have found the light.
    Certain,
    /// A BSDF sample of this density from this point.
    Scattered { from: Receiver, pdf: f32 },
    /// A BSDF sample that went on through a surface without a material: light does not count.
    Hidden,
}

impl<T> Default for Paths<T> {
    fn default() -> Self {
        Self {
            rays: Vec::new(),
            states: Vec::new(),
        }
    }
}

impl<T> Paths<T> {
    pub fn clear(&mut self) {
        self.rays.clear();
        self.states.clear();
    }

    #[inline(always)]
    pub fn push(&mut self, ray: Ray, state: T) {
        self.rays.push(ray);
        self.states.push(state);
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
            lit: Hits::default(),
            met: Vec::new(),
            block: Box::default(),
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
            let state = State {
                sample: sample as u32,
                throughput: Vec3::ONE,
                expansion: 1.0,
                origin: Origin::Certain,
            };
            self.current.push(ray, state);
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
                let samples = self.current.states.iter().map(|state| state.sample);
                self.hits.find(tracer, &self.current.rays, samples);
                self.through.clear();
                self.escape(world, batch);
                for first in (0..self.met.len()).step_by(BLOCK) {
                    self.shade(world, batch, shadows, first, depth, from_camera);
                }
                shadows.flush(tracer, batch);
                std::mem::swap(&mut self.current, &mut self.through);
                from_camera = false;
            }
            std::mem::swap(&mut self.current, &mut self.next);
            depth = depth.saturating_add(1);
        }
    }

    /// Adds the light of the rays that leave the scene, and lists the others.
    fn escape(&mut self, world: &World, batch: &mut Batch) {
        self.met.clear();
        for (index, ray) in self.current.rays.iter().enumerate() {
            if self.hits.hit(index).is_some() {
                self.met.push(index as u32);
                continue;
            }
            let state = &self.current.states[index];
            let light = escaped_light(world, &state.origin, Vec3::from(ray.dir));
            batch.emitted[state.sample as usize] += state.throughput * light;
        }
    }

    /// Shades a block of the hits, from place `first` of the list on.
    fn shade(
        &mut self,
        world: &World,
        batch: &mut Batch,
        shadows: &mut ShadowQueue,
        first: usize,
        depth: u32,
        from_camera: bool,
    ) {
        let (places, later) = self.met[first..].split_at(BLOCK.min(self.met.len() - first));
        self.hits
            .prefetch(&world.shapes, &later[..later.len().min(BLOCK)]);
        let Block {
            vertices,
            lights,
            arrivals,
            continuations,
        } = &mut *self.block;
        let isa = self.hits.isa();
        self.hits.compute(&world.shapes, &self.current.rays, places);
        let asked = &mut lights.asked;
        let meeting = vertices::Meeting {
            world,
            hits: &self.hits,
            current: &self.current,
            places,
            ends: depth >= self.max_depth,
            from_camera,
        };
        vertices.meet(isa, &meeting, batch, &mut self.through, asked);
        if vertices.is_empty() {
            return;
        }
        let surfaces = self.hits.block();
        let dimension = first_dimension(depth);
        let count = vertices.count();
        let streams = &vertices.streams;
        streams.uniforms(isa, dimension.wrapping_add(LIGHT_CHOICE), &mut asked.choice);
        streams.pairs(isa, dimension.wrapping_add(LIGHT), &mut asked.u);
        lights.sample(isa, &world.lights, count);
        let points = vertices.on(surfaces);
        arrivals.evaluate(isa, &points, &lights.found);
        for other in &vertices.others {
            let lane = other.lane;
            if lights.found.found[lane] != 0 {
                let bsdf = vertices.bsdf(world, other);
                arrivals.scatter(lane, |wi, reflects| {
                    let found = bsdf.evaluate(vertices.local.wo.get(lane), wi, reflects);
                    let pdf = found.pdf * (1.0 - bsdf.delta_share());
                    Evaluation { pdf, ..found }
                });
            }
        }
        arrivals.bring(isa, &points, &lights.found);
        arrivals.queue(count, |lane| vertices.sample[lane], shadows);
        continuations.scatter(isa, world, vertices, surfaces, dimension);
        let roulette = (depth >= ROULETTE_DEPTH)
            .then_some((self.rr_threshold, dimension.wrapping_add(ROULETTE)));
        continuations.follow(isa, vertices, surfaces, roulette);
        continuations.queue(vertices, &lights.asked, &mut self.next);
    }

    /// Queues the last rays, each as a shadow ray to the first light on its way. Other surfaces do not matter.
    fn end(&mut self, world: &World, batch: &mut Batch, shadows: &mut ShadowQueue) {
        let Paths { rays, states } = &self.current;
        self.lit.find_emitters(&world.emitters, rays);
        for (index, (ray, state)) in rays.iter().zip(states).enumerate() {
            let State {
                sample,
                throughput,
                ref origin,
                ..
            } = *state;
            // A throughput that is not finite spoils its sample, even without a hit.
            batch.emitted[sample as usize] += throughput * Vec3::ZERO;
            let (light, ray) = match self.lit.surface_and_way(&world.shapes, rays, index) {
                None => (escaped_light(world, origin, Vec3::from(ray.dir)), *ray),
                Some((surface, ray)) => (emitted_light(world, origin, &surface), ray),
            };
            let brought = throughput * light;
            if brought != Vec3::ZERO {
                shadows.push(ray, sample, brought);
            }
        }
    }
}

/// First dimension of the vertices at this depth.
pub(super) fn first_dimension(depth: u32) -> u32 {
    dimension::FIRST.wrapping_add(depth.wrapping_mul(PER_VERTEX))
}

/// BSDF of the surface that a ray of a sample hits, and its frame. `None` without a material.
pub fn shade<'a>(
    world: &'a World,
    batch: &Batch,
    (ray, sample, from_camera): (&Ray, u32, bool),
    surface: &Surface,
    hit: &Hit,
) -> Option<(Cow<'a, Bsdf>, Frame)> {
    match world.material(surface.shape) {
        Material::None => None,
        Material::Constant(bsdf) => {
            Some((Cow::Borrowed(bsdf), shading_frame(world, bsdf, surface)))
        }
        Material::Varying(varying) => {
            // Rays of the neighbouring samples, see `Patch::at`.
            let neighbours = (from_camera && batch.step > 0.0).then(|| {
                let moved = batch.camera(world, sample);
                (moved.as_ref().unwrap_or(&world.camera)).neighbours(ray, batch.step)
            });
            let (bsdf, frame) = varying.shade(&world.shapes, surface, hit, neighbours.as_ref());
            Some((Cow::Owned(bsdf), frame))
        }
    }
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

/// A direction drawn from a BSDF.
pub(super) struct Direction {
    /// Direction in the frame of the BSDF.
    pub wi: Vec3,
    pub weight: Vec3,
    /// `None` for a delta lobe.
    pub pdf: Option<f32>,
    /// Index of refraction inside over outside, if the path passes to the other side. Otherwise 1.
    pub eta: f32,
}

/// Draws a direction from a BSDF. `None` where the path ends.
pub(super) fn draw(
    bsdf: &Bsdf,
    wo: Vec3,
    mut lobe: f32,
    u: [f32; 2],
    is_on_same_side: impl Fn(Vec3) -> bool,
) -> Option<Direction> {
    let delta_share = bsdf.delta_share();
    if lobe < delta_share {
        let sample = bsdf.sample_delta(wo, lobe / delta_share)?;
        return Some(Direction {
            wi: sample.wi,
            weight: sample.weight / delta_share,
            pdf: None,
            eta: sample.eta,
        });
    }
    if delta_share > 0.0 {
        lobe = (lobe - delta_share) / (1.0 - delta_share);
    }
    let wi = bsdf.sample(wo, lobe, u)?;
    let found = bsdf.evaluate(wo, wi, is_on_same_side(wi));
    let pdf = found.pdf * (1.0 - delta_share);
    (pdf != 0.0).then(|| Direction {
        wi,
        weight: found.value * (wi.z.abs() / pdf),
        pdf: Some(pdf),
        eta: if wo.z * wi.z < 0.0 { bsdf.eta() } else { 1.0 },
    })
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
pub(super) fn emitted_light(world: &World, origin: &Origin, surface: &Surface) -> Vec3 {
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
pub(super) fn escaped_light(world: &World, origin: &Origin, dir: Vec3) -> Vec3 {
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
