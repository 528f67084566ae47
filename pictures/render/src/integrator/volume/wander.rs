//! Walks of light inside of bodies, from where it enters to where it leaves.
//!
//! The body must be closed. A walk ends without light where a ray finds no surface, or one of another material.

use std::f32::consts::{FRAC_1_PI, PI};

use antumbra::Ray;
use glam::Vec3;

use super::super::Batch;
use super::super::path::{DIRECTION, Origin, first_dimension};
use super::connections::Connection;
use super::{State, VolumePathTracer, light_sample, medium_beyond};
use crate::light::Receiver;
use crate::material::bsdf::{Interface, Subsurface};
use crate::medium::{Coefficients, Event, phase};
use crate::sampler::warp::cosine_hemisphere;
use crate::surface::{Frame, Surface, reflect};
use crate::world::World;

/// Largest number of scattering events of a walk. So many happen in bodies that absorb next to nothing only.
const MAX_STEPS: u32 = 1 << 14;

/// Throughput below which a walk plays roulette.
const FAINT: f32 = 0.05;

/// A walk under way.
#[derive(Clone, Copy, Debug)]
pub struct Walk {
    coefficients: Coefficients,
    asymmetry: f32,
    interface: Interface,
    /// Material of the body.
    material: usize,
    steps: u32,
}

impl VolumePathTracer {
    /// Sends a path into a body. `enters` is the probability of that choice.
    pub(super) fn enter(
        &mut self,
        world: &World,
        surface: &Surface,
        (body, frame): (&Subsurface, Frame),
        enters: f32,
        mut state: State,
    ) {
        let wo = frame.to_local(surface.wo);
        let share = 1.0 - body.interface.reflectance(wo.z);
        state.throughput *= body.kt * (share / enters);
        // Radiance is not compressed, since it expands again where it leaves.
        let Some(local) = body.interface.refracted(wo) else {
            return;
        };
        let dir = frame.to_world(local);
        if state.throughput == Vec3::ZERO || surface.faces_same_side(dir) {
            return;
        }
        state.walk = Some(Walk {
            coefficients: body.coefficients,
            asymmetry: body.asymmetry,
            interface: body.interface,
            material: world.shapes[surface.shape].material,
            steps: 0,
        });
        state.from_camera = false;
        self.next.push(surface.ray_along(dir), state);
    }

    /// Carries a walk to its next event.
    pub(super) fn wander(
        &mut self,
        world: &World,
        batch: &Batch,
        index: usize,
        (mut walk, mut state): (Walk, State),
    ) {
        let ray = self.current.rays[index];
        let (org, dir) = (Vec3::from(ray.org), Vec3::from(ray.dir));
        let end = self.hits.hit(index).map_or(f32::INFINITY, |hit| hit.t);
        let event = (walk.coefficients).event(end, state.throughput, &mut state.random);
        let (Event::Scattered { weight, .. } | Event::Passed { weight }) = event;
        state.throughput *= weight;
        let most = state.throughput.max_element();
        if most < FAINT {
            let survives = (most / FAINT).max(0.05);
            if state.random.next() >= survives {
                return;
            }
            state.throughput /= survives;
        }
        if state.throughput == Vec3::ZERO {
            return;
        }
        if let Event::Scattered { distance, .. } = event {
            walk.steps += 1;
            if walk.steps < MAX_STEPS {
                let dir_next = phase::sample(walk.asymmetry, dir, state.random.pair());
                state.walk = Some(walk);
                let ray = Ray {
                    org: (org + dir * distance).to_array(),
                    dir: dir_next.to_array(),
                    tnear: 0.0,
                    tfar: f32::INFINITY,
                };
                self.next.push(ray, state);
            }
            return;
        }
        let surface = (self.hits).surface(&world.shapes, &self.current.rays, index);
        let Some(surface) = surface else {
            return;
        };
        if world.shapes[surface.shape].material != walk.material {
            return;
        }
        let inward = surface.facing_normal();
        let reflectance = walk.interface.reflectance_inside(dir.dot(inward));
        if state.random.next() < reflectance {
            walk.steps += 1;
            if walk.steps < MAX_STEPS {
                state.walk = Some(walk);
                let dir = reflect(-dir, inward).normalize();
                self.next.push(surface.ray_along(dir), state);
            }
            return;
        }
        state.walk = None;
        self.leave(world, batch, &surface, walk.interface, state);
    }

    /// Scatters a path where it leaves a body.
    fn leave(
        &mut self,
        world: &World,
        batch: &Batch,
        surface: &Surface,
        interface: Interface,
        mut state: State,
    ) {
        let outward = -surface.facing_normal();
        let normal = surface.shading_normal;
        let normal = if normal.dot(outward) < 0.0 {
            -normal
        } else {
            normal
        };
        let frame = Frame::around(normal);
        let at = Receiver {
            point: surface.point,
            normal: outward,
            both_sides: false,
        };
        let stream = batch.streams[state.sample as usize];
        let dimension = first_dimension(state.depth);
        if let Some((light, chance)) = light_sample(world, &at, &stream, dimension) {
            let cos = light.wi.dot(normal);
            if cos > 0.0 && light.wi.dot(outward) > 0.0 {
                let density = light.pdf * chance;
                let technique = light.technique(density, cos * FRAC_1_PI);
                let value = interface.leaving(cos);
                let brought = light.radiance * (value * cos * technique / density);
                self.connections.push(Connection {
                    ray: light.shadow_ray(surface),
                    light: state.throughput * brought,
                    sample: state.sample,
                    medium: medium_beyond(world, surface, light.wi, state.medium),
                    random: state.random,
                });
                state.random.skip();
            }
        }
        let local = cosine_hemisphere(stream.pair(dimension.wrapping_add(DIRECTION)));
        let dir = frame.to_world(local);
        if local.z <= 0.0 || dir.dot(outward) <= 0.0 {
            return;
        }
        state.throughput *= interface.leaving(local.z) * PI;
        state.origin = Origin::Scattered {
            from: at,
            pdf: local.z * FRAC_1_PI,
        };
        state.medium = medium_beyond(world, surface, dir, state.medium);
        self.go_on(surface.ray_along(dir), state, &stream, dimension);
    }
}
