//! A scene without instances: every shape in world space, as often as it is seen.

use std::borrow::Cow;
use std::fmt;

use crate::{Geometry, Scene, Shape};

/// Triangles that a flattened scene may have. A shape counts as its triangles, or a third of its vertices if
/// those are more, and at least as one. Lowering and building were measured to take some 140 bytes for each:
/// so many need about 19 GB.
pub const MAX_FLAT_TRIANGLES: u64 = 1 << 27;

/// Why a scene has no flat form.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// An instance of an object that does not exist.
    Object {
        /// Position of the instance in the scene.
        instance: usize,
        /// The index it names.
        object: usize,
        /// Number of objects.
        objects: usize,
    },
    /// An instance that scales a sphere differently by axis.
    Ellipsoid {
        /// Position of the instance in the scene.
        instance: usize,
        /// Name of its object.
        object: String,
    },
    /// More triangles than fit into memory.
    TooLarge {
        /// How many there would be.
        triangles: u64,
        /// Number of instances.
        instances: usize,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Object {
                instance,
                object,
                objects,
            } => write!(
                f,
                "instance {instance} is of object {object}, but there are only {objects}"
            ),
            Self::Ellipsoid { instance, object } => write!(
                f,
                "instance {instance}, of {object:?}, scales a sphere differently by axis"
            ),
            Self::TooLarge {
                triangles,
                instances,
            } => write!(
                f,
                "its {instances} instances make {triangles} triangles; written out, which they have to be, at \
                 most {MAX_FLAT_TRIANGLES} are possible"
            ),
        }
    }
}

impl std::error::Error for Error {}

impl Scene {
    /// The same scene with its instances written out as shapes in world space: first [`Scene::shapes`], then
    /// the shapes of every instance, in order. A scene without instances is returned as it is.
    ///
    /// # Errors
    /// [`Error`]; nothing is allocated for a scene that would be too large.
    pub fn flattened(&self) -> Result<Cow<'_, Self>, Error> {
        if self.instances.is_empty() {
            return Ok(Cow::Borrowed(self));
        }
        self.check_size()?;
        let mut shapes = self.shapes.clone();
        for (index, instance) in self.instances.iter().enumerate() {
            let object = &self.objects[instance.object];
            let matrix = instance.matrix();
            for shape in &object.shapes {
                let moved = shape.transformed(&matrix).ok_or_else(|| Error::Ellipsoid {
                    instance: index,
                    object: object.name.clone(),
                })?;
                shapes.push(moved);
            }
        }
        // Field by field, so that the shapes are not copied twice.
        Ok(Cow::Owned(Self {
            name: self.name.clone(),
            shapes,
            objects: Vec::new(),
            instances: Vec::new(),
            materials: self.materials.clone(),
            lights: self.lights.clone(),
            camera: self.camera.clone(),
            film: self.film.clone(),
            sampler: self.sampler,
            integrator: self.integrator,
            accelerator: self.accelerator.clone(),
        }))
    }

    /// Whether every object is there, and the whole small enough.
    fn check_size(&self) -> Result<(), Error> {
        let of_object: Vec<u64> = self
            .objects
            .iter()
            .map(|object| size(&object.shapes))
            .collect();
        let mut triangles = size(&self.shapes);
        for (index, instance) in self.instances.iter().enumerate() {
            let more = of_object.get(instance.object).ok_or(Error::Object {
                instance: index,
                object: instance.object,
                objects: of_object.len(),
            })?;
            triangles = triangles.saturating_add(*more);
        }
        if triangles > MAX_FLAT_TRIANGLES {
            return Err(Error::TooLarge {
                triangles,
                instances: self.instances.len(),
            });
        }
        Ok(())
    }
}

/// Triangles of the shapes as [`MAX_FLAT_TRIANGLES`] counts them.
fn size(shapes: &[Shape]) -> u64 {
    shapes
        .iter()
        .map(|shape| match &shape.geometry {
            Geometry::Mesh(mesh) => {
                let vertices = mesh.positions.len();
                mesh.indices.len().max(vertices / 3).max(1) as u64
            }
            Geometry::Sphere(_) => 1,
        })
        .sum()
}

#[cfg(test)]
mod tests;
