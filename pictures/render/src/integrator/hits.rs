//! Closest hits of many rays, and the surfaces that were hit.

use antumbra::{Hit, Isa, Ray};

use super::tracer::Tracer;
use crate::columns::BLOCK;
use crate::light::{EmitterTree, before};
use crate::surface::{Shapes, Surface, SurfaceBlock};

/// Hits of the rays of one stage.
#[derive(Debug)]
pub struct Hits {
    hits: Vec<Option<Hit>>,
    isa: Isa,
    surfaces: Box<SurfaceBlock>,
    /// Block of rays whose surfaces are computed, if any, the places of the rays that hit something, and the lane of
    /// every ray.
    block: Option<usize>,
    places: Vec<u32>,
    lanes: Vec<u8>,
}

impl Default for Hits {
    fn default() -> Self {
        Self {
            hits: Vec::new(),
            isa: Isa::best(),
            surfaces: Box::default(),
            block: None,
            places: Vec::new(),
            lanes: Vec::new(),
        }
    }
}

impl Hits {
    /// Traces `rays`, which belong to `samples` of the batch. Earlier hits are forgotten.
    pub fn find(&mut self, tracer: &mut Tracer, rays: &[Ray], samples: impl Iterator<Item = u32>) {
        tracer.intersect(rays, samples, &mut self.hits);
        self.isa = tracer.isa();
        self.block = None;
    }

    /// Finds the first emitter on each ray, whatever is before it. Earlier hits are forgotten.
    pub fn find_emitters(&mut self, emitters: &EmitterTree, rays: &[Ray]) {
        emitters.find(rays, &mut self.hits);
        self.block = None;
    }

    /// Surface that ray `index` of the traced `rays` has hit. Quick if called with ascending indices.
    pub fn surface(&mut self, shapes: &Shapes, rays: &[Ray], index: usize) -> Option<Surface> {
        self.hits[index].as_ref()?;
        let block = index / BLOCK;
        if self.block != Some(block) {
            self.places.clear();
            self.lanes.clear();
            let first = block * BLOCK;
            for place in first..self.hits.len().min(first + BLOCK) {
                self.lanes.push(self.places.len() as u8);
                if self.hits[place].is_some() {
                    self.places.push(place as u32);
                }
            }
            self.prefetch(shapes, &self.places);
            self.surfaces
                .compute(self.isa, shapes, rays, &self.hits, &self.places);
            self.block = Some(block);
        }
        Some(
            self.surfaces
                .surface(usize::from(self.lanes[index % BLOCK])),
        )
    }

    /// Surface that ray `index` of the traced `rays` has hit, and the part of the ray before it.
    pub fn surface_and_way(
        &mut self,
        shapes: &Shapes,
        rays: &[Ray],
        index: usize,
    ) -> Option<(Surface, Ray)> {
        let way = before(&rays[index], self.hit(index)?);
        Some((self.surface(shapes, rays, index)?, way))
    }

    /// Prefetches the triangles hit at these places, whose surfaces will be computed.
    pub fn prefetch(&self, shapes: &Shapes, places: &[u32]) {
        SurfaceBlock::prefetch(self.isa, shapes, &self.hits, places);
    }

    /// Computes the surfaces that the traced `rays` at these places have hit, at most [`BLOCK`].
    ///
    /// # Panics
    /// If one of them has hit nothing.
    pub fn compute(&mut self, shapes: &Shapes, rays: &[Ray], places: &[u32]) {
        self.block = None;
        self.surfaces
            .compute(self.isa, shapes, rays, &self.hits, places);
    }

    /// The surfaces computed last.
    #[inline]
    pub fn block(&self) -> &SurfaceBlock {
        &self.surfaces
    }

    /// Instruction set of the tree whose hits these are.
    #[inline]
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Hit of ray `index`.
    #[inline]
    pub fn hit(&self, index: usize) -> Option<&Hit> {
        self.hits[index].as_ref()
    }
}
