//! Names that pbrt-v4 looks up when a file ends, and images that its materials name.

use antumbra_scene::{Integrator, Material, Shape};

use super::Builder;
use crate::directive::Quoted;
use crate::params::Params;
use crate::report::Report;
use crate::source::Span;
use crate::{material, suggest, version4};

impl Builder<'_> {
    /// Looks up materials that are defined after their use, and sets what depends on the whole file.
    pub(super) fn finish_version4(&mut self, report: &mut Report) {
        for (name, (index, at)) in std::mem::take(&mut self.later_materials) {
            match self.state.named_materials.get(&name) {
                Some(spec) => self.materials[index] = spec.material.clone(),
                None => report.error_help(
                    at,
                    format!("no material is named {name:?}"),
                    suggest::help(&name, &self.state.named_materials.names()),
                ),
            }
        }
        self.film.scale *= self.exposure;
        // Limits are on values as the sensor has them, scales come after.
        self.film.max_sample_luminance /= self.film.scale;
        let passes = |shape: &Shape| {
            shape.media.is_some() || matches!(self.materials[shape.material], Material::None)
        };
        let is_clear = self.camera.medium.is_none() && !self.all_shapes().any(passes);
        if let Integrator::VolumePath {
            max_depth,
            rr_threshold,
            light_strategy,
        } = self.integrator
            && is_clear
        {
            // There are no media, so paths need not look for them.
            self.integrator = Integrator::Path {
                max_depth,
                rr_threshold,
                light_strategy,
            };
        }
    }

    /// Index of a material that is defined after its use.
    pub(super) fn later_material(&mut self, name: &Quoted) -> usize {
        let known = self.later_materials.entry(name.text.clone());
        let (index, _) = *known.or_insert_with(|| {
            self.materials.push(material::DEFAULT);
            (self.materials.len() - 1, name.span)
        });
        index
    }

    /// Makes a texture of the image that "normalmap" names in a material of pbrt-v4.
    pub(super) fn define_normal_map(&mut self, at: Span, params: &mut Params, report: &mut Report) {
        if !self.is_version4 {
            return;
        }
        let Some(declaration) = version4::normal_map(params, at, self.texture_space()) else {
            return;
        };
        self.pending_textures.push(declaration);
        self.define_textures(report);
    }
}
