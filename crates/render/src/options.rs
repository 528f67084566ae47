//! What a caller may choose about a rendering.

use std::num::NonZeroUsize;

use antumbra::{Builder, Collapse, CostModel, Isa, Order, Width};

/// Choices for one rendering.
///
/// Only `spp`, `seed` and what the scene says decide the picture; `order`, `builder`, `collapse`, `width`, `isa`,
/// `prefetch`, `threads`, `log_share`, `model` and what is measured never change a bit of it.
#[derive(Clone, Debug)]
pub struct Options {
    /// Samples per pixel; `None` is the scene's own number.
    pub spp: Option<u32>,
    /// Seed of all random values.
    pub seed: u64,
    /// The order in which shadow rays visit the children of a node.
    pub order: Order,
    /// How the binary tree is built. If that needs rays and the order learns, the pre-pass is traced in a tree of
    /// [`Builder::BinnedSah`]; then the tree is built for as many of the scene's own shadow rays as synthetic
    /// surface rays. If the order does not learn, it is built for surface rays alone.
    pub builder: Builder,
    /// How the binary tree is made wide. If that [needs a log](Collapse::needs_log), it is learned from synthetic
    /// surface rays, and anew from these and the scene's own shadow rays if the order learns, too.
    pub collapse: Collapse,
    /// Children per node.
    pub width: Width,
    /// Instruction set of the queries.
    pub isa: Isa,
    /// Whether batches ask for nodes and leaves before their turn, see [`antumbra::AnyBvh::prefetches`]; `None` tries it on
    /// the rays that are learned from and keeps to what is faster, and does it if nothing is learned.
    pub prefetch: Option<bool>,
    /// Costs by which a collapse is learned, an order planned and its cost predicted.
    pub model: CostModel,
    /// Share of the samples that a learned order is learned from, in 0..=1: 0 learns nothing, 1 leaves no
    /// sample to profit. A small share is raised to a few thousand samples, or to a quarter of those of a
    /// picture that has few; a large one is lowered to 2²² samples. Each learned sample takes 12 bytes until the
    /// picture is done. With a learned collapse, or a builder that needs rays, no more of their shadow rays are
    /// learned from than are worth it: see [`Lesson`](crate::Lesson).
    pub log_share: f64,
    /// Number of threads; `None` uses the current rayon pool.
    pub threads: Option<NonZeroUsize>,
    /// Count the node and primitive tests of all shadow rays. Costs some speed.
    pub count: bool,
    /// Make a map of the mean number of tests per shadow ray of each pixel. Implies `count`.
    pub cost_map: bool,
    /// Estimate the standard error of each pixel.
    pub standard_error: bool,
}

impl Default for Options {
    /// Everything at its best: the best instruction set with its width, and the combination of a builder, a collapse and
    /// an order of one permutation per node that takes the fewest node tests for shadow rays, 1.46 times fewer than the
    /// order of the builder on binned SAH collapsed by area (geometric mean of ten scenes, 8 wide, rays that were not
    /// learned from); nothing measured.
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
