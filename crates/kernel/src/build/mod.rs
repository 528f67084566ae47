//! Building trees: first a binary tree, then its collapse to N children per node.
//!
//! - `binary`: the binary tree, whoever builds it
//! - `binned_sah`: object splits by the surface area heuristic over bins
//!   - `bins`, `sweep`: the candidates among which it chooses, and `cost`, by what
//!   - `planes`: boxes as builders handle them
//! - `reinsertion`: subtrees of such a tree moved to better places, in a `linked_tree`
//! - `two_levels`: instances put into the tree of the world
//! - `collapse`: binary to N-wide, in these steps
//!   - `area_collapse`, `learned_collapse`: which binary nodes become the children of a wide one
//!   - `skeleton`: the wide tree made of binary nodes, its children sorted
//!   - `layout`: nodes and leaf blocks in memory
//! - `parallel`: work divided among threads
//! - `times`: how long the steps take

mod area_collapse;
pub(crate) mod binary;
mod binned_sah;
mod bins;
pub(crate) mod collapse;
mod cost;
pub(crate) mod layout;
mod learned_collapse;
mod linked_tree;
pub(crate) mod parallel;
mod planes;
mod reinsertion;
mod skeleton;
mod sweep;
#[cfg(test)]
pub(crate) mod test_primitives;
mod times;
mod two_levels;

use core::fmt;
use core::str::FromStr;

use antumbra_simd::Isa;

use crate::any_bvh::AnyBvh;
use crate::error::Error;
use crate::geometry::Geometry;
use crate::order::TreeLog;
use crate::primitives::Primitives;
use crate::width::Width;
use times::Stopwatch;

pub use binary::BinaryTree;
pub use collapse::{Collapse, Learning, UnknownCollapse};
pub use times::{BuildTimes, Clock};

/// How the binary tree is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Builder {
    /// Object splits between bins, by the surface area heuristic (Wald 2007): the fast one.
    #[default]
    BinnedSah,
    /// The same, improved by moving subtrees to better places (Bittner, Hapala and Havran 2013).
    Reinsertion,
}

impl Builder {
    /// Every builder there is.
    pub const ALL: [Self; 2] = [Self::BinnedSah, Self::Reinsertion];

    /// The name used on the command line and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::BinnedSah => "binned-sah",
            Self::Reinsertion => "reinsertion",
        }
    }
}

impl fmt::Display for Builder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that no [`Builder`] has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown builder `{0}`; known are binned-sah, reinsertion")]
pub struct UnknownBuilder(pub String);

impl FromStr for Builder {
    type Err = UnknownBuilder;

    fn from_str(name: &str) -> Result<Self, UnknownBuilder> {
        Self::ALL
            .into_iter()
            .find(|builder| builder.name() == name)
            .ok_or_else(|| UnknownBuilder(name.to_owned()))
    }
}

/// What to build.
#[derive(Clone, Copy, Debug)]
pub struct BuildOptions {
    /// How the binary tree is built.
    pub builder: Builder,
    /// How it is collapsed. Unless by area, the order of children and primitives is learned, too.
    pub collapse: Collapse,
    /// How many [`surface_rays`](crate::surface_rays) a learned collapse learns from; `None` for a number that suits the size
    /// of the scene, 0 to learn from areas alone.
    pub sample_rays: Option<usize>,
    /// Children per node.
    pub width: Width,
    /// The instruction set that queries run on.
    pub isa: Isa,
    /// What to take the times of [`BuildReport::times`] by, if anybody wants them.
    pub clock: Option<Clock>,
}

impl Default for BuildOptions {
    /// A tree learned from sample rays, the best instruction set of this CPU, and the width of its
    /// registers.
    fn default() -> Self {
        let isa = Isa::best();
        Self {
            builder: Builder::default(),
            collapse: Collapse::default(),
            sample_rays: None,
            width: Width::auto(isa.level()),
            isa,
            clock: None,
        }
    }
}

/// What was built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildReport {
    /// Primitives in the tree; those of an object once, however often it is placed.
    pub primitives: usize,
    /// Those of them that are partly transparent triangles: see [`crate::Opacity`].
    pub cutouts: usize,
    /// Instances in the tree.
    pub instances: usize,
    /// Objects that they place.
    pub objects: usize,
    /// Primitives and instances left out: see [`Primitives`].
    pub dropped: usize,
    /// Triangles left out because they are clear: see [`crate::Coverage`].
    pub transparent: usize,
    /// N-wide nodes.
    pub nodes: usize,
    /// Leaf blocks.
    pub leaves: usize,
    /// Levels of nodes; the root is one. With instances, those of the world's tree and of the deepest object
    /// together.
    pub depth: usize,
    /// Bytes of nodes, leaf blocks and instances.
    pub bytes: usize,
    /// Cost of a random line that hits the box of the root, by the surface area heuristic: what nodes and
    /// primitives cost in the default [`crate::CostModel`], times their area relative to the root's. The cost of
    /// the root alone if that has no area.
    pub sah: f64,
    /// Mean cost of an occlusion query by the paper's equation (1), as the log that the tree was collapsed
    /// by has it, in units of that collapse's cost model. `None` if it was collapsed without a log, or
    /// another order has been applied since.
    pub predicted_cost: Option<f64>,
    /// How long the steps took. `None` unless built by [`AnyBvh::build`] or [`AnyBvh::build_over`] with a
    /// [clock](BuildOptions::clock).
    pub times: Option<BuildTimes>,
}

impl AnyBvh {
    /// Builds a tree over geometries, the place of each in the list being its `geom_id`.
    ///
    /// By default the collapse and the order are learned from [`surface_rays`](crate::surface_rays). To learn from the rays to
    /// come, see [`TreeLog`] and [`AnyBvh::collapse_logged`].
    ///
    /// Uses the rayon pool that is current, if the `parallel` feature is on; the tree does not depend on
    /// the number of threads.
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn build(geometries: &[Geometry<'_>], options: &BuildOptions) -> Result<Self, Error> {
        let mut stopwatch = Stopwatch::new(options.clock);
        let primitives = Primitives::new(geometries)?;
        let checked = stopwatch.lap();
        let mut bvh = Self::build_over(&primitives, options);
        if let Some(times) = &mut bvh.times {
            times.primitives = checked;
        }
        Ok(bvh)
    }

    /// [`AnyBvh::build`] for primitives that are checked already; with instances, if there are any: see
    /// [`Primitives::with_instances`].
    pub fn build_over(primitives: &Primitives, options: &BuildOptions) -> Self {
        let BuildOptions {
            builder,
            collapse,
            sample_rays,
            width,
            isa,
            clock,
        } = *options;
        let mut stopwatch = Stopwatch::new(clock);
        let mut times = BuildTimes::default();
        let tree = BinaryTree::build(primitives, builder);
        times.tree = stopwatch.lap();
        let log = match collapse {
            Collapse::Area => None,
            Collapse::Learned => Some(TreeLog::of_surfaces(primitives, &tree, sample_rays)),
        };
        times.log = stopwatch.lap();
        let mut bvh = match &log {
            None => Self::collapse(primitives, &tree, width, isa),
            Some(log) => {
                let learning = Learning {
                    collapse,
                    ..Default::default()
                };
                Self::collapse_logged(primitives, &tree, log, &learning, width, isa)
            }
        };
        times.collapse = stopwatch.lap();
        bvh.times = clock.map(|_| times);
        bvh
    }
}
