//! Leaves of partly transparent triangles: the test of other triangles, and then, for what is hit, the filter.

use alloc::vec::Vec;

pub(crate) mod join;
pub(crate) mod micromap;
pub(crate) mod opacity;
pub(crate) mod saved;

use alloc::sync::Arc;

use antumbra_simd::Simd;

use crate::aabb::Aabb;
use crate::geometry::best::{Best, TreeHit};
use crate::geometry::cutout::join::Joined;
use crate::geometry::cutout::micromap::{MapRef, MicroMaps};
use crate::geometry::cutout::opacity::{Opacity, QueryKind, accepts};
use crate::geometry::leaf_block::{InBlock, LeafBlock, Normal};
use crate::geometry::moved::Moved;
use crate::geometry::nearest::{Near, Place};
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::{LanesOf, TriangleBlock};
use crate::geometry::{BLOCK, GeometryId, PrimRef};
use crate::ray::{Hit, Ray};

/// Up to [`BLOCK`] partly transparent triangles of a leaf.
///
/// 416 bytes.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct CutoutBlock {
    pub triangles: TriangleBlock,
    /// Per lane, what is known without calling the filter.
    pub maps: [MapRef; BLOCK],
    /// Per lane, what it shows: one of [`Filters::representatives`]; of no meaning in empty lanes.
    pub patterns: [u32; BLOCK],
}

/// The filters and micromaps that decide whether hits of cut-outs count. All trees over the same primitives share one
/// value, for the world and its objects.
#[derive(Clone, Debug, Default)]
pub(crate) struct Filters {
    pub opacities: Vec<MeshFilter>,
    /// Per pattern, one triangle that shows it. The filter is called with that triangle for all of them, so that its
    /// data is more likely to be in a cache.
    pub representatives: Vec<Representative>,
    pub maps: MicroMaps,
}

/// The filter of a mesh.
#[derive(Clone, Debug)]
pub(crate) struct MeshFilter {
    pub mesh: GeometryId,
    pub opacity: Arc<dyn Opacity>,
}

/// A triangle that filters are called with for all triangles of the same pattern.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Representative {
    /// Index of the triangle's filter in [`Filters::opacities`].
    pub filter: u32,
    pub id: PrimRef,
}

impl Filters {
    /// Whether there are such a micromap and such a pattern, and its filter.
    pub fn knows(&self, map: MapRef, pattern: u32) -> bool {
        let asked = self.representatives.get(pattern as usize);
        asked.is_some_and(|asked| (asked.filter as usize) < self.opacities.len())
            && self.maps.contains(map)
    }

    /// Bytes of memory, but for what users gave.
    pub fn bytes(&self) -> usize {
        self.maps.bytes() + size_of_val(&self.representatives[..])
    }
}

impl CutoutBlock {
    /// Part of the map of a lane that decides whether a hit counts, see [`MicroMaps::part`].
    #[inline(always)]
    pub fn part(&self, lane: usize, [u, v]: [f32; 2], filters: &Filters) -> usize {
        filters.maps.part(self.maps[lane], u, v)
    }

    /// Calls the filter: whether a hit in this lane counts.
    #[inline(never)]
    fn ask(
        &self,
        lane: usize,
        uv: [f32; 2],
        query: QueryKind,
        ray: &RaySetup,
        filters: &Filters,
    ) -> bool {
        let asked = &filters.representatives[self.patterns[lane] as usize];
        let filter = &*filters.opacities[asked.filter as usize].opacity;
        accepts(filter, asked.id, uv, ray, self.id(lane), query)
    }
}

impl InBlock for CutoutBlock {
    type Block = Self;
}

impl LeafBlock for CutoutBlock {
    const KIND: PrimKind = PrimKind::Cutout;
    const EMPTY: Self = Self {
        triangles: TriangleBlock::EMPTY,
        maps: [MapRef::UNKNOWN; BLOCK],
        patterns: [u32::MAX; BLOCK],
    };

    fn count(&self) -> usize {
        self.triangles.count()
    }

    #[inline(always)]
    fn id(&self, lane: usize) -> PrimRef {
        self.triangles.id(lane)
    }

    fn bounds(&self, lane: usize) -> Aabb {
        self.triangles.bounds(lane)
    }

    fn fill(&mut self, primitives: &Primitives, prims: &[u32]) {
        primitives.set_triangles(&mut self.triangles, prims);
        for (lane, &prim) in prims.iter().enumerate() {
            let known = primitives.cutout(prim as usize);
            self.maps[lane] = known.map;
            self.patterns[lane] = known.pattern;
        }
    }

