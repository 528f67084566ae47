//! Builders: from primitives to a binary tree.
//!
//! - `binned_sah`: object splits by the surface area heuristic over bins
//! - `reinsertion`: subtrees of a tree moved to better places
//! - `ploc`: clusters put together from below
//! - `sbvh`: object splits and spatial splits
//! - `ray_driven`: object splits judged by sample rays
//! - `candidates`, `pieces`: how the last two find object splits, and how subtrees become a tree
//! - `cost`: what a subtree will cost, estimated before it is built
//! - `two_levels`: instances put into the tree of the world

mod binned_sah;
mod candidates;
mod cost;
mod pieces;
mod ploc;
mod ray_driven;
mod reinsertion;
mod sbvh;
#[cfg(test)]
mod tests;
mod two_levels;

use core::fmt;
use core::str::FromStr;

use crate::geometry::primitives::Primitives;
use crate::learn::surface_rays;
use crate::parallel;
use crate::ray::Ray;
use crate::tree::binary::BinaryTree;
use ray_driven::evidence::{AllEvidence, Evidence};
use ray_driven::rdh::Rdh;
use ray_driven::srdh::Srdh;
use ray_driven::vdbvh::Vdbvh;

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

impl BinaryTree {
    /// Builds a tree over all primitives; empty for none. Uses the rayon pool that is current, if the
    /// `parallel` feature is on; the tree does not depend on the number of threads.
    ///
    /// A builder that [needs rays](Builder::needs_rays) is given [`surface_rays`](crate::surface_rays): 512 of a small
    /// scene, 4096 of a large one.
    pub fn build(primitives: &Primitives, builder: Builder) -> Self {
        /// Any seed does, other than that of the log of a collapse.
        const SEED: u64 = 2009;
        if builder.needs_rays() {
            let count = (primitives.stored() / 16).clamp(512, 4096);
            let rays = surface_rays(primitives, count, SEED);
            Self::build_for(primitives, builder, &rays)
        } else {
            Self::build_for(primitives, builder, &[])
        }
    }

    /// Builds a tree for rays like these, all of the same weight, if the builder [needs rays](Builder::needs_rays).
    /// Other builders ignore them. Of more than 2¹⁴ rays an even selection is used. Without rays, and where
    /// hardly any come, the tree is that of [`Builder::BinnedSah`].
    ///
    /// An object is built for the rays that enter its instances.
    pub fn build_for(primitives: &Primitives, builder: Builder, rays: &[Ray]) -> Self {
        let evidence = if builder.needs_rays() {
            AllEvidence::new(primitives, rays)
        } else {
            AllEvidence::none(primitives)
        };
        let build = |primitives: &Primitives, evidence: &Evidence| match builder {
            Builder::BinnedSah => binned_sah::build(primitives),
            Builder::Reinsertion => reinsertion::improved(&binned_sah::build(primitives)),
            Builder::Ploc => ploc::build(primitives),
            Builder::PlocReinsertion => reinsertion::improved(&ploc::build(primitives)),
            Builder::Sbvh => sbvh::build(primitives),
            Builder::Rdh => ray_driven::build(primitives, evidence, &Rdh::new()),
            Builder::Srdh => ray_driven::build(primitives, evidence, &Srdh::new()),
            Builder::Vdbvh => ray_driven::build(primitives, evidence, &Vdbvh::new()),
        };
        let AllEvidence { world, objects } = &evidence;
        if primitives.instances.is_empty() {
            return build(primitives, world);
        }
        let (mut tree, objects) = parallel::join(
            || {
                let tree = two_levels::with_instances(&build(primitives, world), primitives);
                match builder {
                    Builder::Reinsertion | Builder::PlocReinsertion => reinsertion::improved(&tree),
                    _ => tree,
                }
            },
            || {
                parallel::map(primitives.objects.len(), 1, |object| {
                    build(&primitives.objects[object], &objects[object])
                })
            },
        );
        tree.objects = objects;
        tree
    }
}
