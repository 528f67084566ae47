//! Objects and their instances.

use antumbra_scene::{Instance, Object};
use glam::{Affine3, DVec4};

use super::{Builder, ELLIPSOID, SINGULAR, SINGULAR_HELP};
use crate::directive::Quoted;
use crate::report::Report;
use crate::source::Span;
use crate::state::BlockKind;
use crate::state::{MIRRORS, MIRRORS_HELP};
use crate::{suggest, transform};

impl Builder<'_> {
    pub(super) fn object_begin(&mut self, at: Span, name: Quoted, report: &mut Report) {
        if let Some(outer) = self.state.now.object {
            let message = format!("ObjectBegin within that of line {}", outer.line);
            report.error(at, message);
        }
        self.begin_block(BlockKind::Object, at, report);
        // The name now refers to the new object. Earlier instances keep their object.
        self.object_indices
            .insert(name.text.clone(), self.objects.len());
        self.objects.push(Object {
            name: name.text,
            shapes: Vec::new(),
        });
    }

    pub(super) fn object_instance(&mut self, at: Span, name: &Quoted, report: &mut Report) {
        if let Some(outer) = self.state.now.object {
            let message = format!(
                "ObjectInstance within the ObjectBegin of line {}",
                outer.line
            );
            report.error_once(at, message, Some("objects consist of shapes only"));
            return;
        }
        let Some(&object) = self.object_indices.get(&name.text) else {
            if report.is_counted_only() {
                return;
            }
            let mut known: Vec<&str> = self.object_indices.keys().map(String::as_str).collect();
            known.sort_unstable();
            report.error_once(
                name.span,
                format!("no object is named {:?}", name.text),
                Some(&suggest::help(&name.text, &known)),
            );
            return;
        };
        let has_spheres = self.objects[object].has_spheres();
        let Some(instance) = self.instance(at, object, has_spheres, report) else {
            return;
        };
        if self.budget.take(size_of::<Instance>() as u64, at, report) {
            self.instances.push(instance);
        }
    }

    /// An instance under the current transformations; `None` after a mistake.
    pub(super) fn instance(
        &self,
        at: Span,
        object: usize,
        has_spheres: bool,
        report: &mut Report,
    ) -> Option<Instance> {
        let transforms = self.state.now.transforms;
        let mut places = [Affine3::IDENTITY; 2];
        for (place, matrix) in places.iter_mut().zip([transforms.start, transforms.end]) {
            // Rounded before the checks, because the scene stores single precision.
            let to_world = self.to_origin(matrix).as_mat4().as_dmat4();
            if !transform::is_invertible(&to_world) {
                report.error_once(at, SINGULAR, Some(SINGULAR_HELP));
                return None;
            }
            if to_world.row(3) != DVec4::W {
                report.unsupported(at, "an instance under a perspective transformation is");
                return None;
            }
            if transform::uniform_scale(&to_world).is_none() && has_spheres {
                report.unsupported(at, ELLIPSOID);
                return None;
            }
            *place = Affine3::from_mat4(to_world.as_mat4());
        }
        let [world_from_object, end] = places;
        if transforms.mirror_differently() {
            report.error_help(at, MIRRORS, MIRRORS_HELP);
            return None;
        }
        Some(Instance {
            object,
            world_from_object,
            end: transforms.is_animated().then_some(end),
        })
    }
}