    fn permute(&mut self, lanes: &[u8; BLOCK]) {
        self.triangles.permute(lanes);
        let (patterns, maps) = (self.patterns, self.maps);
        for (lane, &from) in lanes.iter().enumerate() {
            self.patterns[lane] = patterns[from as usize];
            self.maps[lane] = maps[from as usize];
        }
    }

    #[inline(always)]
    fn candidates<S: Simd, const STREAM: bool>(
        &self,
        simd: S,
        ray: &RaySetup,
        limit: f32,
    ) -> LanesOf {
        self.triangles.candidates::<S, STREAM>(simd, ray, limit)
    }

    fn hit(
        &self,
        lane: usize,
        ray: &RaySetup,
        filters: &Filters,
        query: QueryKind,
    ) -> Option<TreeHit> {
        let values = self.triangles.values(lane, ray)?;
        let counts = CutoutHit::new(self, lane, values, filters).counts(query, ray, filters);
        counts.then(|| self.triangles.refined_hit(lane, ray, values[0]))
    }

    #[inline(never)]
    fn improve(&self, lanes: LanesOf, ray: &RaySetup, filters: &Filters, best: &mut Best) -> bool {
        let mut improved = false;
        for lane in lanes {
            let values = self.triangles.values(lane, ray);
            if let Some(values) = values.filter(|[t, ..]| *t <= best.limit) {
                let hit = CutoutHit::new(self, lane, values, filters);
                improved |= hit.improves(best, ray, filters);
            }
        }
        improved
    }

    fn corners(&self, lane: usize) -> Option<[[f32; 3]; 3]> {
        self.triangles.corners(lane)
    }

    fn normal(&self, lane: usize, ray: &Ray, hit: &Hit) -> Option<Normal> {
        self.triangles.normal(lane, ray, hit)
    }

    fn near(&self, lane: usize, place: &Place<'_>) -> Option<Near> {
        self.triangles.near(lane, place)
    }

    fn crossing(&self, lane: usize, point: [f64; 3]) -> i32 {
        self.triangles.crossing(lane, point)
    }

    fn is_there(moved: &Moved<'_>, id: PrimRef) -> bool {
        TriangleBlock::is_there(moved, id)
    }

    fn refill(&mut self, moved: &Moved<'_>) -> Aabb {
        self.triangles.refill(moved)
    }

    fn joined(&self, how: Joined) -> Self {
        let mut block = self.clone();
        for lane in 0..block.count() {
            block.maps[lane] = how.maps.of(block.maps[lane]);
            block.patterns[lane] += how.pattern;
        }
        block
    }
}

/// A hit of a partly transparent triangle, before it is known whether the hit counts.
#[derive(Clone, Copy)]
pub(crate) struct CutoutHit<'a> {
    pub block: &'a CutoutBlock,
    pub lane: usize,
    /// `t`, `u` and `v` that decide.
    pub values: [f32; 3],
    /// See [`CutoutBlock::part`].
    pub part: usize,
}

impl<'a> CutoutHit<'a> {
    /// Looks up the part of the map.
    #[inline(always)]
    pub fn new(block: &'a CutoutBlock, lane: usize, values: [f32; 3], filters: &Filters) -> Self {
        let [_, u, v] = values;
        Self {
            block,
            lane,
            values,
            part: block.part(lane, [u, v], filters),
        }
    }

    /// Whether the hit counts. The filter is called where the maps do not know.
    #[inline(always)]
    pub fn counts(&self, query: QueryKind, ray: &RaySetup, filters: &Filters) -> bool {
        let [_, u, v] = self.values;
        let known = filters.maps.accepts(self.part);
        known.unwrap_or_else(|| self.block.ask(self.lane, [u, v], query, ray, filters))
    }

    /// Replaces `best` by this hit if it counts and precedes it, and returns whether it did. The filter costs the most,
    /// so it is called last.
    #[inline(always)]
    pub fn improves(&self, best: &mut Best, ray: &RaySetup, filters: &Filters) -> bool {
        let (triangles, lane, t) = (&self.block.triangles, self.lane, self.values[0]);
        let improved = best.offer_if(triangles.hit_at(lane, t), |_| {
            self.counts(QueryKind::Intersect, ray, filters)
        });
        if improved {
            best.refine(triangles.refined(lane, ray, t));
        }
        improved
    }
}
