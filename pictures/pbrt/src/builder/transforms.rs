//! The current transformations, and the camera, which takes them.

use std::sync::Arc;

use glam::DMat4;

use super::Builder;
use crate::directive::Quoted;
use crate::lookup::read;
use crate::params::Params;
use crate::report::Report;
use crate::source::Span;
use crate::state::Transforms;
use crate::{camera, suggest, transform};

impl Builder<'_> {
    /// A transformation to the world of the file as one to the scene, which is measured from its origin.
    pub(super) fn to_origin(&self, mut to_world: DMat4) -> DMat4 {
        to_world.w_axis -= self.options.origin.extend(0.0) * to_world.w_axis.w;
        to_world
    }

    pub(super) fn transforms(&mut self) -> &mut Transforms {
        &mut self.state.now.transforms
    }

    pub(super) fn concat(&mut self, matrix: DMat4) {
        self.transforms().change(|current| current * matrix);
    }

    pub(super) fn rotate(&mut self, at: Span, by: [f64; 4], report: &mut Report) {
        match transform::rotate(by) {
            Some(matrix) => self.concat(matrix),
            None => report.error(at, "the axis of the rotation has no length"),
        }
    }

    pub(super) fn look_at(&mut self, at: Span, numbers: [f64; 9], report: &mut Report) {
        match transform::look_at(numbers) {
            Some(matrix) => self.concat(matrix),
            None => report.error_help(
                at,
                "the LookAt has no direction",
                "eye and target must differ, and up must not point along the view",
            ),
        }
    }

    pub(super) fn coordinate_system(&mut self, name: Quoted) {
        let Transforms { start, end, .. } = self.state.now.transforms;
        self.coordinate_systems.insert(name.text, [start, end]);
    }

    pub(super) fn transform_times(&mut self, at: Span, times: [f64; 2], report: &mut Report) {
        let [start, end] = times;
        // Also when one is NaN.
        if !(start < end && (end - start).is_finite()) {
            let message = format!("the transform times {start} and {end} do not ascend");
            report.error_help(at, message, "the start must be before the end");
            return;
        }
        self.times = times;
    }

    pub(super) fn coord_sys_transform(&mut self, name: &Quoted, report: &mut Report) {
        match self.coordinate_systems.get(&name.text) {
            Some(system) => {
                let system = *system;
                self.transforms().set(system);
            }
            None => {
                if report.is_counted_only() {
                    return;
                }
                let message = format!("no coordinate system is named {:?}", name.text);
                let help = suggest::among(&name.text, self.coordinate_systems.keys());
                report.error_help(name.span, message, help);
            }
        }
    }

    pub(super) fn camera(&mut self, at: Span, kind: &Quoted, params: &Params, report: &mut Report) {
        let transforms = self.state.now.transforms;
        let origin = self.options.origin;
        let (camera, places) = read("camera", at, (kind, params), report, |lookup| {
            camera::read(lookup, &transforms, origin)
        });
        self.camera = camera;
        if self.is_version4 {
            self.camera.medium = self.medium(1, report);
        }
        self.coordinate_systems.insert("camera".into(), places);
    }

    /// Gives lenses the size of their film, which other cameras have no use for.
    pub(super) fn fit_lenses(&mut self, end: Span, report: &mut Report) {
        match (&mut self.camera.lenses, self.film_diagonal) {
            (Some(lenses), diagonal) => {
                if let Some((diagonal, _)) = diagonal {
                    Arc::make_mut(lenses).film_diagonal = diagonal;
                }
                if self.film.max_sample_luminance.is_finite() {
                    let message = "\"maxsampleluminance\" limits light as the lens weights it, where pbrt-v3 \
                                   limits it before";
                    report.note(end, message);
                }
            }
            (None, Some((_, at))) => {
                let message = "\"diagonal\" of the film is left out: only a realistic lens needs the film's size";
                report.note(at, message);
            }
            (None, None) => {}
        }
    }
}
