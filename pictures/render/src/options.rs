//! Choices of a caller for one rendering.

use std::num::NonZeroUsize;

use antumbra::Recipe;

/// Choices for one rendering.
///
/// Only the scene, `spp`, `seed` and `texture_spp` decide the picture. All other choices decide how fast it is rendered and
/// what is measured, and change no bit of it.
#[derive(Clone, Debug)]
pub struct Options {
    /// Samples per pixel. `None` is the scene's own number.
    pub spp: Option<u32>,
    /// Seed of all random values.
    pub seed: u64,
    /// Samples per pixel that textures are made for: lookups average over the mean distance of so many samples. `None` is
    /// `spp`, as in pbrt-v3. With a number, more samples can be added to a textured picture later.
    pub texture_spp: Option<u32>,
    /// Recipe of the tree for shadow rays.
    ///
    /// An order that learns is learned from training rays: a sample of the picture's own shadow rays. A collapse that
    /// [needs a log](antumbra::recipe::Collapse::needs_log) then learns from these and from surface rays. A builder that
    /// [needs rays](antumbra::recipe::Builder::needs_rays) is driven by them, and the pre-pass is traced in a tree of
    /// [`Builder::BinnedSah`](antumbra::recipe::Builder::BinnedSah). If the order does not learn, only surface rays
    /// are learned from. Seed and clock are of the rendering, whatever the recipe says.
    pub recipe: Recipe,
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
    /// The default recipe; nothing is measured.
    fn default() -> Self {
        Self {
            spp: None,
            seed: 0,
            texture_spp: None,
            recipe: Recipe::default(),
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
