//! The test of lifted occluders, a few triangles that occlude many rays: out of turn, before a ray visits the root.

use antumbra_simd::{Simd, Width, WithSimd};

use crate::geometry::ray_setup::RaySetup;
use crate::geometry::triangle::TriangleBlock;
use crate::ray::Ray;

/// Tells which rays one of the blocks occludes. An occluder found is an answer, as boxes never hide what a leaf holds.
pub(crate) struct TestLifted<'a> {
    /// Scene extent of the tree of which these blocks hold copies.
    pub reach: f32,
    pub blocks: &'a [TriangleBlock],
    pub rays: &'a [Ray],
    /// As long as `rays`.
    pub occluded: &'a mut [bool],
}

impl WithSimd<8> for TestLifted<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, simd: S) {
        let mut setup = RaySetup::IDLE;
        for (ray, occluded) in self.rays.iter().zip(self.occluded) {
            *occluded = setup.set(simd, ray, self.reach) && {
                let mut blocks = self.blocks.iter();
                blocks.any(|block| block.occluded::<S, false>(simd, &setup).is_some())
            };
        }
    }
}
