//! Binary trees over a world, each with what synthetic rays meet in it.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use antumbra::{
    AnyBvh, BinaryTree, Builder, Collapse, Isa, Learning, Primitives, Ray, TreeLog, Width,
    surface_rays,
};

/// A binary tree, and how long it took.
#[derive(Debug)]
pub struct BuiltTree {
    tree: BinaryTree,
    time: Duration,
    /// Made on first use, and how long that took.
    surface_log: OnceLock<(TreeLog, Duration)>,
}

impl BuiltTree {
    /// Builds it, for surface rays if the builder needs rays.
    pub fn new(primitives: &Primitives, builder: Builder) -> Self {
        Self::timed(|| BinaryTree::build(primitives, builder))
    }

    /// Builds it for `rays` and as many surface rays: what the camera sees decides, and what it does not see is
    /// not forgotten.
    pub fn for_rays(primitives: &Primitives, builder: Builder, rays: &[Ray]) -> Self {
        /// Any seed does; results must not depend on when or where they are computed.
        const SEED: u64 = 2012;
        Self::timed(|| {
            let mut all = rays.to_vec();
            all.extend(surface_rays(primitives, rays.len(), SEED));
            BinaryTree::build_for(primitives, builder, &all)
        })
    }

    fn timed(build: impl FnOnce() -> BinaryTree) -> Self {
        let start = Instant::now();
        let tree = build();
        Self {
            tree,
            time: start.elapsed(),
            surface_log: OnceLock::new(),
        }
    }

    /// How long it took to build.
    pub fn time(&self) -> Duration {
        self.time
    }

    /// What synthetic rays from all surfaces meet in it: as many, of as much weight, as [`AnyBvh::build`] learns
    /// from. Made on first use, in the current rayon pool, and kept.
    pub fn surface_log(&self, primitives: &Primitives) -> &TreeLog {
        if let Some((log, _)) = self.surface_log.get() {
            return log;
        }
        let start = Instant::now();
        let log = TreeLog::of_surfaces(primitives, &self.tree, None);
        // Whoever comes first: all are equal. (Made inside `get_or_init`, the log could wait for itself: its
        // thread may take up another task of the pool in the meantime.)
        &self.surface_log.get_or_init(|| (log, start.elapsed())).0
    }

    /// How long the log of surface rays took; zero if nobody asked for it yet.
    pub fn surface_log_time(&self) -> Duration {
        self.surface_log.get().map_or(Duration::ZERO, |made| made.1)
    }

    /// Adds the rays that the tree is for to a log of it, see [`TreeLog::weight_for`].
    pub fn follow(&self, primitives: &Primitives, log: &mut TreeLog, rays: &[Ray]) {
        log.add(primitives, &self.tree, rays, log.weight_for(rays));
    }

    /// A wide tree that nothing is learned for.
    pub fn unlogged(
        &self,
        primitives: &Primitives,
        collapse: Collapse,
        width: Width,
        isa: Isa,
    ) -> AnyBvh {
        AnyBvh::collapse_unlogged(primitives, &self.tree, collapse, width, isa)
    }

    /// A wide tree learned from a log of this tree.
    pub fn logged(
        &self,
        primitives: &Primitives,
        log: &TreeLog,
        learning: &Learning,
        width: Width,
        isa: Isa,
    ) -> AnyBvh {
        AnyBvh::collapse_logged(primitives, &self.tree, log, learning, width, isa)
    }
}
