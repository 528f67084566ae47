//! Points where paths scatter.

use std::borrow::Cow;

use antumbra::Isa;
use glam::Vec3;

use super::super::Batch;
use super::super::arrival::Points;
use super::{Hits, Origin, Paths, Surface, World, emitted_light, shade};
use crate::columns::{BLOCK, Column, Column3, Flags, Stage, columns, run, zero};
use crate::light::Asked;
use crate::material::Material;
use crate::material::bsdf::Bsdf;
use crate::sampler::StreamBlock;
use crate::surface::{Frame, SurfaceBlock, Surfaces};

columns! {
    /// Vertices of a block of paths, in columns.
    #[derive(Debug)]
    pub struct Vertices {
        count: usize,
        /// Number of lanes that scatter.
        alive: usize,
        /// Whether the lane is a Lambert reflector, computed in vectors.
        pub is_lambert: Flags,
        /// Lanes of all other vertices, with their BSDFs.
        pub others: Vec<Other>,
        /// BSDFs of the vertices whose material varies.
        made: Vec<Bsdf>,
        /// Number of the sample in the batch.
        pub sample: Flags,
        pub throughput: Column3,
        pub expansion: Column,
        /// Reflectance of Lambert reflectors.
        pub reflectance: Column3,
        pub streams: StreamBlock,
        pub local: Local,
    }
}

zero!(StreamBlock Local);

/// A vertex that is no Lambert reflector.
#[derive(Clone, Copy, Debug)]
pub struct Other {
    pub lane: usize,
    /// Place among the world's materials.
    material: u32,
    /// Place among the BSDFs that were made, if the material varies.
    made: u32,
}

/// Frames in which the BSDFs are evaluated.
#[derive(Debug, Default)]
pub struct Local {
    pub axes: [Column3; 3],
    /// Direction towards the previous vertex, in the frame.
    pub wo: Column3,
}

impl Local {
    /// Frame of a lane.
    #[inline(always)]
    pub fn frame(&self, lane: usize) -> Frame {
        let [x, y, z] = &self.axes;
        Frame::of_axes([x.get(lane), y.get(lane), z.get(lane)])
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, frame: Frame, wo: Vec3) {
        for (column, axis) in self.axes.iter_mut().zip(frame.axes()) {
            column.set(lane, axis);
        }
        self.wo.set(lane, frame.to_local(wo));
    }
}

/// Vertices on their surfaces.
pub struct OnSurfaces<'a> {
    vertices: &'a Vertices,
    surfaces: &'a Surfaces,
    origin_offset: f32,
}

impl Points for OnSurfaces<'_> {
    #[inline(always)]
    fn frame(&self, lane: usize) -> Frame {
        self.vertices.local.frame(lane)
    }

    #[inline(always)]
    fn wo(&self, lane: usize) -> Vec3 {
        self.vertices.local.wo.get(lane)
    }

    #[inline(always)]
    fn reflectance(&self, lane: usize) -> Vec3 {
        self.vertices.reflectance.get(lane)
    }

    #[inline(always)]
    fn throughput(&self, lane: usize) -> Vec3 {
        self.vertices.throughput.get(lane)
    }

    #[inline(always)]
    fn point(&self, lane: usize) -> Vec3 {
        self.surfaces.point.get(lane)
    }

    #[inline(always)]
    fn faces_same_side(&self, lane: usize, wi: Vec3) -> bool {
        self.surfaces.faces_same_side(lane, wi)
    }

    #[inline(always)]
    fn leave(&self, lane: usize, dir: Vec3) -> Vec3 {
        self.surfaces.leave(lane, dir)
    }

    #[inline(always)]
    fn origin_offset(&self) -> f32 {
        self.origin_offset
    }

    #[inline(always)]
    fn directions(&self) -> f32 {
        1.0
    }
}

/// Hits that become vertices.
pub struct Meeting<'a> {
    pub world: &'a World,
    /// Hits, whose block is computed.
    pub hits: &'a Hits,
    pub current: &'a Paths,
    /// Places of the paths of the block.
    pub places: &'a [u32],
    /// Whether the paths end here.
    pub ends: bool,
    /// Whether rays come straight from the camera.
    pub from_camera: bool,
}

impl Meeting<'_> {
    /// Adds the emission that the paths hit.
    fn emit(&self, batch: &mut Batch) {
        let block = self.hits.block();
        for (lane, &place) in self.places.iter().enumerate() {
            let state = &self.current.states[place as usize];
            let shape = block.hit[lane].shape as usize;
            let emitted = if self.world.lights.emitter(shape).is_some() {
                emitted_light(self.world, &state.origin, &block.surface(lane))
            } else {
                Vec3::ZERO
            };
            batch.emitted[state.sample as usize] += state.throughput * emitted;
        }
    }
}

