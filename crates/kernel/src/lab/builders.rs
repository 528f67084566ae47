//! Builders of the laboratory: what builds the rows of [`Builder`] that only the feature `lab` has.

use super::ray_driven::evidence::{AllEvidence, Evidence};
use super::ray_driven::rdh::Rdh;
use super::ray_driven::seen::Seen;
use super::ray_driven::srdh::Srdh;
use super::ray_driven::vdbvh;
use super::{pbrt, ploc, ray_driven, sbvh};
use crate::builder::{Builder, binned_sah};
use crate::geometry::primitives::Primitives;
use crate::ray::Ray;
use crate::tree::binary::BinaryTree;

/// What training rays hit, or see, for the builders that need rays.
pub(crate) struct TrainingHits {
    hits: AllEvidence,
    seen: Seen,
}

impl TrainingHits {
    /// Follows the rays if the builder needs them.
    pub fn new(builder: Builder, primitives: &Primitives, rays: &[Ray]) -> Self {
        let by_seen = builder == Builder::Vdbvh;
        Self {
            hits: match builder.needs_rays() && !by_seen {
                true => AllEvidence::new(primitives, rays),
                false => AllEvidence::none(primitives),
            },
            seen: match by_seen {
                true => Seen::new(primitives, rays),
                false => Seen::none(primitives),
            },
        }
    }

    /// Builds the tree of the world or of an object, with the hits of its own rays.
    pub fn build(
        &self,
        builder: Builder,
        primitives: &Primitives,
        object: Option<usize>,
    ) -> BinaryTree {
        let (hits, seen): (&Evidence, &[bool]) = match object {
            None => (&self.hits.world, &self.seen.world),
            Some(object) => (&self.hits.objects[object], &self.seen.objects[object]),
        };
        match builder {
            Builder::Ploc | Builder::PlocReinsertion => ploc::build(primitives),
            Builder::Sbvh => sbvh::build(primitives),
            Builder::Rdh => ray_driven::build(primitives, hits, &Rdh::new()),
            Builder::Srdh => ray_driven::build(primitives, hits, &Srdh::new()),
            Builder::Vdbvh => vdbvh::build(primitives, seen, vdbvh::WEIGHT),
            Builder::Pbrt => pbrt::build(primitives, pbrt::Rule::LATER),
            Builder::Pbrt2015 => pbrt::build(primitives, pbrt::Rule::EARLIER),
            Builder::BinnedSah | Builder::Reinsertion => binned_sah::build(primitives),
        }
    }
}
