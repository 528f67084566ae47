//! Whether batches prefetch nodes and leaves.
//!
//! Prefetching is a fifth of the instructions of a node step (AVX2), and gains nothing if the tree stays in the first
//! cache. Trees of 30 thousand to two million triangles are 1.03 to 1.43 times as fast with it, and none was slower
//! beyond noise (`docs/notes/attempts.md`), so the size of the first cache decides.

use super::bvh::Bvh;

/// Bytes of the smallest first data cache of CPUs with vectors: those with a larger one gain little from a few more.
const FIRST_CACHE: usize = 32 << 10;

impl Bvh {
    /// Whether batches prefetch: as the recipe says, or else where the tree is larger than the first cache.
    pub(crate) fn prefetches(&self) -> bool {
        let is_large = || self.tree.bytes() > FIRST_CACHE;
        self.prefetch.unwrap_or_else(is_large)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Recipe;
    use crate::geometry::Geometry;
    use crate::order::Order;
    use antumbra_testkit::{Rng, mesh};

    #[test]
    fn large_trees_prefetch_unless_the_recipe_says_otherwise() {
        let recipe = Recipe::fast();
        for (size, is_large) in [(30, false), (3000, true)] {
            let mesh = mesh::soup(&mut Rng::new(77), size);
            let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
            let prefetches = |choice| {
                let bvh = Bvh::build(&geometry, &recipe.prefetch(choice)).expect("in range");
                bvh.report().prefetches
            };
            assert_eq!(prefetches(None), is_large);
            assert!(prefetches(Some(true)) && !prefetches(Some(false)));
            // A tree that learns again keeps what it was told.
            let mut bvh = Bvh::build(&geometry, &recipe.prefetch(Some(!is_large))).expect("a tree");
            bvh.relearn(&[], &recipe.order(Order::Simple));
            assert_eq!(bvh.prefetches(), !is_large);
        }
    }
}
