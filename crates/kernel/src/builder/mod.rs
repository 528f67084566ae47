//! Builders: from primitives to a binary tree.
//!
//! - `binned_sah`: object splits by the surface area heuristic over bins
//! - `reinsertion`: subtrees of a tree moved to better places
//! - `ploc`: clusters put together from below
//! - `sbvh`: object splits and spatial splits
//! - `ray_driven`: object splits judged by sample rays
//! - `pieces`: how subtrees become a tree
//! - `leaf_size`: leaves of fewer primitives than a block holds
//! - `cost`: what a subtree will cost, estimated before it is built
//! - `two_levels`: instances put into the tree of the world;  `top_level`: the same for objects that are trees already;
//!   `subtrees`: the tree of the world taken apart for them

mod binned_sah;
mod cost;
mod leaf_size;
mod pieces;
mod ploc;
mod ray_driven;
mod reinsertion;
mod sbvh;
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
use antumbra_simd::named_list;
use ray_driven::evidence::{AllEvidence, Evidence};
use ray_driven::rdh::Rdh;
use ray_driven::srdh::Srdh;

named_list! {
    /// How the binary tree is built.
    #[derive(Default)]
    pub enum Builder("builder"): Properties {
        BinnedSah = "binned-sah",
            "Object splits between bins by the surface area heuristic: the fastest to build",
            Some("Wald 2007"), Properties { needs_rays: false };
        BinnedSah4 = "binned-sah-4",
            "As `binned-sah`, with at most 4 primitives in a leaf as in pbrt-v3: for comparisons of counts",
            Some("Wald 2007"), Properties { needs_rays: false };
        #[default]
        Reinsertion = "reinsertion",
            "Binned SAH, then subtrees moved to better places",
            Some("Bittner, Hapala and Havran 2013"), Properties { needs_rays: false };
        Ploc = "ploc",
            "Neighbours on a space-filling curve merged, the nearest first",
            Some("Meister and Bittner 2018"), Properties { needs_rays: false };
        PlocReinsertion = "ploc-reinsertion",
            "PLOC, then subtrees moved to better places",
            Some("Meister and Bittner 2018"), Properties { needs_rays: false };
        Sbvh = "sbvh",
            "Spatial splits beside object splits: a primitive may be in several leaves",
            Some("Stich, Friedrich and Dietrich 2009"), Properties { needs_rays: false };
        Rdh = "rdh",
            "Object splits by how many training rays enter the boxes, blended with area",
            Some("Bittner and Havran 2009"), Properties { needs_rays: true };
        Srdh = "srdh",
            "Object splits by what training rays cost that stop at their first occluder",
            Some("Feltman, Lee and Fatahalian 2012"), Properties { needs_rays: true };
    }
}

/// Columns of the table of builders.
pub(crate) struct Properties {
    needs_rays: bool,
}

impl Builder {
    /// Whether the tree is built for training rays.
    pub const fn needs_rays(self) -> bool {
        self.properties().needs_rays
    }
}

/// Builds a tree over all primitives; empty for none. `rays` serve the builders that [need
/// rays](Builder::needs_rays), all with the same weight; the others ignore them. Of more than 2¹⁴ rays an even
/// selection is used. Without rays, and where hardly any come, the tree is that of [`Builder::BinnedSah`]. An object
/// is built for the rays that enter its instances.
///
/// The tree does not depend on the number of threads. Of a build that `monitor` stops it is sound, but not what was asked
/// for.
pub(crate) fn build(
    primitives: &Primitives,
    builder: Builder,
    rays: &[Ray],
    monitor: &dyn BuildMonitor,
) -> BinaryTree {
    let improved = |tree: &BinaryTree| reinsertion::improved(tree, monitor);
    let evidence = if builder.needs_rays() {
        AllEvidence::new(primitives, rays)
    } else {
        AllEvidence::none(primitives)
    };
    let build_one = |primitives: &Primitives, evidence: &Evidence| match builder {
        Builder::BinnedSah => binned_sah::build(primitives),
        Builder::BinnedSah4 => {
            leaf_size::with_leaves_of(primitives, &binned_sah::build(primitives), 4)
        }
        Builder::Reinsertion => improved(&binned_sah::build(primitives)),
        Builder::Ploc => ploc::build(primitives),
        Builder::PlocReinsertion => improved(&ploc::build(primitives)),
        Builder::Sbvh => sbvh::build(primitives),
        Builder::Rdh => ray_driven::build(primitives, evidence, &Rdh::new()),
        Builder::Srdh => ray_driven::build(primitives, evidence, &Srdh::new()),
    };
    let AllEvidence { world, objects } = &evidence;
    if primitives.instances.is_empty() {
        return BinaryTree {
            identity: primitives.identity.clone(),
            ..build_one(primitives, world)
        };
    }
    let (mut tree, objects) = parallel::join(
        || {
            let tree = two_levels::with_instances(&build_one(primitives, world), primitives);
            match builder {
                Builder::Reinsertion | Builder::PlocReinsertion => improved(&tree),
                _ => tree,
            }
        },
        || {
            parallel::map(primitives.objects.len(), 1, |object| {
                build_one(&primitives.objects[object], &objects[object])
            })
        },
    );
    tree.objects = objects;
    tree.identity = primitives.identity.clone();
    tree
}
