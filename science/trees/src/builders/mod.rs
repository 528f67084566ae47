//! Builders from papers and from another renderer.
//!
//! - `pbrt`: the object splits of pbrt-v3;  `ploc`: a tree from below;  `sbvh`: spatial splits
//! - `ray_driven`: splits judged by what training rays do
//! - `pieces` and `candidates` serve them

mod candidates;
mod pbrt;
mod pieces;
mod ploc;
mod ray_driven;
mod sbvh;
#[cfg(test)]
mod tests;

use antumbra::parts::{BinaryTree, Grow};
use antumbra::recipe::{Builder, UnknownName};
use antumbra::{Primitives, Ray};
use rayon::prelude::*;

use self::ray_driven::rdh::RdhCost;
use self::ray_driven::seen::Seen;
use self::ray_driven::srdh::SrdhCost;
use self::ray_driven::vdbvh;
use self::ray_driven::{Levels, SplitCost};
use crate::{find, rows};

rows! {
    Builder;
    PBRT Pbrt = "pbrt", "Object splits over 12 buckets, leaves of at most 4 and only where cheaper, as in pbrt-v3", Some("Pharr, Jakob and Humphreys 2016");
    PBRT_2015 Pbrt2015 = "pbrt-2015", "As `pbrt`, with one primitive in a leaf, as in pbrt-v3 until November 2015", Some("Pharr, Jakob and Humphreys 2016");
    PLOC Ploc = "ploc", "Neighbours on a space-filling curve merged, the nearest first", Some("Meister and Bittner 2018");
    PLOC_REINSERTION PlocReinsertion = "ploc-reinsertion", "PLOC, then subtrees moved to better places", Some("Meister and Bittner 2018");
    SBVH Sbvh = "sbvh", "Spatial splits beside object splits: a primitive may be in several leaves", Some("Stich, Friedrich and Dietrich 2009");
    RDH Rdh = "rdh", "Object splits by how many training rays enter the boxes, blended with area", Some("Bittner and Havran 2009");
    SRDH Srdh = "srdh", "Object splits by what training rays cost that stop at their first occluder", Some("Feltman, Lee and Fatahalian 2012");
    VDBVH Vdbvh = "vdbvh", "Object splits by how many primitives rays see, blended with area", Some("Vinkler, Havran and Sochor 2012");
}

/// Builders of the kernel and of this crate.
pub const BUILDERS: [Builder; 10] = [
    Builder::BinnedSah,
    PBRT,
    PBRT_2015,
    Builder::Reinsertion,
    PLOC,
    PLOC_REINSERTION,
    SBVH,
    RDH,
    SRDH,
    VDBVH,
];

/// The builder of this name among [`BUILDERS`].
///
/// # Errors
/// Another name, with those that there are.
pub fn builder(name: &str) -> Result<Builder, UnknownName> {
    find("builder", &BUILDERS, Builder::name, name)
}

/// A tree of the world's own primitives, then one of each object, which are number 1 and up.
fn each(
    primitives: &Primitives,
    build: impl Fn(&Primitives, usize) -> BinaryTree + Sync,
) -> Vec<BinaryTree> {
    (0..1 + primitives.object_list().len())
        .into_par_iter()
        .map(|place| match place.checked_sub(1) {
            None => build(primitives, place),
            Some(object) => build(&primitives.object_list()[object], place),
        })
        .collect()
}

/// Says how the rows build, and what else is true of them.
macro_rules! grow {
    ($($Type:ident $($also:ident)?, |$primitives:ident, $rays:pat_param| $trees:expr;)*) => {$(
        impl Grow for $Type {
            $(fn $also(&self) -> bool {
                true
            })?

            fn grow(&self, $primitives: &Primitives, $rays: &[Ray]) -> Vec<BinaryTree> {
                $trees
            }
        }
    )*};
}

grow! {
    Pbrt, |all, _| each(all, |one, _| pbrt::build(one, pbrt::Rule::LATER));
    Pbrt2015, |all, _| each(all, |one, _| pbrt::build(one, pbrt::Rule::EARLIER));
    Ploc, |all, _| each(all, |one, _| ploc::build(one));
    PlocReinsertion reinserts, |all, rays| Ploc.grow(all, rays);
    Sbvh, |all, _| each(all, |one, _| sbvh::build(one));
    Rdh needs_rays, |all, rays| driven_by_rays(all, rays, &RdhCost::default());
    Srdh needs_rays, |all, rays| driven_by_rays(all, rays, &SrdhCost::default());
    Vdbvh needs_rays, |all, rays| {
        let seen = Seen::sent(all, rays);
        each(all, |one, place| vdbvh::build(one, seen.of(place), vdbvh::WEIGHT))
    };
}

fn driven_by_rays(primitives: &Primitives, rays: &[Ray], cost: &impl SplitCost) -> Vec<BinaryTree> {
    let all = Levels::followed(primitives, rays);
    each(primitives, |one, place| {
        ray_driven::build(one, all.of(place), cost)
    })
}
