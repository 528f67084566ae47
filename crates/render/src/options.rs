//! Choices of a caller for one rendering.

use std::num::NonZeroUsize;

use antumbra::{Builder, Collapse, CostModel, Isa, Order, Width};

/// Choices for one rendering.
///
/// The scene, `spp` and `seed` alone decide the picture. All other choices decide how fast it is rendered and what is
/// measured, and change no bit of it.
#[derive(Clone, Debug)]
pub struct Options {
    /// Samples per pixel. `None` is the scene's own number.
    pub spp: Option<u32>,
    /// Seed of all random values.
    pub seed: u64,
    /// Child order of the tree for shadow rays.
    pub order: Order,
    /// Builder of the binary tree.
    ///
    /// A builder that needs rays is given surface rays and as many training rays, if the order learns. The pre-pass
    /// is then traced in a tree of [`Builder::BinnedSah`]. If the order does not learn, surface rays alone are given.
    pub builder: Builder,
    /// Collapse of the binary tree to a wide tree.
    ///
    /// A collapse that [needs a log](Collapse::needs_log) learns from surface rays. If the order learns, the collapse
    /// is made anew from surface rays and training rays.
    pub collapse: Collapse,
    /// Children per node.
    pub width: Width,
    /// Instruction set of the queries.
    pub isa: Isa,
    /// Whether batches prefetch nodes and leaves, see [`antumbra::AnyBvh::prefetches`]. `None` takes what is faster
    /// for the training rays, and prefetches without training rays.
    pub prefetch: Option<bool>,
    /// Cost model by which a collapse is learned, an order planned and its cost predicted.
    pub model: CostModel,
    /// Share of the samples in the pre-pass, in 0..=1. 0 learns nothing, 1 leaves no sample to profit.
    ///
    /// A small share is raised to a few thousand samples, or to a quarter of a small picture. A large share is
    /// lowered to 2²² samples. Each sample of the pre-pass takes 12 bytes until the picture is done. A learned
    /// collapse, and a builder that needs rays, learn from a sample of its shadow rays, see
    /// [`Lesson`](crate::Lesson).
    pub log_share: f64,
    /// Number of threads. `None` uses the current rayon pool.
    pub threads: Option<NonZeroUsize>,
    /// Whether to count the node and primitive tests of all shadow rays, which costs some speed.
    pub count: bool,
    /// Whether to map the mean number of tests per shadow ray of each pixel. Implies `count`.
    pub cost_map: bool,
    /// Whether to estimate the standard error of each pixel.
    pub standard_error: bool,
}

impl Default for Options {
    /// The best instruction set with its width, and the builder, collapse and order with the fewest node tests per
    /// shadow ray. Nothing is measured. docs/notes/renderer.md has the figures.
    fn default() -> Self {
        let isa = Isa::best();
        Self {
            spp: None,
            seed: 0,
            order: Order::Joint,
            builder: Builder::Reinsertion,
            collapse: Collapse::default(),
            width: Width::auto(isa.level()),
            isa,
            prefetch: None,
            model: CostModel::default(),
            log_share: 0.01,
            threads: None,
            count: false,
            cost_map: false,
            standard_error: false,
        }
    }
}

impl Options {
    /// Whether the tests of all shadow rays are counted.
    pub(crate) fn counts(&self) -> bool {
        self.count || self.cost_map
    }
}
