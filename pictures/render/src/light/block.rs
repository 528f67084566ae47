//! Light samples of many points at once, in columns.
//!
//! Samples of flat meshes and of a sky are computed in vectors, samples of other lights one by one. Every lane has the
//! bits of [`Lights::choose`] and [`Light::sample`].

use antumbra_simd::Isa;
use glam::Vec3;

use super::emitter::{AreaDraw, solid_angle_pdf, stretch};
use super::sky::{self, Sky};
use super::{End, Light, LightSample, Lights, Receiver};
use crate::columns::{BLOCK, Column, Column3, Flags, Stage, columns, is_zero, run, select};
use crate::sampler::warp::{cosine_hemisphere, triangle, uniform_hemisphere};
use crate::surface::{Frame, interpolate};

/// Points that want light, and the light that may arrive at them.
#[derive(Clone, Debug, Default)]
pub struct LightBlock {
    /// Points that want light.
    pub asked: Asked,
    /// Light that may arrive.
    pub found: LightSamples,
    chosen: Chosen,
    drawn: Drawn,
}

columns! {
    /// Columns of [`Receiver`], and the random values for the samples.
    #[derive(Clone, Debug)]
    pub struct Asked {
        /// Position in the world.
        pub point: Column3,
        /// Unit geometric normal on the side of the viewer.
        pub normal: Column3,
        /// Whether light from the other side counts, too.
        pub both_sides: Flags,
        /// Whether the lane wants a sample.
        pub wants: Flags,
        /// Choice of the light. The second column is not used.
        pub choice: [Column; 2],
        /// Place on the light.
        pub u: [Column; 2],
    }
}

columns! {
    /// Choice of one light per lane.
    #[derive(Clone, Debug)]
    pub struct Chosen {
        /// Index of the light in [`Lights::all`].
        pub light: Flags,
        /// Element of the light, unless lights are sampled as wholes.
        pub element: Flags,
        /// Probability of the choice, or the number of samples.
        pub probability: Column,
        /// Whether there is a light at all.
        pub any: bool,
    }
}

/// Request for one of several samples of an element of a light.
#[derive(Clone, Copy, Debug)]
pub struct ElementSample {
    /// Index of the light in [`Lights::all`].
    pub light: usize,
    /// Element of the light: the triangle of a mesh.
    pub element: usize,
    /// Number of samples of the element.
    pub samples: u32,
    /// Random values of this one.
    pub u: [f32; 2],
}

columns! {
    /// Columns of [`LightSample`].
    #[derive(Clone, Debug)]
    pub struct LightSamples {
        /// Unit direction to the light.
        pub wi: Column3,
        /// Radiance that arrives unless the light is occluded.
        pub radiance: Column3,
        /// Density of this sample of this light.
        pub density: Column,
        /// Whether no other technique can find the direction.
        pub is_delta: Flags,
        /// Whether the light is infinitely far away. Otherwise it lies at `target`.
        pub is_far: Flags,
        /// Position on the light.
        pub target: Column3,
        /// Error bound of `target`, and normal of its surface. 0 for a point.
        pub error: Column3,
        /// See `error`.
        pub normal: Column3,
        /// Whether there is a sample.
        pub found: Flags,
    }
}

columns! {
    /// Lights to be sampled in vectors.
    #[derive(Clone, Debug)]
    struct Drawn {
        kind: Flags,
        corners: [Column3; 3],
        normal: Column3,
        /// Radiance of the light.
        radiance: Column3,
        area: Column,
        two_sided: Flags,
        /// How far the random value reaches into its triangle, and the size of that.
        into: [[f64; BLOCK]; 2],
        u: [Column; 2],
        /// Direction in the frame of a sky, unless it is cosine-weighted.
        local: Column3,
        is_cosine: Flags,
        other_side: Flags,
    }
}

/// Kinds of lanes.
const NONE: u32 = 0;
const AREA: u32 = 1;
const SKY: u32 = 2;

impl Asked {
    /// Puts one receiver into all lanes.
    #[inline]
    pub fn fill(&mut self, at: &Receiver) {
        for lane in 0..BLOCK {
            self.point.set(lane, at.point);
            self.normal.set(lane, at.normal);
            self.both_sides[lane] = u32::from(at.both_sides);
        }
    }

    /// Receiver of a lane.
    #[inline]
    pub fn receiver(&self, lane: usize) -> Receiver {
        Receiver {
            point: self.point.get(lane),
            normal: self.normal.get(lane),
            both_sides: self.both_sides[lane] != 0,
        }
    }
}

impl LightBlock {
    /// Samples one light for each of the first `count` lanes that want a sample.
    pub fn sample(&mut self, isa: Isa, lights: &Lights, count: usize) {
        self.found.found = [0; BLOCK];
        let (asked, chosen) = (&self.asked, &mut self.chosen);
        lights.choose_block(isa, asked, count, chosen);
        if chosen.any {
            self.draw(isa, lights, count, false);
        }
    }

