//! Media by name, and those on the two sides of shapes.

use std::sync::Arc;

use antumbra_scene::{Integrator, Light, Medium, MediumInterface, Shape};

use super::Builder;
use crate::directive::Quoted;
use crate::lookup::read;
use crate::params::Params;
use crate::report::Report;
use crate::source::Span;
use crate::{medium, suggest};

impl Builder<'_> {
    pub(super) fn named_medium(
        &mut self,
        at: Span,
        name: Quoted,
        params: &Params,
        report: &mut Report,
    ) {
        let to_world = self.to_origin(self.state.now.transforms.start);
        let medium = read("medium", at, (&name, params), report, |lookup| {
            medium::read(lookup, &to_world)
        });
        let Some(medium) = medium else {
            // Uses of the name are no further mistakes.
            self.media_indices.entry(name.text).or_insert(0);
            return;
        };
        if medium.density.is_some() && self.state.now.transforms.is_animated() {
            let message = "media do not move: the transformation at the start is taken";
            report.note(at, message);
        }
        let cells = medium.density.as_ref().map_or(0, |grid| grid.values.len());
        let bytes = size_of::<Medium>() as u64 + size_of::<f32>() as u64 * cells as u64;
        if self.budget.take(bytes, at, report) {
            self.media_indices
                .insert(name.text, self.media.len() as u32);
            self.media.push(medium);
        }
    }

    pub(super) fn medium_interface(&mut self, inside: Quoted, outside: Option<Quoted>) {
        let outside = outside.unwrap_or_else(|| inside.clone());
        self.state.now.media =
            [inside, outside].map(|name| (!name.text.is_empty()).then(|| Arc::new(name)));
    }

    /// Media on the two sides of a shape, if they differ.
    pub(super) fn media(&self, report: &mut Report) -> Option<MediumInterface> {
        let [inside, outside] = [0, 1].map(|side| self.medium(side, report));
        (inside != outside).then_some(MediumInterface { inside, outside })
    }

    /// Medium in force inside (0) or outside (1). An unknown name is vacuum.
    pub(super) fn medium(&self, side: usize, report: &mut Report) -> Option<u32> {
        let name = self.state.now.media[side].as_ref()?;
        let found = self.media_indices.get(&name.text).copied();
        if found.is_none() {
            report.tolerated(
                name.span,
                format!("no medium is named {:?}", name.text),
                "vacuum is taken",
                || suggest::among(&name.text, self.media_indices.keys()),
            );
        }
        found
    }

    /// Says where the integrator does not know media, which are left out then, as in pbrt-v3, and where a medium without
    /// an end keeps light out.
    pub(super) fn check_media(&self, end: Span, report: &mut Report) {
        let is_used = |shape: &Shape| shape.media.is_some();
        let has_media = self.camera.medium.is_some() || self.all_shapes().any(is_used);
        if !has_media {
            return;
        }
        if !matches!(self.integrator, Integrator::VolumePath { .. }) {
            let message = "participating media are left out: only volpath, bdpt and mlt know them";
            report.note(end, message);
        } else if self.is_in_endless_medium() {
            let is_far =
                |light: &&Light| matches!(light, Light::Distant { .. } | Light::Infinite { .. });
            let count = self.lights.iter().filter(is_far).count();
            if count > 0 {
                let message = format!(
                    "the medium around the camera has no end, so light from infinity ({count} of the lights) is lost in it; \
                     pbrt-v3 ends it where the scene ends: put a closed shape with this medium inside around the scene"
                );
                report.note(end, message);
            }
        }
    }

    /// Whether all that is far away from the camera is one medium that absorbs or scatters.
    fn is_in_endless_medium(&self) -> bool {
        let Some(index) = self.camera.medium else {
            return false;
        };
        let Some(medium) = self.media.get(index as usize) else {
            return false;
        };
        let has_end = |shape: &Shape| {
            (shape.media).is_some_and(|media| media.inside.is_none() || media.outside.is_none())
        };
        let extinction = medium.absorption + medium.scattering;
        medium.density.is_none()
            && extinction.max_element() > 0.0
            && !self.all_shapes().any(has_end)
    }
}
