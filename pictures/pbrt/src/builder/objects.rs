//! Objects and their instances.

use antumbra_scene::{Instance, Object, Shape};
use glam::{Affine3, DVec4};

use super::{Builder, SINGULAR, SINGULAR_HELP};
use crate::directive::Quoted;
use crate::report::Report;
use crate::source::Span;
use crate::state::{BlockKind, MIRRORS, MIRRORS_HELP};
use crate::{suggest, transform};

/// Feature name for [`Report::unsupported`]: an instance that would turn a sphere into an ellipsoid.
const ELLIPSOID: &str =
    "an instance of a sphere under a scale that differs by axis (an ellipsoid) is";

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
            let help = suggest::among(&name.text, self.object_indices.keys());
            let message = format!("no object is named {:?}", name.text);
            report.error_once(name.span, message, Some(&help));
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

    /// Instance under the current transformations. `None`: a mistake was reported.
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
                return report.refuse(at, "an instance under a perspective transformation is");
            }
            if transform::uniform_scale(&to_world).is_none() && has_spheres {
                return report.refuse(at, ELLIPSOID);
            }
            *place = Affine3::from_mat4(to_world.as_mat4());
        }
        let [world_from_object, end] = places;
        if transforms.mirror_differently() {
            return report.fail_help(at, MIRRORS, MIRRORS_HELP);
        }
        Some(Instance {
            object,
            world_from_object,
            // Differences that single precision does not show are no motion.
            end: (end != world_from_object).then_some(end),
        })
    }

    /// Shapes of the world, then the shapes of every object.
    pub(super) fn all_shapes(&self) -> impl Iterator<Item = &Shape> {
        let of_objects = self.objects.iter().flat_map(|object| &object.shapes);
        self.shapes.iter().chain(of_objects)
    }

    /// Removes the shapes of objects without instances.
    pub(super) fn drop_unused_objects(&mut self) {
        let mut is_used = vec![false; self.objects.len()];
        for instance in &self.instances {
            is_used[instance.object] = true;
        }
        for (object, is_used) in self.objects.iter_mut().zip(is_used) {
            if !is_used {
                object.shapes = Vec::new();
            }
        }
    }
}