    /// Requests a sample of an element of a light for a lane, see [`Self::sample_elements`].
    #[inline]
    pub fn ask_element(&mut self, lane: usize, sample: &ElementSample) {
        self.chosen.light[lane] = sample.light as u32;
        self.chosen.element[lane] = sample.element as u32;
        self.chosen.probability[lane] = sample.samples as f32;
        (self.asked.u[0][lane], self.asked.u[1][lane]) = (sample.u[0], sample.u[1]);
        self.asked.wants[lane] = 1;
    }

    /// Samples the elements that the first `count` lanes [want](Self::ask_element), as [`Light::sample_element`] does.
    /// Densities are multiplied by the numbers of samples.
    pub fn sample_elements(&mut self, isa: Isa, lights: &Lights, count: usize) {
        self.found.found = [0; BLOCK];
        self.draw(isa, lights, count, true);
    }

    /// Samples the lights that were chosen, or their elements.
    #[inline]
    fn draw(&mut self, isa: Isa, lights: &Lights, count: usize, by_elements: bool) {
        let (asked, chosen) = (&self.asked, &self.chosen);
        let drawn = &mut self.drawn;
        let (mut areas, mut skies, mut others) = (false, false, false);
        for lane in 0..count {
            drawn.kind[lane] = NONE;
            if asked.wants[lane] == 0 {
                continue;
            }
            let u = [asked.u[0][lane], asked.u[1][lane]];
            let element = chosen.element[lane] as usize;
            match &lights.all()[chosen.light[lane] as usize] {
                Light::Area(emitter) if by_elements => match emitter.draw_element(element) {
                    Some(draw) => {
                        areas = true;
                        drawn.set_area(lane, &draw, u[1]);
                        drawn.u[0][lane] = u[0];
                    }
                    None => others = true,
                },
                Light::Area(emitter) => match emitter.draw(u) {
                    Some(draw) => {
                        areas = true;
                        drawn.set_area(lane, &draw, u[1]);
                    }
                    None => others = true,
                },
                Light::Sky(sky) => {
                    skies = true;
                    drawn.set_sky(lane, sky, asked.both_sides[lane] != 0, u);
                }
                _ => others = true,
            }
        }
        if areas && !by_elements {
            run(isa, Stretch, drawn);
        }
        let (drawn, found) = (&self.drawn, &mut self.found);
        if areas {
            run(isa, SampleArea { asked, drawn }, found);
        }
        if skies {
            run(isa, SampleSky { asked, drawn }, found);
        }
        if others {
            for lane in 0..count {
                if asked.wants[lane] != 0 && drawn.kind[lane] == NONE {
                    let light = &lights.all()[chosen.light[lane] as usize];
                    let u = [asked.u[0][lane], asked.u[1][lane]];
                    let at = asked.receiver(lane);
                    let sample = match by_elements {
                        true => light.sample_element(&at, chosen.element[lane] as usize, u),
                        false => light.sample(&at, u),
                    };
                    if let Some(sample) = sample {
                        found.set(lane, &sample);
                    }
                }
            }
        }
        run(isa, Weigh(chosen), found);
    }
}

impl LightSamples {
    fn set(&mut self, lane: usize, sample: &LightSample) {
        let (target, error, normal) = match sample.end {
            End::Infinity => (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO),
            End::Point(point) => (point, Vec3::ZERO, Vec3::ZERO),
            End::Surface {
                point,
                error,
                normal,
            } => (point, error, normal),
        };
        self.wi.set(lane, sample.wi);
        self.radiance.set(lane, sample.radiance);
        self.density[lane] = sample.pdf;
        self.is_delta[lane] = u32::from(sample.is_delta);
        self.is_far[lane] = u32::from(matches!(sample.end, End::Infinity));
        self.target.set(lane, target);
        self.error.set(lane, error);
        self.normal.set(lane, normal);
        self.found[lane] = 1;
    }
}

impl Drawn {
    #[inline]
    fn set_area(&mut self, lane: usize, draw: &AreaDraw, v: f32) {
        self.kind[lane] = AREA;
        for (column, &corner) in self.corners.iter_mut().zip(draw.corners) {
            column.set(lane, corner);
        }
        self.normal.set(lane, draw.normal);
        self.radiance.set(lane, draw.radiance);
        self.area[lane] = draw.area;
        self.two_sided[lane] = u32::from(draw.two_sided);
        (self.into[0][lane], self.into[1][lane]) = (draw.into[0], draw.into[1]);
        self.u[1][lane] = v;
    }

