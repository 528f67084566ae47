//! Shadow rays to the light samples, with the light that they may bring.

use antumbra::{Isa, Ray};
use glam::Vec3;

use super::{ShadowQueue, power_heuristic};
use crate::columns::{BLOCK, Column, Column3, Flags, Stage, columns, is_zero, run, select};
use crate::light::LightSamples;
use crate::material::bsdf::{Evaluation, lambert_towards};
use crate::surface::{Frame, Room, SEGMENT_SHARE, offset, offset_distance};

/// Points where light arrives, one per lane: different ones, or one and the same.
pub trait Points {
    /// Frame in which the BSDF is evaluated.
    fn frame(&self, lane: usize) -> Frame;
    /// Direction towards where the path came from, in the frame.
    fn wo(&self, lane: usize) -> Vec3;
    /// Reflectance of a Lambert reflector. Of no meaning for other BSDFs.
    fn reflectance(&self, lane: usize) -> Vec3;
    /// Share of the light that the path carries.
    fn throughput(&self, lane: usize) -> Vec3;
    /// Position in the world.
    fn point(&self, lane: usize) -> Vec3;
    /// [`crate::surface::Surface::faces_same_side`].
    fn faces_same_side(&self, lane: usize, wi: Vec3) -> bool;
    /// Beginning of a ray along `dir`.
    fn leave(&self, lane: usize, dir: Vec3) -> Vec3;
    /// Largest origin offset of rays.
    fn origin_offset(&self) -> f32;
    /// Number of directions that the BSDF samples beside the light samples.
    fn directions(&self) -> f32;
}

/// Light that may arrive at a block of points, in columns.
#[derive(Debug, Default)]
pub struct Arrivals {
    scattered: Scattered,
    shadows: Shadows,
}

columns! {
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
}

columns! {
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
}

impl Arrivals {
    /// Computes how Lambert reflectors scatter the light of the samples.
    #[inline]
    pub fn evaluate(&mut self, isa: Isa, points: &impl Points, lights: &LightSamples) {
        run(isa, Evaluate { points, lights }, &mut self.scattered);
    }

    /// Has another BSDF scatter the light of a lane: `evaluate` is given the direction in the frame, and whether it is on
    /// the side that the path came from.
    #[inline]
    pub fn scatter(&mut self, lane: usize, evaluate: impl FnOnce(Vec3, bool) -> Evaluation) {
        let scattered = &mut self.scattered;
        let found = evaluate(scattered.wi.get(lane), scattered.reflects[lane] != 0);
        scattered.value.set(lane, found.value);
        scattered.pdf[lane] = found.pdf;
    }

    /// Computes the shadow rays.
    #[inline]
    pub fn bring(&mut self, isa: Isa, points: &impl Points, lights: &LightSamples) {
        let scattered = &self.scattered;
        let stage = Bring {
            points,
            lights,
            scattered,
        };
        run(isa, stage, &mut self.shadows);
    }

    /// Queues the shadow rays of the first `count` lanes that may bring light, each for the `sample` of its lane.
    #[inline]
    pub fn queue(&self, count: usize, sample: impl Fn(usize) -> u32, shadows: &mut ShadowQueue) {
        let found = &self.shadows;
        for lane in 0..count {
            if found.asks[lane] != 0 {
                let ray = Ray {
                    org: found.org.get(lane).to_array(),
                    dir: found.dir.get(lane).to_array(),
                    tnear: 0.0,
                    tfar: found.tfar[lane],
                };
                shadows.push(ray, sample(lane), found.light.get(lane));
            }
        }
    }
}

/// Scattering at Lambert reflectors. Other lanes get only directions.
struct Evaluate<'a, P> {
    points: &'a P,
    lights: &'a LightSamples,
}

impl<P: Points> Stage for Evaluate<'_, P> {
    type Out = Scattered;

    #[inline(always)]
    fn run(self, out: &mut Scattered) {
        let Self { points, lights } = self;
        for lane in 0..BLOCK {
            let wi_world = lights.wi.get(lane);
            let wi = points.frame(lane).to_local(wi_world);
            let reflects = points.faces_same_side(lane, wi_world);
            let (wo, reflectance) = (points.wo(lane), points.reflectance(lane));
            let (value, pdf) = lambert_towards(reflectance, wo, wi, reflects);
            out.wi.set(lane, wi);
            out.reflects[lane] = u32::from(reflects);
            out.value.set(lane, value);
            out.pdf[lane] = pdf;
        }
    }
}

/// Light that arrives, and its shadow rays.
struct Bring<'a, P> {
    points: &'a P,
    lights: &'a LightSamples,
    scattered: &'a Scattered,
}

impl<P: Points> Stage for Bring<'_, P> {
    type Out = Shadows;

    #[inline(always)]
    fn run(self, out: &mut Shadows) {
        let Self {
            points,
            lights,
            scattered,
        } = self;
        let (origin_offset, directions) = (points.origin_offset(), points.directions());
        for lane in 0..BLOCK {
            let density = lights.density[lane];
            let heuristic = power_heuristic(density, scattered.pdf[lane] * directions);
            let technique = if lights.is_delta[lane] != 0 {
                1.0
            } else {
                heuristic
            };
            let wi = scattered.wi.get(lane);
            let light = points.throughput(lane)
                * scattered.value.get(lane)
                * lights.radiance.get(lane)
                * (wi.z.abs() * technique / density);
            let is_far = lights.is_far[lane] != 0;
            let (target, point) = (lights.target.get(lane), points.point(lane));
            let wi_world = lights.wi.get(lane);
            let towards = target - point;
            let org = points.leave(lane, select(is_far, wi_world, towards));
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
