//! The binary tree that every builder makes and every collapse starts from.

use super::evidence::{AllEvidence, Evidence};
use super::rdh::Rdh;
use super::srdh::Srdh;
use super::vdbvh::Vdbvh;
use super::{Builder, binned_sah, parallel, ploc, ray_driven, reinsertion, sbvh, two_levels};
use crate::aabb::Aabb;
use crate::order::surface_rays;
use crate::primitives::Primitives;
use crate::ray::Ray;

/// A binary tree over primitives, with at most [`crate::BLOCK`] of one kind per leaf.
///
/// Every primitive is in one leaf, or, if [`Builder::Sbvh`] has split it, in several: each of those has a box
/// around a part of it, and together they hold it all.
///
/// Nodes stand in depth-first order: a left child follows its parent at once. An instance is a leaf of its
/// own, and every object that is placed has a tree of its own.
#[derive(Clone, Debug, Default)]
pub struct BinaryTree {
    pub(crate) nodes: Vec<BinaryNode>,
    /// Indices of primitives, as `Primitives::bounds_of` counts them; leaves own ranges of it.
    pub(crate) prims: Vec<u32>,
    /// The trees of all objects; empty where no instance needs one.
    pub(crate) objects: Vec<BinaryTree>,
}

/// A node of a [`BinaryTree`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryNode {
    pub bounds: Aabb,
    pub kind: BinaryKind,
}

/// What is below a node.
#[derive(Clone, Copy, Debug)]
pub(crate) enum BinaryKind {
    /// The left child is the next node; the right one so many places further than this node.
    Inner { right: u32 },
    /// `count` entries of [`BinaryTree::prims`] from `first`.
    Leaf { first: u32, count: u32 },
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

    /// The same for rays like these, all of the same weight, if the builder [needs rays](Builder::needs_rays);
    /// others do not look at them. Of more than 2¹⁴ rays an even selection is used. Without rays, and where
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

    /// How many nodes it has, leaves included and those of objects.
    pub fn node_count(&self) -> usize {
        let objects = self.objects.iter();
        self.nodes.len() + objects.map(Self::node_count).sum::<usize>()
    }

    /// The indices of the children of an inner node; `None` for a leaf.
    pub(crate) fn children(&self, node: usize) -> Option<[usize; 2]> {
        match self.nodes[node].kind {
            BinaryKind::Inner { right } => Some([node + 1, node + right as usize]),
            BinaryKind::Leaf { .. } => None,
        }
    }
}