    #[inline]
    fn set_sky(&mut self, lane: usize, sky: &Sky, both_sides: bool, u: [f32; 2]) {
        let draw = sky::draw(both_sides, u);
        self.kind[lane] = SKY;
        self.radiance.set(lane, sky.radiance);
        self.other_side[lane] = u32::from(draw.other_side);
        self.is_cosine[lane] = u32::from(!draw.uniform);
        (self.u[0][lane], self.u[1][lane]) = (draw.u[0], draw.u[1]);
        if draw.uniform {
            self.local.set(lane, uniform_hemisphere(draw.u));
        }
    }
}

/// Places on triangles. Other lanes keep what they have.
struct Stretch;

impl Stage for Stretch {
    type Out = Drawn;

    #[inline(always)]
    fn run(self, out: &mut Drawn) {
        for lane in 0..BLOCK {
            let stretched = stretch([out.into[0][lane], out.into[1][lane]]);
            let kept = out.u[0][lane];
            out.u[0][lane] = if out.kind[lane] == AREA {
                stretched
            } else {
                kept
            };
        }
    }
}

/// [`super::Emitter::sample`] of flat meshes.
struct SampleArea<'a> {
    asked: &'a Asked,
    drawn: &'a Drawn,
}

impl Stage for SampleArea<'_> {
    type Out = LightSamples;

    #[inline(always)]
    fn run(self, out: &mut LightSamples) {
        let Self { asked, drawn } = self;
        for lane in 0..BLOCK {
            let [w0, w1] = triangle([drawn.u[0][lane], drawn.u[1][lane]]);
            let [a, b, c] = &drawn.corners;
            let corners = [a.get(lane), b.get(lane), c.get(lane)];
            let (point, error) = interpolate(corners, [w0, w1, 1.0 - w0 - w1]);
            let normal = drawn.normal.get(lane);
            let to_light = point - asked.point.get(lane);
            // As `try_normalize`, without a branch.
            let factor = to_light.length_recip();
            let wi = to_light * factor;
            let shines = (drawn.two_sided[lane] != 0) | (normal.dot(-wi) > 0.0);
            let radiance = drawn.radiance.get(lane);
            let pdf = solid_angle_pdf(to_light, normal, drawn.area[lane]);
            let is_usable = factor.is_finite() & (factor > 0.0) & (pdf > 0.0) & pdf.is_finite();
            let is_bright = !is_zero(radiance);
            let found = (drawn.kind[lane] == AREA) & shines & is_usable & is_bright;
            out.wi.set(lane, wi);
            out.radiance.set(lane, radiance);
            out.density[lane] = pdf;
            out.is_delta[lane] = 0;
            out.is_far[lane] = 0;
            out.target.set(lane, point);
            out.error.set(lane, error);
            out.normal.set(lane, normal);
            out.found[lane] = u32::from(found);
        }
    }
}

/// [`Sky::sample`]. Other lanes keep what they have.
struct SampleSky<'a> {
    asked: &'a Asked,
    drawn: &'a Drawn,
}

impl Stage for SampleSky<'_> {
    type Out = LightSamples;

    #[inline(always)]
    fn run(self, out: &mut LightSamples) {
        let Self { asked, drawn } = self;
        for lane in 0..BLOCK {
            let is_sky = drawn.kind[lane] == SKY;
            let cosine = cosine_hemisphere([drawn.u[0][lane], drawn.u[1][lane]]);
            let local = select(drawn.is_cosine[lane] != 0, cosine, drawn.local.get(lane));
            let facing = asked.normal.get(lane);
            let normal = select(drawn.other_side[lane] != 0, -facing, facing);
            let wi = Frame::around(normal).to_world(local);
            let pdf = sky::density(facing, asked.both_sides[lane] != 0, wi);
            let radiance = drawn.radiance.get(lane);
            let is_bright = !is_zero(radiance);
            let found = is_bright & (pdf > 0.0);
            out.wi.set(lane, select(is_sky, wi, out.wi.get(lane)));
            let kept = out.radiance.get(lane);
            out.radiance.set(lane, select(is_sky, radiance, kept));
            let kept = out.density[lane];
            out.density[lane] = if is_sky { pdf } else { kept };
            let kept = out.is_delta[lane];
            out.is_delta[lane] = if is_sky { 0 } else { kept };
            let kept = out.is_far[lane];
            out.is_far[lane] = if is_sky { 1 } else { kept };
            let kept = out.found[lane];
            out.found[lane] = if is_sky { u32::from(found) } else { kept };
        }
    }
}

/// Density of the light, or its number of samples, times the density of its sample.
struct Weigh<'a>(&'a Chosen);

impl Stage for Weigh<'_> {
    type Out = LightSamples;

    #[inline(always)]
    fn run(self, out: &mut LightSamples) {
        for lane in 0..BLOCK {
            out.density[lane] *= self.0.probability[lane];
        }
    }
}
