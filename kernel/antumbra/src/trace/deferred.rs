//! Deferred hits of cut-outs, in a ray stream.
//!
//! Micromap lookups miss the cache. Hits on cut-outs are therefore collected without a branch while leaves are tested,
//! and resolved a phase later, when the prefetch has arrived.

use alloc::vec;
use alloc::vec::Vec;

use antumbra_simd::{Lanes, Mask, Simd};

use crate::geometry::BLOCK;
use crate::geometry::cutout::{CutoutBlock, CutoutHit, Filters};
use crate::geometry::triangle::VectorHits;

/// Hits to be decided about.
#[derive(Debug)]
pub(crate) struct Deferred {
    len: usize,
    /// Per hit: the slot of its ray in the stream, the lane of the block, the bits of distance and barycentrics.
    slots: Vec<u32>,
    lanes: Vec<u32>,
    t: Vec<u32>,
    u: Vec<u32>,
    v: Vec<u32>,
    /// See [`CutoutHit::part`].
    parts: Vec<usize>,
}

impl Deferred {
    /// Room for the hits of so many blocks.
    pub fn new(blocks: usize) -> Self {
        // Whole vectors are written.
        let words = || vec![0; BLOCK * blocks];
        Self {
            len: 0,
            slots: words(),
            lanes: words(),
            t: words(),
            u: words(),
            v: words(),
            parts: vec![0; BLOCK * blocks],
        }
    }

    /// Adds what the ray in `slot` hits in a block. There is room for a whole block.
    #[inline(always)]
    pub fn add<S: Simd>(&mut self, slot: usize, found: &VectorHits<S>) {
        fn window(words: &mut [u32], first: usize) -> &mut [u32; BLOCK] {
            words[first..].first_chunk_mut().expect("room for a block")
        }
        let first = self.len;
        *window(&mut self.slots, first) = [slot as u32; BLOCK];
        let mut bits = [[0.0; BLOCK]; 3];
        found.t.store(&mut bits[0]);
        found.u.store(&mut bits[1]);
        found.v.store(&mut bits[2]);
        let [t, u, v] = bits.map(|lanes| lanes.map(f32::to_bits));
        let lanes = core::array::from_fn(|lane| lane as u32);
        found.hits.compress(&t, window(&mut self.t, first));
        found.hits.compress(&u, window(&mut self.u, first));
        found.hits.compress(&v, window(&mut self.v, first));
        self.len += found.hits.compress(&lanes, window(&mut self.lanes, first));
    }

    /// Prefetches the opacity micromaps that decide which hits count. `block` returns the block at which the ray of a
    /// slot is.
    #[inline(always)]
    pub fn look_up<'a, S: Simd>(
        &mut self,
        simd: S,
        filters: &Filters,
        block: impl Fn(usize) -> &'a CutoutBlock,
    ) {
        for index in 0..self.len {
            let block = block(self.slots[index] as usize);
            let uv = [self.u[index], self.v[index]].map(f32::from_bits);
            let part = block.part(self.lanes[index] as usize, uv, filters);
            filters.maps.prefetch(simd, part);
            self.parts[index] = part;
        }
    }

    /// Removes all hits and returns their number. Their values stay readable until the next hits overwrite them.
    #[inline(always)]
    pub fn clear(&mut self) -> usize {
        core::mem::take(&mut self.len)
    }

    /// A hit and the slot of its ray, first come, first served.
    #[inline(always)]
    pub fn get<'a>(
        &self,
        index: usize,
        block: impl Fn(usize) -> &'a CutoutBlock,
    ) -> (usize, CutoutHit<'a>) {
        let slot = self.slots[index] as usize;
        let hit = CutoutHit {
            block: block(slot),
            lane: self.lanes[index] as usize,
            values: [self.t[index], self.u[index], self.v[index]].map(f32::from_bits),
            part: self.parts[index],
        };
        (slot, hit)
    }
}
