//! Direct lighting along chains of perfectly specular reflections and transmissions, with the expected values of
//! pbrt-v3's `directlighting`.
//!
//! Both branches of a dielectric are followed, so a sample may have many rays at one depth. The place of a ray in the
//! tree of branches addresses its random values.
//!
//! At the end of a chain, shadow rays sample the lights. *Probes*, rays along samples of the BSDF, look for any
//! light. The power heuristic combines the two. A probe is an occlusion query before the emitter that it would hit,
//! see [`crate::light::EmitterTree`]. (pbrt sends one probe per light sample, each looking for one light. Fewer
//! probes that look for all lights have the same mean, and leave the work to shadow rays.)
//!
//! Rays go on through surfaces without a material, and do not see the emission of such a surface, as in pbrt-v3.

use std::ops::ControlFlow;

use antumbra_scene::DirectStrategy;
use glam::Vec3;

use super::arrival::{Arrivals, Points};
use super::hits::Hits;
use super::path::{Paths, receiver, shade};
use super::tracer::Tracer;
use super::{Batch, ENOUGH, ShadowQueue, dimension, power_heuristic};
use crate::columns::BLOCK;
use crate::light::{ElementSample, Light, LightBlock, LightSample, Receiver};
use crate::material::bsdf::Bsdf;
use crate::sampler::{Stream, mix};
use crate::surface::{Frame, Surface};
use crate::world::World;

/// The direct lighting integrator with its buffers.
#[derive(Debug)]
pub struct DirectLighting {
    strategy: DirectStrategy,
    max_depth: u32,
    /// Probes per surface point.
    probes_each: u32,
    current: Branches,
    next: Branches,
    /// Rays that go on through a surface without a material.
    through: Branches,
    hits: Hits,
    probes: Probes,
    /// Buffers to sample all lights in columns, unless a point takes too few samples.
    fan: Option<Box<Fan>>,
}

/// Light samples of one surface point, one per lane.
#[derive(Debug, Default)]
struct Fan {
    lights: LightBlock,
    arrivals: Arrivals,
}

/// Number of light samples of a point from which they are taken in columns, whose loops always run over all lanes.
const MANY: usize = 16;

/// A ray of the specular trees of a batch.
#[derive(Clone, Copy, Debug)]
struct Branch {
    sample: u32,
    throughput: Vec3,
    /// Place in the binary tree of branches. The camera ray has 1, the branches of n have 2n and 2n + 1.
    place: u64,
}

/// Rays of the specular trees of a batch at one depth.
type Branches = Paths<Branch>;

/// Rays along BSDF samples that look for lights.
#[derive(Debug, Default)]
struct Probes {
    queue: Paths<Probe>,
    /// Emitter on the way of each probe, if there is one.
    hits: Hits,
    shadows: ShadowQueue,
}

/// Use of the light that a probe finds.
#[derive(Clone, Copy, Debug)]
struct Probe {
    sample: u32,
    from: Receiver,
    /// Density of its direction, times the number of probes.
    density: f32,
    /// Throughput, BSDF and cosine over `density`.
    weight: Vec3,
}

/// Purpose of a random value.
#[derive(Clone, Copy)]
enum Purpose {
    LightChoice,
    Light,
    Lobe,
    Direction,
    Transmission,
}

impl DirectLighting {
    /// Integrator that follows specular chains of length `max_depth`. 1 follows none.
    pub fn new(strategy: DirectStrategy, max_depth: u32, lights: &[Light]) -> Self {
        let extended = lights.iter().filter(|light| !light.is_delta());
        let probes_each = match strategy {
            DirectStrategy::All => extended.map(Light::samples).max().unwrap_or(0),
            DirectStrategy::One => extended.count().min(1) as u32,
        };
        let samples = |light: &Light| light.samples() as usize * light.elements();
        let is_fan =
            strategy == DirectStrategy::All && lights.iter().map(samples).sum::<usize>() >= MANY;
        Self {
            strategy,
            max_depth,
            probes_each,
            current: Branches::default(),
            next: Branches::default(),
            through: Branches::default(),
            hits: Hits::default(),
            probes: Probes::default(),
            fan: is_fan.then(Box::default),
        }
    }

    /// Approximate length of the longest queue of probes so far: the room made for rays.
    #[cfg(test)]
    pub fn most_probes(&self) -> usize {
        self.probes.queue.rays.capacity()
    }

