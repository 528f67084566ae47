//! Leaf blocks of every kind: what building, checking and reordering a tree needs of each.
//!
//! Tracing uses the blocks directly, see [`crate::trace::step`].

use antumbra_simd::{Scalar, Simd};

use crate::aabb::Aabb;
use crate::geometry::cutout::CutoutBlock;
use crate::geometry::primitives::{PrimKind, Primitives};
use crate::geometry::sphere::SphereBlock;
use crate::geometry::triangle::TriangleBlock;
use crate::geometry::user::UserBlock;
use crate::geometry::{BLOCK, PrimRef};

/// Up to [`BLOCK`] primitives of one kind, laid out for their test. Occupied lanes come first.
pub(crate) trait LeafBlock: Clone + Send + Sync {
    /// Kind of the primitives.
    const KIND: PrimKind;
    /// A block without primitives.
    const EMPTY: Self;

    /// How many lanes are occupied.
    fn count(&self) -> usize;

    /// Name of the primitive in an occupied lane.
    fn id(&self, lane: usize) -> PrimRef;

    /// Bounds of the primitive in an occupied lane.
    fn bounds(&self, lane: usize) -> Aabb;

    /// Writes primitives of this kind, by their numbers, into the first lanes of an empty block.
    fn fill(&mut self, primitives: &Primitives, prims: &[u32]);

    /// Puts the primitive of lane `lanes[i]` into lane `i`.
    fn permute(&mut self, lanes: &[u8; BLOCK]);

    /// Asks for the memory that [`LeafBlock::fill`] reads of a primitive.
    fn prefetch(_primitives: &Primitives, _prim: u32) {}
}

impl LeafBlock for TriangleBlock {
    const KIND: PrimKind = PrimKind::Triangle;
    const EMPTY: Self = Self::EMPTY;

    fn count(&self) -> usize {
        self.count()
    }

    fn id(&self, lane: usize) -> PrimRef {
        PrimRef {
            geom_id: self.geom_ids[lane],
            prim_id: self.prim_ids[lane],
        }
    }

    fn bounds(&self, lane: usize) -> Aabb {
        Aabb::around(&self.triangle(lane))
    }

    fn fill(&mut self, primitives: &Primitives, prims: &[u32]) {
        primitives.set_triangles(self, prims);
    }

    fn permute(&mut self, lanes: &[u8; BLOCK]) {
        self.permute(lanes);
    }

    fn prefetch(primitives: &Primitives, prim: u32) {
        let [first, _, last] = &primitives.triangles[prim as usize];
        Scalar.prefetch(first);
        Scalar.prefetch(last);
        Scalar.prefetch(&primitives.triangle_refs[prim as usize]);
    }
}

impl LeafBlock for CutoutBlock {
    const KIND: PrimKind = PrimKind::Cutout;
    const EMPTY: Self = Self::EMPTY;

    fn count(&self) -> usize {
        self.triangles.count()
    }

    fn id(&self, lane: usize) -> PrimRef {
        LeafBlock::id(&self.triangles, lane)
    }

    fn bounds(&self, lane: usize) -> Aabb {
        LeafBlock::bounds(&self.triangles, lane)
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
        self.permute(lanes);
    }
}

impl LeafBlock for SphereBlock {
    const KIND: PrimKind = PrimKind::Sphere;
    const EMPTY: Self = Self::EMPTY;

    fn count(&self) -> usize {
        self.count
    }

    fn id(&self, lane: usize) -> PrimRef {
        self.refs[lane]
    }

    fn bounds(&self, lane: usize) -> Aabb {
        self.spheres[lane].bounds()
    }

    fn fill(&mut self, primitives: &Primitives, prims: &[u32]) {
        for &prim in prims {
            let (sphere, id) = primitives.sphere(prim as usize);
            self.push(sphere, id);
        }
    }

    fn permute(&mut self, lanes: &[u8; BLOCK]) {
        self.permute(lanes);
    }
}

impl LeafBlock for UserBlock {
    const KIND: PrimKind = PrimKind::User;
    const EMPTY: Self = Self::EMPTY;

    fn count(&self) -> usize {
        self.count
    }

    fn id(&self, lane: usize) -> PrimRef {
        self.refs[lane]
    }

    fn bounds(&self, lane: usize) -> Aabb {
        let prim = self.prims[lane].as_ref();
        prim.map_or(Aabb::EMPTY, |prim| prim.bounds)
    }

    fn fill(&mut self, primitives: &Primitives, prims: &[u32]) {
        for &prim in prims {
            let (prim, id) = primitives.user(prim as usize);
            self.push(prim.clone(), id);
        }
    }

    fn permute(&mut self, lanes: &[u8; BLOCK]) {
        self.permute(lanes);
    }
}
