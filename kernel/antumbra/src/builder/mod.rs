//! Builders: from primitives to a binary tree.
//!
//! - `binned_sah`: object splits by the surface area heuristic over bins
//! - `reinsertion`: subtrees of a tree moved to better places
//! - `cost`: what a subtree will cost, estimated before it is built
//! - `two_levels`: instances put into the tree of the world;  `top_level`: the same for objects that are trees already;
//!   `subtrees`: the tree of the world taken apart for them

pub(crate) mod binned_sah;
pub(crate) mod cost;
pub(crate) mod reinsertion;
mod subtrees;
#[cfg(test)]
mod tests;
pub(crate) mod top_level;
mod two_levels;

use crate::geometry::primitives::Primitives;
use crate::monitor::BuildMonitor;
use crate::parallel;
use crate::ray::Ray;
use crate::tree::binary::BinaryTree;
use alloc::vec::Vec;
use antumbra_simd::{Row, named_list};

named_list! {
    /// How the binary tree is built.
    ///
    /// ```
    /// use antumbra::recipe::Builder;
    ///
    /// assert_eq!("binned-sah".parse(), Ok(Builder::BinnedSah));
    /// assert_eq!(Builder::default().name(), "reinsertion");
    /// ```
    #[derive(Default)]
    pub enum Builder("builder"): Properties, open Grow {
        BinnedSah = "binned-sah",
            "Object splits between bins by the surface area heuristic: the fastest to build",
            Some("Wald 2007"), Properties::PLAIN;
        #[default]
        Reinsertion = "reinsertion",
            "Binned SAH, then subtrees moved to better places",
            Some("Bittner, Hapala and Havran 2013"), Properties { reinserts: true, ..Properties::PLAIN };
    }
}

/// Columns of the table of builders.
pub(crate) struct Properties {
    needs_rays: bool,
    /// Whether subtrees are moved to better places in the end.
    reinserts: bool,
}

impl Properties {
    /// Needs no rays and moves nothing.
    const PLAIN: Self = Self {
        needs_rays: false,
        reinserts: false,
    };

    fn of(builder: &dyn Grow) -> Self {
        Self {
            needs_rays: builder.needs_rays(),
            reinserts: builder.reinserts(),
        }
    }
}

impl Builder {
    /// Whether the tree is built for training rays.
    pub fn needs_rays(self) -> bool {
        self.properties().needs_rays
    }
}

/// A builder of your own, for [`Builder::Other`].
///
/// It makes binary trees over the primitives of the world and of each object. What comes after it is the kernel's:
/// instances are put into the tree of the world, and the trees become wide.
///
/// A primitive may be in several leaves. If the boxes of these leaves are parts of its own box, as after a spatial split, files
/// keep the number of primitives. If they are whole, as of two equal subtrees, answers are right after
/// [`Bvh::from_bytes`](crate::Bvh::from_bytes), but the report counts the primitive in each leaf, and
/// [`Bvh::validate`](crate::Bvh::validate) says so.
pub trait Grow: Row {
    /// Whether it builds for training rays.
    fn needs_rays(&self) -> bool {
        false
    }

    /// Whether subtrees are moved to better places in the end, as [`Builder::Reinsertion`] does.
    fn reinserts(&self) -> bool {
        false
    }

    /// Builds the tree of the world's own primitives, and behind it the tree of each of [its
    /// objects](Primitives::object_list). The tree of nothing is [`BinaryTree::default`]. Primitives of one leaf are of
    /// one kind, and at most [`BLOCK`](crate::parts::BLOCK). Trees are not deep: halve nodes from some depth on.
    ///
    /// `rays` serve builders that need rays, all with the same weight. There may be none.
    fn grow(&self, primitives: &Primitives, rays: &[Ray]) -> Vec<BinaryTree>;
}

/// Builds a tree over all primitives; empty for none. `rays` serve the builders that [need
/// rays](Builder::needs_rays), all with the same weight; the others ignore them. Without rays, and where hardly any
/// come, the result is the tree of [`Builder::BinnedSah`]. An object is built for the rays that enter its instances.
///
/// The tree does not depend on the number of threads. If `monitor` stops the build, the tree is of no use.
pub(crate) fn build(
    primitives: &Primitives,
    builder: Builder,
    rays: &[Ray],
    monitor: &dyn BuildMonitor,
) -> BinaryTree {
    let improved = |tree: BinaryTree| match builder.properties().reinserts {
        true => reinsertion::improved(&tree, monitor),
        false => tree,
    };
    let grown = match builder {
        Builder::Other(builder) => builder.grow(primitives, rays),
        Builder::BinnedSah | Builder::Reinsertion => Vec::new(),
    };
    let build_one = |primitives: &Primitives, place: usize| {
        improved(match grown.get(place) {
            Some(tree) => tree.clone(),
            None => binned_sah::build(primitives, monitor),
        })
    };
    if primitives.instances.is_empty() {
        return BinaryTree {
            identity: primitives.identity.clone(),
            ..build_one(primitives, 0)
        };
    }
    let (mut tree, objects) = parallel::join(
        || {
            improved(two_levels::with_instances(
                &build_one(primitives, 0),
                primitives,
            ))
        },
        || {
            parallel::map(primitives.objects.len(), 1, |object| {
                build_one(&primitives.objects[object], 1 + object)
            })
        },
    );
    tree.objects = objects;
    tree.identity = primitives.identity.clone();
    tree
}