    /// Has every light sample taken by itself; returns whether they were taken in columns.
    #[cfg(test)]
    pub fn leave_columns(&mut self) -> bool {
        self.fan.take().is_some()
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
            let branch = Branch {
                sample: sample as u32,
                throughput: Vec3::ONE,
                place: 1,
            };
            self.current.push(ray, branch);
        }
        let mut depth = 0_u32;
        while !self.current.rays.is_empty() && !tracer.is_stopped() {
            self.next.clear();
            let mut step = Step {
                from_camera: depth == 0,
                follow: depth.saturating_add(1) < self.max_depth,
            };
            while !self.current.rays.is_empty() && !tracer.is_stopped() {
                let samples = self.current.states.iter().map(|branch| branch.sample);
                self.hits.find(tracer, &self.current.rays, samples);
                self.through.clear();
                for index in 0..self.current.rays.len() {
                    if tracer.is_stopped() {
                        break;
                    }
                    self.advance(world, tracer, batch, shadows, index, step);
                }
                shadows.flush(tracer, batch);
                self.probes.trace(world, tracer, batch, self.strategy);
                std::mem::swap(&mut self.current, &mut self.through);
                step.from_camera = false;
            }
            std::mem::swap(&mut self.current, &mut self.next);
            depth = depth.saturating_add(1);
        }
    }

    /// Handles the hit of one ray: emission, light samples and probes, specular branches.
    fn advance(
        &mut self,
        world: &World,
        tracer: &mut Tracer,
        batch: &mut Batch,
        shadows: &mut ShadowQueue,
        index: usize,
        step: Step,
    ) {
        let branch = self.current.states[index];
        let (sample, throughput) = (branch.sample, branch.throughput);
        let rays = &self.current.rays;
        let Some(surface) = self.hits.surface(&world.shapes, rays, index) else {
            let escaped = world.lights.escaped(Vec3::from(rays[index].dir));
            batch.emitted[sample as usize] += throughput * escaped;
            return;
        };
        let Some(hit) = self.hits.hit(index) else {
            return;
        };
        let own = (&rays[index], sample, step.from_camera);
        let Some((bsdf, frame)) = shade(world, batch, own, &surface, hit) else {
            let ray = surface.ray_along(rays[index].dir.into());
            self.through.push(ray, branch);
            return;
        };
        let bsdf = &*bsdf;
        batch.emitted[sample as usize] += throughput * world.lights.emitted(&surface);
        if bsdf.is_black() {
            return;
        }
        let wo = frame.to_local(surface.wo);
        let vertex = Vertex {
            world,
            surface: &surface,
            stream: batch.streams[sample as usize],
            bsdf,
            lambert: bsdf.lambert(),
            frame,
            wo,
            receiver: receiver(bsdf, &surface),
            branch,
            probes_each: self.probes_each,
        };
        let delta_share = bsdf.delta_share();
        if delta_share < 1.0 {
            self.light(&vertex, tracer, batch, shadows);
        }
        if step.follow && delta_share > 0.0 {
            vertex.follow(&mut self.next);
        }
    }

    /// Takes the light samples and probes of a point.
    fn light(
        &mut self,
        vertex: &Vertex,
        tracer: &mut Tracer,
        batch: &mut Batch,
        shadows: &mut ShadowQueue,
    ) {
        match self.strategy {
            DirectStrategy::All => match &mut self.fan {
                Some(fan) => vertex.ask_in_columns(fan, tracer, batch, shadows),
                None => vertex.ask_all(tracer, batch, shadows),
            },
            DirectStrategy::One => vertex.ask_one(tracer, batch, shadows),
        }
        for part in 0..self.probes_each {
            vertex.probe(part, &mut self.probes.queue);
            if self.probes.queue.rays.len() >= ENOUGH {
                self.probes
                    .trace(vertex.world, tracer, batch, self.strategy);
            }
        }
    }
}

/// Properties that rays of one depth share.
#[derive(Clone, Copy)]
struct Step {
    /// Whether the rays come straight from the camera.
    from_camera: bool,
    /// Whether specular branches are followed.
    follow: bool,
}

/// A surface point with all that light samples and probes need.
struct Vertex<'a> {
    world: &'a World,
    surface: &'a Surface,
    stream: Stream,
    bsdf: &'a Bsdf,
    /// Reflectance, if that is all there is to the BSDF.
    lambert: Option<Vec3>,
    frame: Frame,
    wo: Vec3,
    receiver: Receiver,
    branch: Branch,
    probes_each: u32,
}

