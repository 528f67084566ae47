//! Hits of cut-outs in a wave, which wait until it is known whether they count.
//!
//! Where a leaf of a plant is clear is written in a map somewhere else. To look it up at once would have the ray wait for
//! memory, and the CPU guess what it finds. So hits are collected without a branch while leaves are tested, all that is
//! needed to decide is asked for, and then one after the other is settled.

use antumbra_simd::{Lanes, Mask, Simd};

use crate::geometry::BLOCK;
use crate::geometry::cutout::opacity::QueryKind;
use crate::geometry::cutout::{CutoutBlock, Filters};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::VectorHits;
use crate::ray::{Hit, INVALID_ID};

/// Hits that wait.
#[derive(Debug)]
pub(crate) struct Deferred {
    len: usize,
    /// Of each hit: where its ray is in the wave, the lane of the block, the bits of distance and barycentrics.
    slots: Vec<u32>,
    lanes: Vec<u32>,
    t: Vec<u32>,
    u: Vec<u32>,
    v: Vec<u32>,
    /// Where it says whether it counts, see [`MicroMaps::part`].
    ///
    /// [`MicroMaps::part`]: crate::geometry::cutout::micromap::MicroMaps::part
    parts: Vec<usize>,
}

/// One of them.
#[derive(Clone, Copy)]
pub(crate) struct DeferredHit<'a> {
    pub slot: usize,
    block: &'a CutoutBlock,
    lane: usize,
    t: f32,
    u: f32,
    v: f32,
    part: usize,
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

    /// Asks for the memory that says which of them count. `block` tells where the ray of a slot is.
    #[inline(always)]
    pub fn look_up<'a, S: Simd>(
        &mut self,
        simd: S,
        filters: &Filters,
        block: impl Fn(usize) -> &'a CutoutBlock,
    ) {
        for index in 0..self.len {
            let map = block(self.slots[index] as usize).maps[self.lanes[index] as usize];
            let [u, v] = [self.u[index], self.v[index]].map(f32::from_bits);
            let part = filters.maps.part(map, u, v);
            filters.maps.prefetch(simd, part);
            self.parts[index] = part;
        }
    }

    /// Takes them, first come, first served.
    #[inline(always)]
    pub fn take<'a>(
        &mut self,
        block: impl Fn(usize) -> &'a CutoutBlock,
    ) -> impl Iterator<Item = DeferredHit<'a>> {
        let len = core::mem::take(&mut self.len);
        let this = &*self;
        (0..len).map(move |index| {
            let slot = this.slots[index] as usize;
            let [t, u, v] = [this.t[index], this.u[index], this.v[index]].map(f32::from_bits);
            DeferredHit {
                slot,
                block: block(slot),
                lane: this.lanes[index] as usize,
                t,
                u,
                v,
                part: this.parts[index],
            }
        })
    }
}

impl DeferredHit<'_> {
    /// Whether it counts.
    #[inline(always)]
    pub fn counts(&self, query: QueryKind, ray: &RaySetup, filters: &Filters) -> bool {
        let known = filters.maps.accepts(self.part);
        known.unwrap_or_else(|| {
            let uv = [self.u, self.v];
            self.block.ask(self.lane, uv, query, ray, filters)
        })
    }

    #[inline(always)]
    pub fn hit(&self) -> Hit {
        Hit {
            t: self.t,
            u: self.u,
            v: self.v,
            prim_id: self.block.triangles.prim_ids[self.lane],
            geom_id: self.block.triangles.geom_ids[self.lane],
            inst_id: INVALID_ID,
        }
    }
}
