//! The builders there are, by name.

use core::fmt;
use core::str::FromStr;

/// How the binary tree is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Builder {
    /// Object splits between bins, by the surface area heuristic (Wald 2007): the fast one.
    #[default]
    BinnedSah,
    /// The same, improved by moving subtrees to better places (Bittner, Hapala and Havran 2013).
    Reinsertion,
    /// Neighbours on a space-filling curve put together, the nearest first (Meister and Bittner 2018).
    Ploc,
    /// The same, improved by moving subtrees to better places.
    PlocReinsertion,
    /// Spatial splits beside object splits: a primitive may be in several leaves (Stich, Friedrich and
    /// Dietrich 2009).
    Sbvh,
    /// Object splits by how many rays enter the boxes, blended with their areas (Bittner and Havran 2009).
    Rdh,
    /// Object splits by what shadow rays cost that stop at their first occluder (Feltman, Lee and Fatahalian
    /// 2012).
    Srdh,
    /// Object splits by how many of the primitives are seen, blended with areas (Vinkler, Havran and Sochor
    /// 2012).
    Vdbvh,
}

impl Builder {
    /// Every builder there is.
    pub const ALL: [Self; 8] = [
        Self::BinnedSah,
        Self::Reinsertion,
        Self::Ploc,
        Self::PlocReinsertion,
        Self::Sbvh,
        Self::Rdh,
        Self::Srdh,
        Self::Vdbvh,
    ];

    /// The name used on the command line and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::BinnedSah => "binned-sah",
            Self::Reinsertion => "reinsertion",
            Self::Ploc => "ploc",
            Self::PlocReinsertion => "ploc-reinsertion",
            Self::Sbvh => "sbvh",
            Self::Rdh => "rdh",
            Self::Srdh => "srdh",
            Self::Vdbvh => "vdbvh",
        }
    }

    /// Whether the tree is built for sample rays: see [`BinaryTree::build_for`](crate::BinaryTree::build_for).
    pub const fn needs_rays(self) -> bool {
        matches!(self, Self::Rdh | Self::Srdh | Self::Vdbvh)
    }
}

impl fmt::Display for Builder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that no [`Builder`] has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown builder `{0}`; known are {known}", known = Builder::ALL.map(Builder::name).join(", "))]
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
