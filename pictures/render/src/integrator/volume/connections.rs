//! Rays to lights through media and through surfaces without a material.

use antumbra::Ray;
use glam::Vec3;

use super::super::Batch;
use super::super::hits::Hits;
use super::super::tracer::Tracer;
use super::{lets_pass, medium, medium_beyond};
use crate::medium::Random;
use crate::surface::SEGMENT_SHARE;
use crate::world::World;

/// A ray to a light: unbounded with a unit direction, or from a point to just before another.
#[derive(Clone, Copy, Debug)]
pub struct Connection {
    pub ray: Ray,
    /// Light that the ray brings if nothing is in between.
    pub light: Vec3,
    /// Sample that the light belongs to.
    pub sample: u32,
    /// Medium in which the ray begins.
    pub medium: Option<u32>,
    pub random: Random,
}

/// Queued connections, with buffers.
#[derive(Debug, Default)]
pub struct Connections {
    current: Vec<Connection>,
    next: Vec<Connection>,
    rays: Vec<Ray>,
    hits: Hits,
}

impl Connections {
    /// Adds a connection, unless it brings nothing.
    pub fn push(&mut self, connection: Connection) {
        if connection.light != Vec3::ZERO {
            self.current.push(connection);
        }
    }

    /// Traces all connections to their ends, and adds the light that arrives to the samples.
    pub fn trace(&mut self, world: &World, tracer: &mut Tracer, batch: &mut Batch) {
        if world.ends_by_occlusion {
            self.trace_at_once(world, tracer, batch);
        }
        while !self.current.is_empty() && !tracer.is_stopped() {
            self.rays.clear();
            self.rays.extend(self.current.iter().map(|found| found.ray));
            let samples = self.current.iter().map(|found| found.sample);
            self.hits.find(tracer, &self.rays, samples);
            for index in 0..self.current.len() {
                self.advance(world, batch, index);
            }
            self.current.clear();
            std::mem::swap(&mut self.current, &mut self.next);
        }
        self.current.clear();
    }

    /// Traces all connections where every surface blocks light.
    fn trace_at_once(&mut self, world: &World, tracer: &mut Tracer, batch: &mut Batch) {
        self.rays.clear();
        self.rays.extend(self.current.iter().map(|found| found.ray));
        let samples = self.current.iter().map(|found| found.sample);
        let (occluded, costs) = tracer.occluded(&self.rays, samples);
        for (connection, &occluded) in self.current.iter_mut().zip(occluded) {
            if !occluded {
                connection.pass(world, connection.ray.tfar);
                batch.reflected[connection.sample as usize] += connection.light;
            }
        }
        if !batch.costs.is_empty() {
            for (connection, cost) in self.current.iter().zip(costs) {
                let sum = &mut batch.costs[connection.sample as usize];
                sum.tests += u64::from(cost.node_tests) + u64::from(cost.prim_tests);
                sum.rays += 1;
            }
            let samples = self.current.iter().map(|connection| connection.sample);
            if let Some(queries) = tracer.queries() {
                queries.attribute(&mut { samples });
            }
        }
        self.current.clear();
    }

    /// Carries a connection to the next surface.
    fn advance(&mut self, world: &World, batch: &mut Batch, index: usize) {
        let mut connection = self.current[index];
        let Some(hit) = self.hits.hit(index).copied() else {
            connection.pass(world, connection.ray.tfar);
            batch.reflected[connection.sample as usize] += connection.light;
            return;
        };
        let Some(surface) = self.hits.surface(&world.shapes, &self.rays, index) else {
            return;
        };
        if !lets_pass(world, &surface) {
            return;
        }
        connection.pass(world, hit.t);
        let dir = Vec3::from(connection.ray.dir);
        connection.medium = medium_beyond(world, &surface, dir, connection.medium);
        let ray = connection.ray;
        connection.ray = if ray.tfar == f32::INFINITY {
            surface.ray_along(dir)
        } else {
            let target = Vec3::from(ray.org) + dir;
            let org = Vec3::from(surface.ray_along(dir).org);
            // The target is just behind the surface, or rounding moved the origin past it.
            if (target - org).dot(dir) <= 0.0 {
                batch.reflected[connection.sample as usize] += connection.light;
                return;
            }
            Ray {
                org: org.to_array(),
                dir: (target - org).to_array(),
                tnear: 0.0,
                tfar: SEGMENT_SHARE,
            }
        };
        if connection.light != Vec3::ZERO {
            self.next.push(connection);
        }
    }
}

impl Connection {
    /// Attenuates the light up to parameter `t` of the ray.
    fn pass(&mut self, world: &World, t: f32) {
        if let Some(medium) = medium(world, self.medium) {
            let (org, dir) = (Vec3::from(self.ray.org), Vec3::from(self.ray.dir));
            let length = dir.length();
            let end = length * t;
            let passed = medium.transmittance(org, dir / length, end, &mut self.random);
            self.light *= passed;
        }
    }
}
