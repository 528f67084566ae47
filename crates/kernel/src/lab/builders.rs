//! Builders of the laboratory: what builds the rows of [`Builder`] that only the feature `lab` has.

use super::ray_driven::evidence::{AllEvidence, Evidence};
use super::ray_driven::rdh::Rdh;
use super::ray_driven::srdh::Srdh;
use super::{pbrt, ploc, ray_driven, sbvh};
use crate::builder::{Builder, binned_sah};
use crate::geometry::primitives::Primitives;
use crate::ray::Ray;
use crate::tree::binary::BinaryTree;

/// Hits of the training rays, for the builders that need rays.
pub(crate) struct TrainingHits(AllEvidence);

impl TrainingHits {
    /// Follows the rays if the builder needs them.
    pub fn new(builder: Builder, primitives: &Primitives, rays: &[Ray]) -> Self {
        Self(match builder.needs_rays() {
            true => AllEvidence::new(primitives, rays),
            false => AllEvidence::none(primitives),
        })
    }

    /// Builds the tree of the world or of an object, with the hits of its own rays.
    pub fn build(
        &self,
        builder: Builder,
        primitives: &Primitives,
        object: Option<usize>,
    ) -> BinaryTree {
        let hits: &Evidence = match object {
            None => &self.0.world,
            Some(object) => &self.0.objects[object],
        };
        match builder {
            Builder::Ploc | Builder::PlocReinsertion => ploc::build(primitives),
            Builder::Sbvh => sbvh::build(primitives),
            Builder::Rdh => ray_driven::build(primitives, hits, &Rdh::new()),
            Builder::Srdh => ray_driven::build(primitives, hits, &Srdh::new()),
            Builder::Pbrt => pbrt::build(primitives, pbrt::Rule::LATER),
            Builder::Pbrt2015 => pbrt::build(primitives, pbrt::Rule::EARLIER),
            Builder::BinnedSah | Builder::Reinsertion => binned_sah::build(primitives),
        }
    }
}
