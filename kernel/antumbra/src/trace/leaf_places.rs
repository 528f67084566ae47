//! Prefetching leaves without a branch on their kind, which no CPU can guess.
//!
//! With such a branch occlusion in batches is 1.02 times slower on sponza (Zen 3).

use core::mem::offset_of;

use antumbra_simd::Simd;

use crate::geometry::BLOCK;
use crate::geometry::cutout::CutoutBlock;
use crate::geometry::cutout::micromap::MapRef;
use crate::geometry::triangle::TriangleBlock;
use crate::tree::node::Child;
use crate::tree::wide::WideTree;

/// Addresses of the leaf blocks of a tree, for prefetching.
pub(crate) struct LeafPlaces {
    /// By [`Child::leaf_kind`].
    kinds: [Blocks; 4],
    has_cutouts: bool,
}

/// Address and size of the blocks of a kind.
#[derive(Clone, Copy)]
struct Blocks {
    first: *const u8,
    /// Bytes of a block.
    bytes: usize,
    /// Where in a block the maps of cut-outs are. In blocks of other kinds 0: the beginning is prefetched anyway.
    maps: usize,
}

impl Blocks {
    fn new<T>(blocks: &[T], maps: usize) -> Self {
        Self {
            first: blocks.as_ptr().cast(),
            bytes: size_of::<T>(),
            maps,
        }
    }
}

impl LeafPlaces {
    pub fn new<const N: usize>(bvh: &WideTree<N>) -> Self {
        let triangles = Blocks::new(&bvh.blocks.triangles, 0);
        let cutouts = Blocks::new(&bvh.blocks.cutouts, offset_of!(CutoutBlock, maps));
        // A leaf of another kind asks for the first block of triangles, which is always there.
        let other = Blocks {
            bytes: 0,
            ..triangles
        };
        Self {
            kinds: [triangles, other, cutouts, other],
            has_cutouts: !bvh.blocks.cutouts.is_empty(),
        }
    }

    /// Prefetches what the test of a leaf of triangles or cut-outs looks at first.
    #[inline(always)]
    pub fn prefetch<S: Simd>(&self, simd: S, leaf: Child) {
        const CORNERS: usize = offset_of!(TriangleBlock, geom_ids);
        let Blocks { first, bytes, maps } = self.kinds[leaf.leaf_kind()];
        let block = first.wrapping_add(bytes * leaf.index());
        simd.prefetch_at(block.cast::<[u8; CORNERS]>());
        // Guessed right: the condition is the same throughout a stream.
        if self.has_cutouts {
            simd.prefetch_at(block.wrapping_add(maps).cast::<[MapRef; BLOCK]>());
        }
    }
}