impl Vertex<'_> {
    /// Dimension of the random values of a purpose. Differs for every branch, light and element.
    fn dimension(&self, purpose: Purpose, light: usize, element: usize) -> u32 {
        let address =
            mix((light as u64) << 32 | element as u64) ^ mix(self.branch.place) ^ purpose as u64;
        dimension::FIRST.wrapping_add(mix(address) as u32)
    }

    /// Samples of every element of every light, each with its own number of samples. To be taken by `try_for_each`, which
    /// makes plain loops of them.
    fn samples(&self) -> impl Iterator<Item = ElementSample> + '_ {
        let lights = self.world.lights.all().iter().enumerate();
        lights.flat_map(move |(light, found)| {
            let samples = found.samples();
            (0..found.elements()).flat_map(move |element| {
                let dimension = self.dimension(Purpose::Light, light, element);
                (0..samples).map(move |part| ElementSample {
                    light,
                    element,
                    samples,
                    u: self.stream.pair_of(dimension, part, samples),
                })
            })
        })
    }

    /// Takes all [samples](Self::samples).
    fn ask_all(&self, tracer: &mut Tracer, batch: &mut Batch, shadows: &mut ShadowQueue) {
        let _ = self.samples().try_for_each(|sample| {
            let light = &self.world.lights.all()[sample.light];
            if let Some(found) = light.sample_element(&self.receiver, sample.element, sample.u) {
                self.queue(&found, sample.samples as f32, shadows);
                if shadows.relieve(tracer, batch) {
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        });
    }

    /// [`Self::ask_all`], a block of samples at a time.
    fn ask_in_columns(
        &self,
        fan: &mut Fan,
        tracer: &mut Tracer,
        batch: &mut Batch,
        shadows: &mut ShadowQueue,
    ) {
        fan.lights.asked.fill(&self.receiver);
        let mut count = 0;
        let end = self.samples().try_for_each(|sample| {
            fan.lights.ask_element(count, &sample);
            count += 1;
            if count == BLOCK {
                self.queue_block(fan, tracer, count, shadows);
                count = 0;
                if shadows.relieve(tracer, batch) {
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        });
        if end.is_continue() && count > 0 {
            self.queue_block(fan, tracer, count, shadows);
            shadows.relieve(tracer, batch);
        }
    }

    /// Queues the shadow rays of the first `count` lanes.
    fn queue_block(
        &self,
        Fan { lights, arrivals }: &mut Fan,
        tracer: &Tracer,
        count: usize,
        shadows: &mut ShadowQueue,
    ) {
        let isa = tracer.isa();
        lights.sample_elements(isa, &self.world.lights, count);
        let found = &lights.found;
        arrivals.evaluate(isa, self, found);
        if self.lambert.is_none() {
            for lane in (0..count).filter(|&lane| found.found[lane] != 0) {
                arrivals.scatter(lane, |wi, reflects| {
                    self.bsdf.evaluate(self.wo, wi, reflects)
                });
            }
        }
        arrivals.bring(isa, self, found);
        arrivals.queue(count, |_| self.branch.sample, shadows);
    }

    /// Samples one light, once.
    fn ask_one(&self, tracer: &mut Tracer, batch: &mut Batch, shadows: &mut ShadowQueue) {
        let choice = self.dimension(Purpose::LightChoice, 0, 0);
        let lights = &self.world.lights;
        let choice = lights.choose(self.receiver.point, self.stream.uniform(choice));
        let Some((index, probability)) = choice else {
            return;
        };
        let u = self.stream.pair(self.dimension(Purpose::Light, 0, 0));
        if let Some(found) = lights.all()[index].sample(&self.receiver, u) {
            self.queue(&found, probability, shadows);
            shadows.relieve(tracer, batch);
        }
    }

    /// Queues the shadow ray of a light sample of which `expected` are taken on average.
    fn queue(&self, found: &LightSample, expected: f32, shadows: &mut ShadowQueue) {
        let bsdf = self.bsdf;
        let wi = self.frame.to_local(found.wi);
        let evaluation = bsdf.evaluate(self.wo, wi, self.surface.faces_same_side(found.wi));
        let density = found.pdf * expected;
        let technique = found.technique(density, evaluation.pdf * self.probes_each as f32);
        let brought = self.branch.throughput
            * evaluation.value
            * found.radiance
            * (wi.z.abs() * technique / density);
        if brought != Vec3::ZERO {
            shadows.push(found.shadow_ray(self.surface), self.branch.sample, brought);
        }
    }

    /// Queues the specular branches.
    fn follow(&self, next: &mut Branches) {
        let choice = self.dimension(Purpose::Transmission, 0, 0);
        let choice = self.stream.uniform(choice);
        let lobes = [
            self.bsdf.delta_reflection(self.wo),
            self.bsdf.delta_transmission(self.wo, choice),
        ];
        for (side, lobe) in lobes.into_iter().enumerate() {
            let Some(lobe) = lobe else { continue };
            let throughput = self.branch.throughput * lobe.weight;
            if throughput != Vec3::ZERO {
                let ray = self.surface.ray_along(self.frame.to_world(lobe.wi));
                // Beyond 63 levels places repeat, which correlates values but adds no bias.
                let place = self.branch.place.wrapping_mul(2);
                let branch = Branch {
                    sample: self.branch.sample,
                    throughput,
                    place: place.wrapping_add(side as u64),
                };
                next.push(ray, branch);
            }
        }
    }

    /// Queues a probe.
    fn probe(&self, part: u32, probes: &mut Paths<Probe>) {
        let bsdf = self.bsdf;
        let u = |purpose| {
            let dimension = self.dimension(purpose, 0, 0);
            self.stream.pair_of(dimension, part, self.probes_each)
        };
        let Some(local) = bsdf.sample(self.wo, u(Purpose::Lobe)[0], u(Purpose::Direction)) else {
            return;
        };
        let wi = self.frame.to_world(local);
        let evaluation = bsdf.evaluate(self.wo, local, self.surface.faces_same_side(wi));
        let density = evaluation.pdf * self.probes_each as f32;
        let weight = self.branch.throughput * evaluation.value * (local.z.abs() / density);
        if density > 0.0 && weight != Vec3::ZERO {
            let probe = Probe {
                sample: self.branch.sample,
                from: self.receiver,
                density,
                weight,
            };
            probes.push(self.surface.ray_along(wi), probe);
        }
    }
}

/// One point in all lanes.
impl Points for Vertex<'_> {
    #[inline(always)]
    fn frame(&self, _: usize) -> Frame {
        self.frame
    }

    #[inline(always)]
    fn wo(&self, _: usize) -> Vec3 {
        self.wo
    }

    #[inline(always)]
    fn reflectance(&self, _: usize) -> Vec3 {
        self.lambert.unwrap_or_default()
    }

    #[inline(always)]
    fn throughput(&self, _: usize) -> Vec3 {
        self.branch.throughput
    }

    #[inline(always)]
    fn point(&self, _: usize) -> Vec3 {
        self.surface.point
    }

    #[inline(always)]
    fn faces_same_side(&self, _: usize, wi: Vec3) -> bool {
        self.surface.faces_same_side(wi)
    }

    #[inline(always)]
    fn leave(&self, _: usize, dir: Vec3) -> Vec3 {
        self.surface.leave_in_columns(dir)
    }

    #[inline(always)]
    fn origin_offset(&self) -> f32 {
        self.surface.origin_offset
    }

    #[inline(always)]
    fn directions(&self) -> f32 {
        self.probes_each as f32
    }
}

impl Probes {
    /// Traces and empties the queue.
    fn trace(
        &mut self,
        world: &World,
        tracer: &mut Tracer,
        batch: &mut Batch,
        strategy: DirectStrategy,
    ) {
        let Paths { rays, states } = &self.queue;
        self.hits.find_emitters(&world.emitters, rays);
        for (index, (ray, probe)) in rays.iter().zip(states).enumerate() {
            let (light, ray) = match self.hits.surface_and_way(&world.shapes, rays, index) {
                None => (probe.escape(world, Vec3::from(ray.dir), strategy), *ray),
                Some((surface, ray)) => (probe.meet(world, &surface, strategy), ray),
            };
            let brought = probe.weight * light;
            if brought != Vec3::ZERO {
                self.shadows.push(ray, probe.sample, brought);
            }
        }
        self.shadows.flush_probes(tracer, batch);
        self.queue.clear();
    }
}

impl Probe {
    /// Emission of a surface, weighted against the light samples that could have found it.
    fn meet(&self, world: &World, surface: &Surface, strategy: DirectStrategy) -> Vec3 {
        let Some((index, emitter)) = world.lights.emitter(surface.shape) else {
            return Vec3::ZERO;
        };
        let expected = match strategy {
            DirectStrategy::All => {
                let samples = world.lights.all()[index].samples();
                samples as f32 * emitter.element_pdf(&self.from, surface)
            }
            DirectStrategy::One => {
                let probability = world.lights.probability(self.from.point, index);
                probability * emitter.pdf(&self.from, surface)
            }
        };
        emitter.radiance_of(surface) * power_heuristic(self.density, expected)
    }

    /// Light from outside the scene, weighted against the light samples that could have found it.
    fn escape(&self, world: &World, dir: Vec3, strategy: DirectStrategy) -> Vec3 {
        let lights = &world.lights;
        lights
            .escaped_from(&self.from, dir)
            .map(|(light, radiance, density)| {
                let taken = match strategy {
                    DirectStrategy::All => lights.all()[light].samples() as f32,
                    DirectStrategy::One => lights.probability(self.from.point, light),
                };
                radiance * power_heuristic(self.density, taken * density)
            })
            .sum()
    }
}