impl Vertices {
    /// Number of lanes with a hit.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Whether no lane scatters.
    pub fn is_empty(&self) -> bool {
        self.alive == 0
    }

    /// The vertices as points where light arrives, on their surfaces.
    pub fn on<'a>(&'a self, surfaces: &'a SurfaceBlock) -> OnSurfaces<'a> {
        OnSurfaces {
            vertices: self,
            surfaces: surfaces.columns(),
            origin_offset: surfaces.origin_offset(),
        }
    }

    /// BSDF of a vertex that is no Lambert reflector.
    #[inline]
    pub fn bsdf<'a>(&'a self, world: &'a World, other: &Other) -> &'a Bsdf {
        match &world.materials[other.material as usize] {
            Material::Constant(bsdf) => bsdf,
            _ => &self.made[other.made as usize],
        }
    }

    /// Adds the emission that the paths hit, and takes the points where they scatter. Paths that go on behind a surface
    /// without a material go `through`.
    pub fn meet(
        &mut self,
        isa: Isa,
        meeting: &Meeting,
        batch: &mut Batch,
        through: &mut Paths,
        asked: &mut Asked,
    ) {
        let Meeting {
            world,
            hits,
            current,
            places,
            ..
        } = *meeting;
        let block = hits.block();
        self.count = places.len();
        self.alive = 0;
        self.others.clear();
        self.made.clear();
        let surfaces = block.columns();
        meeting.emit(batch);
        if meeting.ends {
            return;
        }
        run(isa, Turn(surfaces), &mut self.local);
        run(isa, Face(surfaces), asked);
        for (lane, &place) in places.iter().enumerate() {
            let index = place as usize;
            let state = &current.states[index];
            let (sample, throughput) = (state.sample, state.throughput);
            (self.is_lambert[lane], asked.wants[lane]) = (0, 0);
            let material = world.shapes[block.hit[lane].shape as usize].material;
            let bsdf = match &world.materials[material] {
                Material::None => {
                    current.go_through(index, &block.surface(lane), through);
                    continue;
                }
                Material::Constant(bsdf) if !bsdf.is_anisotropic() => bsdf,
                _ => {
                    let surface = block.surface(lane);
                    let own = (&current.rays[index], sample, meeting.from_camera);
                    let found = hits
                        .hit(index)
                        .and_then(|hit| shade(world, batch, own, &surface, hit));
                    let Some((bsdf, frame)) = found else {
                        continue;
                    };
                    self.local.set(lane, frame, surface.wo);
                    match bsdf {
                        Cow::Borrowed(bsdf) => bsdf,
                        Cow::Owned(bsdf) => {
                            self.made.push(bsdf);
                            &self.made[self.made.len() - 1]
                        }
                    }
                }
            };
            if bsdf.is_black() {
                continue;
            }
            self.alive += 1;
            asked.wants[lane] = u32::from(bsdf.delta_share() < 1.0);
            asked.both_sides[lane] = u32::from(bsdf.transmits());
            if let Some(reflectance) = bsdf.lambert() {
                self.is_lambert[lane] = 1;
                self.reflectance.set(lane, reflectance);
            } else {
                self.others.push(Other {
                    lane,
                    material: material as u32,
                    made: self.made.len().wrapping_sub(1) as u32,
                });
            }
            self.sample[lane] = sample;
            self.throughput.set(lane, throughput);
            self.expansion[lane] = state.expansion;
            self.streams.set(lane, &batch.streams[sample as usize]);
        }
    }
}

impl Paths {
    /// Lets a path go on through a surface without a material.
    fn go_through(&self, index: usize, surface: &Surface, through: &mut Paths) {
        let mut state = self.states[index];
        if let Origin::Scattered { .. } = state.origin {
            state.origin = Origin::Hidden;
        }
        through.push(surface.ray_along(self.rays[index].dir.into()), state);
    }
}

/// Frames around the shading normals.
struct Turn<'a>(&'a Surfaces);

impl Stage for Turn<'_> {
    type Out = Local;

    #[inline(always)]
    fn run(self, out: &mut Local) {
        for lane in 0..BLOCK {
            let frame = Frame::around(self.0.shading_normal.get(lane));
            out.set(lane, frame, self.0.wo.get(lane));
        }
    }
}

/// Points and normals as lights see them.
struct Face<'a>(&'a Surfaces);

impl Stage for Face<'_> {
    type Out = Asked;

    #[inline(always)]
    fn run(self, out: &mut Asked) {
        for lane in 0..BLOCK {
            let (normal, wo) = (self.0.normal.get(lane), self.0.wo.get(lane));
            let side = if normal.dot(wo) < 0.0 { -1.0 } else { 1.0 };
            out.point.set(lane, self.0.point.get(lane));
            out.normal.set(lane, normal * side);
        }
    }
}
