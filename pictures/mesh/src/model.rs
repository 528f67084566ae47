//! [`Model`]: all that a mesh file says of a scene.

use std::fmt;
use std::path::PathBuf;

use antumbra_scene::{Camera, Instance, Light, Material, Object, Shape};

use crate::Names;

/// Contents of a mesh file: geometry with its looks, and lights and a camera if the file has any.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Shapes in world space.
    pub shapes: Vec<Shape>,
    /// Meshes with several instances in the world.
    pub objects: Vec<Object>,
    /// Placements of the objects.
    pub instances: Vec<Instance>,
    /// Materials. [`Shape::material`] is an index into this list.
    pub materials: Vec<Material>,
    /// Names of objects and materials.
    pub names: Names,
    /// Lights without a surface.
    pub lights: Vec<Light>,
    /// The first camera of the file.
    pub camera: Option<View>,
    /// Features of the file that are left out or mapped to something else, each named once. Without the file's name.
    pub notes: Vec<String>,
    /// Missing files and materials. The model is complete without them, but looks different.
    pub warnings: Vec<Warning>,
    /// Files that were read beside the mesh file.
    pub files: Vec<PathBuf>,
}

impl Model {
    /// Number of triangles in the world. Triangles of an object count once per instance.
    pub fn triangles(&self) -> usize {
        let count = |shapes: &[Shape]| -> usize {
            let meshes = shapes.iter().map(|shape| match &shape.geometry {
                antumbra_scene::Geometry::Mesh(mesh) => mesh.indices.len(),
                antumbra_scene::Geometry::Sphere(_) | antumbra_scene::Geometry::Curves(_) => 0,
            });
            meshes.sum()
        };
        let instances = self.instances.iter();
        let of_instances = instances.map(|instance| {
            let object = self.objects.get(instance.object);
            object.map_or(0, |object| count(&object.shapes))
        });
        count(&self.shapes) + of_instances.sum::<usize>()
    }

    /// Adds a note that is not there yet.
    pub(crate) fn note(&mut self, note: impl Into<String>) {
        let note = note.into();
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }
}

/// Something that a file refers to and that does not exist.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// File, with line and column where the format has them.
    pub place: String,
    /// Sentence that names the missing thing and its replacement.
    pub text: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: warning: {}", self.place, self.text)
    }
}

/// Camera of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Position and angle of view.
    pub camera: Camera,
    /// Width over height of the picture, if the file says so.
    pub aspect_ratio: Option<f32>,
}
