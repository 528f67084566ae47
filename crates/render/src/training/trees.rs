//! Binary trees over a world, each with the training log of its surface rays.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use antumbra::{
    AnyBvh, BinaryTree, Builder, Collapse, Isa, Learning, Primitives, Ray, TreeLog, Width,
    surface_rays,
};

/// A binary tree, its surface log, and the times of both.
#[derive(Debug)]
pub struct BuiltTree {
    tree: BinaryTree,
    time: Duration,
    /// Surface log and its time, made on first use.
    surface_log: OnceLock<(TreeLog, Duration)>,
}

impl BuiltTree {
    /// Builds the tree, for surface rays if the builder needs rays.
    pub fn new(primitives: &Primitives, builder: Builder) -> Self {
        Self::timed(|| BinaryTree::build(primitives, builder))
    }

    /// Builds the tree for `rays` and as many surface rays. Surface rays stand for the parts of the scene that the
    /// camera does not see.
    pub fn for_rays(primitives: &Primitives, builder: Builder, rays: &[Ray]) -> Self {
        /// Seed of the surface rays. Any constant does.
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

    /// Time of building.
    pub fn time(&self) -> Duration {
        self.time
    }

    /// Training log of surface rays: as many, of as much weight, as [`AnyBvh::build`] learns from. Made on first
    /// use, in the current rayon pool, and kept.
    pub fn surface_log(&self, primitives: &Primitives) -> &TreeLog {
        if let Some((log, _)) = self.surface_log.get() {
            return log;
        }
        let start = Instant::now();
        let log = TreeLog::of_surfaces(primitives, &self.tree, None);
        // Not made inside `get_or_init`: the thread may meanwhile take up a task of the pool that asks for the
        // log, and wait for itself. If two threads make logs, both are equal.
        &self.surface_log.get_or_init(|| (log, start.elapsed())).0
    }

    /// Time of the surface log. Zero before anybody asks for the log.
    pub fn surface_log_time(&self) -> Duration {
        self.surface_log.get().map_or(Duration::ZERO, |made| made.1)
    }

    /// Adds training rays to a log of this tree, weighted by [`TreeLog::weight_for`].
    pub fn follow(&self, primitives: &Primitives, log: &mut TreeLog, rays: &[Ray]) {
        log.add(primitives, &self.tree, rays, log.weight_for(rays));
    }

    /// A wide tree without a training log.
    pub fn unlogged(
        &self,
        primitives: &Primitives,
        collapse: Collapse,
        width: Width,
        isa: Isa,
    ) -> AnyBvh {
        AnyBvh::collapse_unlogged(primitives, &self.tree, collapse, width, isa)
    }

    /// A wide tree learned from a training log of this tree.
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
