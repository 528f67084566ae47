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
use antumbra_simd::named_list;

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
    pub enum Builder("builder"): Properties {
        BinnedSah = "binned-sah",
            "Object splits between bins by the surface area heuristic: the fastest to build",
            Some("Wald 2007"), Properties::PLAIN;
        Pbrt if "lab" = "pbrt",
            "Object splits over 12 buckets, leaves of at most 4 and only where cheaper, as in pbrt-v3",
            Some("Pharr, Jakob and Humphreys 2016"), Properties::PLAIN;
        Pbrt2015 if "lab" = "pbrt-2015",
            "As `pbrt`, with one primitive in a leaf, as in pbrt-v3 until November 2015",
            Some("Pharr, Jakob and Humphreys 2016"), Properties::PLAIN;
        #[default]
        Reinsertion = "reinsertion",
            "Binned SAH, then subtrees moved to better places",
            Some("Bittner, Hapala and Havran 2013"), Properties { reinserts: true, ..Properties::PLAIN };
        Ploc if "lab" = "ploc",
            "Neighbours on a space-filling curve merged, the nearest first",
            Some("Meister and Bittner 2018"), Properties::PLAIN;
        PlocReinsertion if "lab" = "ploc-reinsertion",
            "PLOC, then subtrees moved to better places",
            Some("Meister and Bittner 2018"), Properties { reinserts: true, ..Properties::PLAIN };
        Sbvh if "lab" = "sbvh",
            "Spatial splits beside object splits: a primitive may be in several leaves",
            Some("Stich, Friedrich and Dietrich 2009"), Properties::PLAIN;
        Rdh if "lab" = "rdh",
            "Object splits by how many training rays enter the boxes, blended with area",
            Some("Bittner and Havran 2009"), Properties { needs_rays: true, ..Properties::PLAIN };
        Srdh if "lab" = "srdh",
            "Object splits by what training rays cost that stop at their first occluder",
            Some("Feltman, Lee and Fatahalian 2012"), Properties { needs_rays: true, ..Properties::PLAIN };
        Vdbvh if "lab" = "vdbvh",
            "Object splits by how many primitives rays see, blended with area",
            Some("Vinkler, Havran and Sochor 2012"), Properties { needs_rays: true, ..Properties::PLAIN };
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
}

impl Builder {
    /// Whether the tree is built for training rays.
    pub const fn needs_rays(self) -> bool {
        self.properties().needs_rays
    }
}

/// Builds a tree over all primitives; empty for none. `rays` serve the builders that [need
/// rays](Builder::needs_rays), all with the same weight; the others ignore them. Of more than 2¹⁴ rays an even
/// selection is used. Without rays, and where hardly any come, the result is the tree of [`Builder::BinnedSah`]. An
/// object is built for the rays that enter its instances.
///
/// The tree does not depend on the number of threads. If `monitor` stops the build, the tree is sound, but not the one
/// that was requested.
#[cfg_attr(
    not(feature = "lab"),
    expect(unused_variables, reason = "no builder needs rays")
)]
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
    #[cfg(feature = "lab")]
    let training = crate::lab::builders::TrainingHits::new(builder, primitives, rays);
    let build_one = |primitives: &Primitives, object: Option<usize>| match builder {
        Builder::BinnedSah | Builder::Reinsertion => improved(binned_sah::build(primitives)),
        #[cfg(feature = "lab")]
        builder => improved(training.build(builder, primitives, object)),
    };
    if primitives.instances.is_empty() {
        return BinaryTree {
            identity: primitives.identity.clone(),
            ..build_one(primitives, None)
        };
    }
    let (mut tree, objects) = parallel::join(
        || {
            improved(two_levels::with_instances(
                &build_one(primitives, None),
                primitives,
            ))
        },
        || {
            parallel::map(primitives.objects.len(), 1, |object| {
                build_one(&primitives.objects[object], Some(object))
            })
        },
    );
    tree.objects = objects;
    tree.identity = primitives.identity.clone();
    tree
}
