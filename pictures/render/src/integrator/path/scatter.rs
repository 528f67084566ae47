//! Rays that continue the paths.

use antumbra::{Isa, Ray};

use super::vertices::Vertices;
use super::{DIRECTION, LOBE, Origin, Paths, State, World, draw};
use crate::columns::{BLOCK, Column, Column3, Flags, Stage, columns, is_zero, run, select};
use crate::light::Asked;
use crate::material::bsdf::{cosine_side, lambert_towards};
use crate::surface::{SurfaceBlock, Surfaces};

columns! {
    /// Continuations of a block of paths, in columns.
    #[derive(Debug)]
    pub struct Continuations {
        drawn: Drawn,
        followed: Followed,
        /// Random values: direction, lobe, roulette.
        u: [Column; 2],
        lobe: [Column; 2],
        roulette: [Column; 2],
    }
}

columns! {
    /// Directions drawn from the BSDFs.
    #[derive(Debug)]
    struct Drawn {
        /// Direction in the frame.
        wi: Column3,
        /// BSDF and cosine over density.
        weight: Column3,
        /// Density of the direction. No number for a delta lobe, which no light sample could have found.
        pdf: Column,
        /// Index of refraction inside over outside, if the path passes to the other side. Otherwise 1.
        eta: Column,
        /// Whether the path goes on.
        goes_on: Flags,
    }
}

columns! {
    /// Rays of the paths that go on.
    #[derive(Debug)]
    struct Followed {
        org: Column3,
        dir: Column3,
        throughput: Column3,
        expansion: Column,
        goes_on: Flags,
    }
}

impl Continuations {
    /// Draws directions. `dimension` is the first of the vertices.
    pub fn scatter(
        &mut self,
        isa: Isa,
        world: &World,
        vertices: &Vertices,
        surfaces: &SurfaceBlock,
        dimension: u32,
    ) {
        let streams = &vertices.streams;
        streams.pairs(isa, dimension.wrapping_add(DIRECTION), &mut self.u);
        let stage = Draw {
            vertices,
            surfaces: surfaces.columns(),
            u: &self.u,
        };
        run(isa, stage, &mut self.drawn);
        if vertices.others.is_empty() {
            return;
        }
        streams.uniforms(isa, dimension.wrapping_add(LOBE), &mut self.lobe);
        for other in &vertices.others {
            let lane = other.lane;
            let bsdf = vertices.bsdf(world, other);
            let u = [self.u[0][lane], self.u[1][lane]];
            let columns = surfaces.columns();
            let (frame, wo) = (vertices.local.frame(lane), vertices.local.wo.get(lane));
            let found = draw(bsdf, wo, self.lobe[0][lane], u, |wi| {
                columns.faces_same_side(lane, frame.to_world(wi))
            });
            self.drawn.goes_on[lane] = u32::from(found.is_some());
            if let Some(found) = found {
                self.drawn.wi.set(lane, found.wi);
                self.drawn.weight.set(lane, found.weight);
                self.drawn.pdf[lane] = found.pdf.unwrap_or(f32::NAN);
                self.drawn.eta[lane] = found.eta;
            }
        }
    }

    /// Computes the rays. Roulette is played for a throughput below its threshold, if there is one, by the values of
    /// its dimension.
    pub fn follow(
        &mut self,
        isa: Isa,
        vertices: &Vertices,
        surfaces: &SurfaceBlock,
        roulette: Option<(f32, u32)>,
    ) {
        let threshold = roulette.map_or(f32::NEG_INFINITY, |(threshold, dimension)| {
            let streams = &vertices.streams;
            streams.uniforms(isa, dimension, &mut self.roulette);
            threshold
        });
        let stage = Follow {
            vertices,
            surfaces: surfaces.columns(),
            drawn: &self.drawn,
            roulette: &self.roulette[0],
            threshold,
        };
        run(isa, stage, &mut self.followed);
    }

    /// Adds the rays of the lanes that go on to `next`, with the state of their paths.
    pub fn queue(&self, vertices: &Vertices, asked: &Asked, next: &mut Paths) {
        let found = &self.followed;
        for lane in 0..vertices.count() {
            if found.goes_on[lane] == 0 {
                continue;
            }
            let ray = Ray {
                org: found.org.get(lane).to_array(),
                dir: found.dir.get(lane).to_array(),
                tnear: 0.0,
                tfar: f32::INFINITY,
            };
            let pdf = self.drawn.pdf[lane];
            let origin = if pdf.is_nan() {
                Origin::Certain
            } else {
                Origin::Scattered {
                    from: asked.receiver(lane),
                    pdf,
                }
            };
            let state = State {
                sample: vertices.sample[lane],
                throughput: found.throughput.get(lane),
                expansion: found.expansion[lane],
                origin,
            };
            next.push(ray, state);
        }
    }
}

/// Directions of Lambert reflectors.
struct Draw<'a> {
    vertices: &'a Vertices,
    surfaces: &'a Surfaces,
    u: &'a [Column; 2],
}

impl Stage for Draw<'_> {
    type Out = Drawn;

    #[inline(always)]
    fn run(self, out: &mut Drawn) {
        let Self {
            vertices,
            surfaces,
            u,
        } = self;
        for lane in 0..BLOCK {
            let wo = vertices.local.wo.get(lane);
            let wi = cosine_side(wo, [u[0][lane], u[1][lane]]);
            let world = vertices.local.frame(lane).to_world(wi);
            let reflects = surfaces.faces_same_side(lane, world);
            let reflectance = vertices.reflectance.get(lane);
            let (value, pdf) = lambert_towards(reflectance, wo, wi, reflects);
            out.wi.set(lane, wi);
            out.weight.set(lane, value * (wi.z.abs() / pdf));
            out.pdf[lane] = pdf;
            out.eta[lane] = 1.0;
            let goes_on = (wo.z != 0.0) & (pdf != 0.0);
            out.goes_on[lane] = vertices.is_lambert[lane] & u32::from(goes_on);
        }
    }
}

/// Rays along the directions, after roulette.
struct Follow<'a> {
    vertices: &'a Vertices,
    surfaces: &'a Surfaces,
    drawn: &'a Drawn,
    roulette: &'a Column,
    threshold: f32,
}

impl Stage for Follow<'_> {
    type Out = Followed;

    #[inline(always)]
    fn run(self, out: &mut Followed) {
        let Self {
            vertices,
            surfaces,
            drawn,
            roulette,
            threshold,
        } = self;
        for lane in 0..BLOCK {
            let throughput = vertices.throughput.get(lane) * drawn.weight.get(lane);
            let is_black = is_zero(throughput);
            let eta = drawn.eta[lane];
            let enters = surfaces.wo.get(lane).dot(surfaces.normal.get(lane)) > 0.0;
            let square = eta * eta;
            let factor = if enters { square } else { 1.0 / square };
            let expansion = vertices.expansion[lane];
            let expanded = expansion * factor;
            let expansion = if eta != 1.0 { expanded } else { expansion };
            let chance = (throughput * expansion).max_element();
            let plays = chance < threshold;
            let end = (1.0 - chance).max(0.05);
            let dies = plays & (roulette[lane] < end);
            let raised = throughput / (1.0 - end);
            let dir = vertices.local.frame(lane).to_world(drawn.wi.get(lane));
            out.org.set(lane, surfaces.leave(lane, dir));
            out.dir.set(lane, dir);
            out.throughput.set(lane, select(plays, raised, throughput));
            out.expansion[lane] = expansion;
            out.goes_on[lane] = drawn.goes_on[lane] & u32::from(!is_black & !dies);
        }
    }
}
