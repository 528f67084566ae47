//! The tree that users hold.

use alloc::format;
use alloc::string::String;
use alloc::sync::Arc;

use antumbra_simd::Isa;

use super::times::BuildTimes;
use crate::aabb::Aabb;
use crate::geometry::masks::SceneMasks;
use crate::geometry::primitives::Primitives;
use crate::shape::Shape;
use crate::trace::memory::Pool;
use crate::tree::any::{Tree, on_tree};
use crate::tree::width::Width;

/// A tree of any width, with the instruction set it is traced by.
///
/// Every query returns the same bits for every width, order, level and builder. The tree can be shared among
/// any number of threads, by reference or in an [`Arc`](std::sync::Arc).
#[derive(Clone, Debug)]
pub struct Bvh {
    pub(crate) tree: Tree,
    pub(crate) isa: Isa,
    /// Stored ones, see [`Primitives::stored`].
    pub(crate) primitives: usize,
    pub(crate) cutouts: usize,
    pub(crate) dropped: usize,
    pub(crate) transparent: usize,
    pub(crate) pool: Pool,
    /// See [`Bvh::prefetches`].
    pub(crate) prefetch: bool,
    /// Fields of the [report](super::report::BuildReport).
    pub(crate) predicted_cost: Option<f64>,
    pub(crate) predicted_before: Option<f64>,
    pub(crate) training_rays: u64,
    pub(crate) times: Option<BuildTimes>,
    /// Expected cost before the first refit.
    pub(crate) built_sah: Option<f64>,
    /// Masks of geometries and instances, if any were given.
    pub(crate) masks: Option<Arc<SceneMasks>>,
}

impl Bvh {
    /// A tree over these primitives, fresh from its collapse.
    pub(crate) fn fresh(tree: Tree, isa: Isa, primitives: &Primitives) -> Self {
        Self {
            tree,
            isa,
            primitives: primitives.stored(),
            cutouts: primitives.cutouts(),
            dropped: primitives.dropped(),
            transparent: primitives.transparent(),
            pool: Pool::default(),
            prefetch: true,
            predicted_cost: None,
            predicted_before: None,
            training_rays: 0,
            times: None,
            built_sah: None,
            masks: None,
        }
    }

    /// A tree that nothing has joined yet.
    pub(crate) fn over_nothing(tree: Tree, isa: Isa) -> Self {
        Self::fresh(tree, isa, &Primitives::default())
    }

    /// Children per node.
    pub fn width(&self) -> Width {
        match &self.tree {
            Tree::W4(_) => Width::W4,
            Tree::W8(_) => Width::W8,
            Tree::W16(_) => Width::W16,
        }
    }

    /// The instruction set that queries run on.
    pub fn isa(&self) -> Isa {
        self.isa
    }

    /// Runs queries on another instruction set from now on.
    pub fn set_isa(&mut self, isa: Isa) {
        self.isa = isa;
    }

    /// The smallest box around everything; empty for an empty scene.
    pub fn bounds(&self) -> Aabb {
        on_tree!(&self.tree, tree => tree.bounds)
    }

    /// Checks every promise of the tree that traversal relies on; for tests and bug reports.
    ///
    /// # Errors
    /// The first broken promise, in words.
    pub fn validate(&self) -> Result<(), String> {
        let found = on_tree!(&self.tree, tree => tree.validate())?;
        if found == self.primitives {
            Ok(())
        } else {
            Err(format!(
                "{found} primitives in the leaves, not {}",
                self.primitives
            ))
        }
    }

    pub(crate) fn shape(&self) -> Shape {
        on_tree!(&self.tree, tree => tree.shape())
    }
}
