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

use self::ray_driven::evidence::AllEvidence;
use self::ray_driven::rdh::RdhCost;
use self::ray_driven::seen::Seen;
use self::ray_driven::srdh::SrdhCost;
use self::ray_driven::vdbvh;
use crate::{find, rows};

rows! {
    Pbrt = "pbrt", "Object splits over 12 buckets, leaves of at most 4 and only where cheaper, as in pbrt-v3", Some("Pharr, Jakob and Humphreys 2016");
    Pbrt2015 = "pbrt-2015", "As `pbrt`, with one primitive in a leaf, as in pbrt-v3 until November 2015", Some("Pharr, Jakob and Humphreys 2016");
    Ploc = "ploc", "Neighbours on a space-filling curve merged, the nearest first", Some("Meister and Bittner 2018");
    PlocReinsertion = "ploc-reinsertion", "PLOC, then subtrees moved to better places", Some("Meister and Bittner 2018");
    Sbvh = "sbvh", "Spatial splits beside object splits: a primitive may be in several leaves", Some("Stich, Friedrich and Dietrich 2009");
    Rdh = "rdh", "Object splits by how many training rays enter the boxes, blended with area", Some("Bittner and Havran 2009");
    Srdh = "srdh", "Object splits by what training rays cost that stop at their first occluder", Some("Feltman, Lee and Fatahalian 2012");
    Vdbvh = "vdbvh", "Object splits by how many primitives rays see, blended with area", Some("Vinkler, Havran and Sochor 2012");
}

/// The builder of pbrt-v3.
pub const PBRT: Builder = Builder::Other(&Pbrt);
/// The builder of pbrt-v3 until November 2015.
pub const PBRT_2015: Builder = Builder::Other(&Pbrt2015);
/// Parallel locally-ordered clustering (Meister and Bittner 2018).
pub const PLOC: Builder = Builder::Other(&Ploc);
/// [`PLOC`], then subtrees moved to better places.
pub const PLOC_REINSERTION: Builder = Builder::Other(&PlocReinsertion);
/// Spatial splits (Stich, Friedrich and Dietrich 2009).
pub const SBVH: Builder = Builder::Other(&Sbvh);
/// The ray distribution heuristic (Bittner and Havran 2009).
pub const RDH: Builder = Builder::Other(&Rdh);
/// The shadow ray distribution heuristic (Feltman, Lee and Fatahalian 2012).
pub const SRDH: Builder = Builder::Other(&Srdh);
/// Visibility driven builds (Vinkler, Havran and Sochor 2012).
pub const VDBVH: Builder = Builder::Other(&Vdbvh);

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

impl Grow for Pbrt {
    fn grow(&self, primitives: &Primitives, _: &[Ray]) -> Vec<BinaryTree> {
        each(primitives, |one, _| pbrt::build(one, pbrt::Rule::LATER))
    }
}

impl Grow for Pbrt2015 {
    fn grow(&self, primitives: &Primitives, _: &[Ray]) -> Vec<BinaryTree> {
        each(primitives, |one, _| pbrt::build(one, pbrt::Rule::EARLIER))
    }
}

impl Grow for Ploc {
    fn grow(&self, primitives: &Primitives, _: &[Ray]) -> Vec<BinaryTree> {
        each(primitives, |one, _| ploc::build(one))
    }
}

impl Grow for PlocReinsertion {
    fn reinserts(&self) -> bool {
        true
    }

    fn grow(&self, primitives: &Primitives, rays: &[Ray]) -> Vec<BinaryTree> {
        Ploc.grow(primitives, rays)
    }
}

impl Grow for Sbvh {
    fn grow(&self, primitives: &Primitives, _: &[Ray]) -> Vec<BinaryTree> {
        each(primitives, |one, _| sbvh::build(one))
    }
}

impl Grow for Rdh {
    fn needs_rays(&self) -> bool {
        true
    }

    fn grow(&self, primitives: &Primitives, rays: &[Ray]) -> Vec<BinaryTree> {
        let all = AllEvidence::new(primitives, rays);
        let cost = RdhCost::default();
        each(primitives, |one, place| {
            ray_driven::build(one, all.of(place), &cost)
        })
    }
}

impl Grow for Srdh {
    fn needs_rays(&self) -> bool {
        true
    }

    fn grow(&self, primitives: &Primitives, rays: &[Ray]) -> Vec<BinaryTree> {
        let all = AllEvidence::new(primitives, rays);
        let cost = SrdhCost::default();
        each(primitives, |one, place| {
            ray_driven::build(one, all.of(place), &cost)
        })
    }
}

impl Grow for Vdbvh {
    fn needs_rays(&self) -> bool {
        true
    }

    fn grow(&self, primitives: &Primitives, rays: &[Ray]) -> Vec<BinaryTree> {
        let seen = Seen::new(primitives, rays);
        each(primitives, |one, place| {
            vdbvh::build(one, seen.of(place), vdbvh::WEIGHT)
        })
    }
}
