//! Shadow rays to the light samples, with the light that they may bring.

use antumbra::{Isa, Ray};

use super::super::ShadowQueue;
use super::vertices::Vertices;
use super::{World, power_heuristic};
use crate::columns::{BLOCK, Column, Column3, Flags, Stage, is_zero, run, select};
use crate::light::LightSamples;
use crate::material::bsdf::lambert_towards;
use crate::surface::{Room, SEGMENT_SHARE, SurfaceBlock, Surfaces, offset, offset_distance};

/// Light that may arrive at a block of vertices, in columns.
#[derive(Debug)]
pub struct Arrivals {
    scattered: Scattered,
    shadows: Shadows,
}

/// Scattering from the light towards the previous vertex.
#[derive(Debug)]
struct Scattered {
    /// Direction of the light in the frame.
    wi: Column3,
    /// Whether the light comes from the side of the previous vertex.
    reflects: Flags,
    value: Column3,
    /// Density with which the BSDF finds the direction.
    pdf: Column,
}

/// Shadow rays.
#[derive(Debug)]
struct Shadows {
    org: Column3,
    dir: Column3,
    tfar: Column,
    /// Light that they bring.
    light: Column3,
    /// Whether there is any.
    asks: Flags,
}

impl Default for Arrivals {
    fn default() -> Self {
        Self {
            scattered: Scattered {
                wi: Column3::default(),
                reflects: [0; BLOCK],
                value: Column3::default(),
                pdf: [0.0; BLOCK],
            },
            shadows: Shadows {
                org: Column3::default(),
                dir: Column3::default(),
                tfar: [0.0; BLOCK],
                light: Column3::default(),
                asks: [0; BLOCK],
            },
        }
    }
}

impl Arrivals {
    /// Computes the shadow rays.
    pub fn ask(
        &mut self,
        isa: Isa,
        world: &World,
        vertices: &Vertices,
        surfaces: &SurfaceBlock,
        lights: &LightSamples,
    ) {
        let columns = surfaces.columns();
        let scattered = &mut self.scattered;
        let stage = Evaluate {
            vertices,
            surfaces: columns,
            lights,
        };
        run(isa, stage, scattered);
        for other in &vertices.others {
            let lane = other.lane;
            if lights.found[lane] == 0 {
                continue;
            }
            let bsdf = vertices.bsdf(world, other);
            let wo = vertices.local.wo.get(lane);
            let wi = scattered.wi.get(lane);
            let found = bsdf.evaluate(wo, wi, scattered.reflects[lane] != 0);
            scattered.value.set(lane, found.value);
            scattered.pdf[lane] = found.pdf * (1.0 - bsdf.delta_share());
        }
        let stage = Bring {
            vertices,
            surfaces: columns,
            lights,
            scattered,
            origin_offset: surfaces.origin_offset(),
        };
        run(isa, stage, &mut self.shadows);
    }

    /// Queues the shadow rays that may bring light.
    pub fn queue(&self, vertices: &Vertices, shadows: &mut ShadowQueue) {
        let found = &self.shadows;
        for lane in 0..vertices.count() {
            if found.asks[lane] != 0 {
                let ray = Ray {
                    org: found.org.get(lane).to_array(),
                    dir: found.dir.get(lane).to_array(),
                    tnear: 0.0,
                    tfar: found.tfar[lane],
                };
                shadows.push(ray, vertices.sample[lane], found.light.get(lane));
            }
        }
    }
}

/// Scattering at Lambert reflectors. Other lanes get directions alone.
struct Evaluate<'a> {
    vertices: &'a Vertices,
    surfaces: &'a Surfaces,
    lights: &'a LightSamples,
}

impl Stage for Evaluate<'_> {
    type Out = Scattered;

    #[inline(always)]
    fn run(self, out: &mut Scattered) {
        let Self {
            vertices,
            surfaces,
            lights,
        } = self;
        for lane in 0..BLOCK {
            let wi_world = lights.wi.get(lane);
            let wi = vertices.local.frame(lane).to_local(wi_world);
            let reflects = surfaces.faces_same_side(lane, wi_world);
            let wo = vertices.local.wo.get(lane);
            let reflectance = vertices.reflectance.get(lane);
            let (value, pdf) = lambert_towards(reflectance, wo, wi, reflects);
            out.wi.set(lane, wi);
            out.reflects[lane] = u32::from(reflects);
            out.value.set(lane, value);
            out.pdf[lane] = pdf;
        }
    }
}

/// Light that arrives, and its shadow rays.
struct Bring<'a> {
    vertices: &'a Vertices,
    surfaces: &'a Surfaces,
    lights: &'a LightSamples,
    scattered: &'a Scattered,
    origin_offset: f32,
}

impl Stage for Bring<'_> {
    type Out = Shadows;

    #[inline(always)]
    fn run(self, out: &mut Shadows) {
        let Self {
            vertices,
            surfaces,
            lights,
            scattered,
            origin_offset,
        } = self;
        for lane in 0..BLOCK {
            let density = lights.density[lane];
            let heuristic = power_heuristic(density, scattered.pdf[lane]);
            let technique = if lights.is_delta[lane] != 0 {
                1.0
            } else {
                heuristic
            };
            let wi = scattered.wi.get(lane);
            let light = vertices.throughput.get(lane)
                * scattered.value.get(lane)
                * lights.radiance.get(lane)
                * (wi.z.abs() * technique / density);
            let is_far = lights.is_far[lane] != 0;
            let (target, point) = (lights.target.get(lane), surfaces.point.get(lane));
            let wi_world = lights.wi.get(lane);
            let towards = target - point;
            let org = surfaces.leave(lane, select(is_far, wi_world, towards));
            let (error, normal) = (lights.error.get(lane), lights.normal.get(lane));
            // A point has no surface to keep away from: its normal is 0, and the target stays.
            let distance = offset_distance(error, normal, origin_offset, Room::OPEN);
            let target = offset(target, normal, distance, org - target);
            let segment = target - org;
            out.org.set(lane, org);
            out.dir.set(lane, select(is_far, wi_world, segment));
            out.tfar[lane] = if is_far { f32::INFINITY } else { SEGMENT_SHARE };
            out.light.set(lane, light);
            out.asks[lane] = lights.found[lane] & u32::from(!is_zero(light));
        }
    }
}
