//! Shapes with their materials.
//!
//! Hairs come one by one. Those that differ in nothing but their points are one shape.

use std::sync::Arc;

use antumbra_scene::{AreaLight, Geometry, Instance, Material, Object, Param, Shape};
use glam::{DMat4, DVec3};

use super::{Builder, SINGULAR, SINGULAR_HELP};
use crate::directive::Quoted;
use crate::lookup::Lookup;
use crate::mesh_file::MeshFile;
use crate::params::Params;
use crate::report::Report;
use crate::shape::Source;
use crate::source::Span;
use crate::texture::Textured;
use crate::{material, parts, shape, suggest, transform};

/// Where a shape is.
struct Place {
    to_world: DMat4,
    /// Where the origin of the scene is for the shape.
    middle: DVec3,
    is_of_object: bool,
    /// Whether it moves: then it is an object of its own with one instance.
    moves: bool,
}

impl Builder<'_> {
    pub(super) fn shape(&mut self, at: Span, kind: &Quoted, params: &Params, report: &mut Report) {
        let Some(place) = self.place(at, report) else {
            return;
        };
        let Place {
            to_world, moves, ..
        } = place;
        // The shape's lookup may fall back on parameters of the material, which must live as long.
        let current = self.state.now.material.clone();
        let mut values = Textured {
            lookup: Lookup::new("shape", at, kind, params, report),
            state: &self.state,
        };
        let read = shape::read(&mut values, &to_world, place.middle);
        let material = material::of_shape(current.as_deref(), &mut values);
        values.lookup.finish();
        let Some((source, cutouts)) = read else {
            return;
        };
        let area_light = self.area_light(at, &place, report);
        let (geometry, mesh_file) = match source {
            Source::Here(geometry) => (geometry, None),
            // The mesh of the file replaces the empty one later.
            Source::File(file) => (Geometry::Mesh(Arc::default()), Some(file)),
        };
        let of_geometry = match &geometry {
            Geometry::Mesh(mesh) => mesh.bytes(),
            Geometry::Sphere(_) => 0,
            Geometry::Curves(curves) => curves.bytes(),
        };
        let media = self.media(report);
        let of_motion = match moves {
            true => size_of::<Object>() + size_of::<Instance>(),
            false => 0,
        };
        let bytes = (size_of::<Shape>() + of_motion) as u64 + of_geometry;
        if !self.budget.take(bytes, at, report) {
            return;
        }
        let material = match self.state.now.later_material.clone() {
            Some(name) => self.later_material(&name),
            None => self.material_index(material),
        };
        let shape = Shape {
            geometry,
            material,
            area_light: area_light.filter(|_| kind.text != "curve"),
            media,
            alpha: cutouts.alpha,
            shadow_alpha: cutouts.shadow_alpha,
            reverse_orientation: self.state.now.reverse_orientation,
            transform_swaps_handedness: transform::swaps_handedness(&to_world),
        };
        if shape.area_light.is_some() && matches!(shape.alpha, Some(Param::Constant(_))) {
            report.unsupported(at, "an invisible light (\"alpha\" 0) is");
        }
        self.add(at, shape, mesh_file, &place, report);
    }

    /// Emission of the current shape, which must be at rest and in the world.
    fn area_light(&self, at: Span, place: &Place, report: &mut Report) -> Option<AreaLight> {
        let light = self.state.now.area_light.clone()?;
        if !place.moves && !place.is_of_object {
            return Some(light);
        }
        let message = match place.moves {
            true => "area lights of shapes that move are left out, as in pbrt-v3",
            false => "area lights of objects are left out: in pbrt-v3 they light nothing",
        };
        report.note(at, message);
        None
    }

    /// Where the current shape is. `None`: a mistake was reported.
    fn place(&self, at: Span, report: &mut Report) -> Option<Place> {
        let transforms = self.state.now.transforms;
        let is_of_object = self.state.now.object.is_some();
        if transforms.is_animated() && is_of_object {
            report.unsupported(at, "moving shapes within objects are");
        }
        let moves = transforms.is_animated() && !is_of_object;
        let to_world = match is_of_object {
            true => transforms.start,
            false if moves => DMat4::IDENTITY,
            false => self.to_origin(transforms.start),
        };
        if !transform::is_invertible(&to_world) {
            report.error_once(at, SINGULAR, Some(SINGULAR_HELP));
            return None;
        }
        // Objects come to the origin by their instances.
        let is_near = is_of_object || moves || self.options.origin == DVec3::ZERO;
        let middle = match is_near {
            true => DVec3::ZERO,
            false => to_world.inverse().transform_point3(DVec3::ZERO),
        };
        Some(Place {
            to_world,
            middle,
            is_of_object,
            moves,
        })
    }

    /// Adds a shape to the scene or to the open object, whose mesh may still be in a file.
    fn add(
        &mut self,
        at: Span,
        shape: Shape,
        mesh_file: Option<MeshFile>,
        place: &Place,
        report: &mut Report,
    ) {
        if place.moves {
            let is_sphere = matches!(shape.geometry, Geometry::Sphere(_));
            let Some(instance) = self.instance(at, self.objects.len(), is_sphere, report) else {
                return;
            };
            self.objects.push(Object::default());
            self.instances.push(instance);
        }
        // Objects are never nested, so the last one is the open one.
        let object = (place.is_of_object || place.moves).then(|| self.objects.len() - 1);
        let shapes = match object {
            Some(object) => &mut self.objects[object].shapes,
            None => &mut self.shapes,
        };
        if shapes.last_mut().is_some_and(|last| joins(last, &shape)) {
            return;
        }
        if let Some(file) = mesh_file {
            self.pending_meshes.push(object, shapes.len(), file);
        }
        shapes.push(shape);
    }

    pub(super) fn named_material(&mut self, name: &Quoted, report: &mut Report) {
        self.state.now.later_material = None;
        match self.state.named_materials.get(&name.text) {
            Some(spec) => self.state.now.material = Some(Arc::clone(spec)),
            // Looked up when the file ends.
            None if self.is_version4 => {
                self.state.now.later_material = Some(Arc::new(name.clone()));
            }
            None => report.tolerated(
                name.span,
                format!("no material is named {:?} here", name.text),
                "the material before it stays",
                || suggest::help(&name.text, &self.state.named_materials.names()),
            ),
        }
    }

    /// Index of a material in the scene. New materials are added.
    pub(super) fn material_index(&mut self, material: Material) -> usize {
        let mut key = Vec::new();
        parts::push_key(&material, &mut key);
        *self.material_indices.entry(key).or_insert_with(|| {
            self.materials.push(material);
            self.materials.len() - 1
        })
    }
}

/// Control points of one shape at most. A curve of few points may need many segments.
const MOST_POINTS: usize = 1 << 20;

/// Adds curves to the curves of the last shape, if both have the same attributes. Returns whether that was done.
fn joins(last: &mut Shape, shape: &Shape) -> bool {
    let Geometry::Curves(more) = &shape.geometry else {
        return false;
    };
    let is_alike = last.material == shape.material
        && last.area_light == shape.area_light
        && last.media == shape.media
        && last.reverse_orientation == shape.reverse_orientation
        && last.transform_swaps_handedness == shape.transform_swaps_handedness;
    let Geometry::Curves(curves) = &mut last.geometry else {
        return false;
    };
    let fits = curves.points.len() + more.points.len() <= MOST_POINTS;
    if !(is_alike && curves.profile == more.profile && fits) {
        return false;
    }
    Arc::make_mut(curves).append(more);
    true
}
