//! Building trees: first a binary tree, then its collapse to N children per node.
//!
//! - `binary`: the binary tree, whoever builds it
//! - `binned_sah`: object splits by the surface area heuristic over bins
//! - `bins`, `sweep`: the candidates among which it chooses, and `cost`, by what;  `planes`: boxes as builders handle them
//! - `parallel`: dividing work between threads
//! - `collapse`: binary to N-wide

pub(crate) mod binary;
mod binned_sah;
mod bins;
pub(crate) mod collapse;
mod cost;
pub(crate) mod parallel;
mod planes;
mod sweep;

use core::fmt;
use core::str::FromStr;

use antumbra_simd::Isa;

use crate::any_bvh::AnyBvh;
use crate::error::Error;
use crate::geometry::Geometry;
use crate::primitives::Primitives;
use crate::width::Width;

pub use binary::BinaryTree;

/// How the binary tree is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Builder {
    /// Object splits between bins, by the surface area heuristic (Wald 2007): the fast one.
    #[default]
    BinnedSah,
}

impl Builder {
    /// Every builder there is.
    pub const ALL: [Self; 1] = [Self::BinnedSah];

    /// The name used on the command line and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::BinnedSah => "binned-sah",
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
#[error("unknown builder `{0}`; known is binned-sah")]
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
    /// Children per node.
    pub width: Width,
    /// The instruction set that queries run on.
    pub isa: Isa,
}

impl Default for BuildOptions {
    /// The best instruction set of this CPU, and the width of its registers.
    fn default() -> Self {
        let isa = Isa::best();
        Self {
            builder: Builder::default(),
            width: Width::auto(isa.level()),
            isa,
        }
    }
}

/// What was built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildReport {
    /// Primitives in the tree.
    pub primitives: usize,
    /// Primitives left out: see [`Primitives`].
    pub dropped: usize,
    /// N-wide nodes.
    pub nodes: usize,
    /// Leaf blocks.
    pub leaves: usize,
    /// Levels of nodes; the root is one.
    pub depth: usize,
    /// Bytes of nodes and leaf blocks.
    pub bytes: usize,
}

impl AnyBvh {
    /// Builds a tree over geometries, the place of each in the list being its `geom_id`.
    ///
    /// Uses the rayon pool that is current, if the `parallel` feature is on; the tree does not depend on
    /// the number of threads.
    ///
    /// # Errors
    /// A vertex index out of range; more primitives than can be numbered.
    pub fn build(geometries: &[Geometry<'_>], options: &BuildOptions) -> Result<Self, Error> {
        let primitives = Primitives::new(geometries)?;
        let tree = BinaryTree::build(&primitives, options.builder);
        Ok(Self::collapse(
            &primitives,
            &tree,
            options.width,
            options.isa,
        ))
    }
}
