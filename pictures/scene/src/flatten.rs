//! Flattening: a scene without instances, with one copy of every shape per instance in world space.

use std::borrow::Cow;
use std::fmt;

use crate::{Geometry, Scene, Shape};

/// Largest number of triangles of a flattened scene.
///
/// A shape counts as its triangles, as a third of its vertices, as twice the control points of its curves, or as one,
/// whichever is most. Lowering and building take about 140 bytes per triangle, so the limit corresponds to about 19 GB.
pub const MAX_FLAT_TRIANGLES: u64 = 1 << 27;

/// Segments that stand for a control point of a curve.
const SEGMENTS: u64 = 2;

/// Reason why a scene cannot be flattened.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// An instance refers to a missing object.
    Object {
        /// Position of the instance in the scene.
        instance: usize,
        /// Index of the object, which is too large.
        object: usize,
        /// Number of objects in the scene.
        objects: usize,
    },
    /// An instance scales a sphere differently by axis.
    Ellipsoid {
        /// Position of the instance in the scene.
        instance: usize,
        /// Name of the object that has the sphere.
        object: String,
    },
    /// An instance moves.
    Moves {
        /// Position of the instance in the scene.
        instance: usize,
    },
    /// The flattened scene would have more than [`MAX_FLAT_TRIANGLES`] triangles.
    TooLarge {
        /// Number of triangles of the flattened scene.
        triangles: u64,
        /// Number of instances in the scene.
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
                "instance {instance} refers to object {object}, but the scene has only {objects} objects"
            ),
            Self::Ellipsoid { instance, object } => write!(
                f,
                "instance {instance}, of {object:?}, scales a sphere differently by axis; spheres need a uniform \
                 scale"
            ),
            Self::Moves { instance } => write!(
                f,
                "instance {instance} moves while the shutter is open; a flattened scene cannot move"
            ),
            Self::TooLarge {
                triangles,
                instances,
            } => write!(
                f,
                "its {instances} instances have {triangles} triangles when flattened; at most \
                 {MAX_FLAT_TRIANGLES} are allowed"
            ),
        }
    }
}

impl std::error::Error for Error {}

impl Scene {
    /// Scene with its instances flattened to shapes in world space.
    ///
    /// Shapes are first the [`Scene::shapes`], then the shapes of every instance, in order. A scene without instances
    /// is borrowed unchanged.
    ///
    /// # Errors
    /// [`Error`] if an object is missing, if a sphere would become an ellipsoid, or if the result would be too large.
    /// Nothing is allocated for a scene that would be too large.
    pub fn flattened(&self) -> Result<Cow<'_, Self>, Error> {
        if self.instances.is_empty() {
            return Ok(Cow::Borrowed(self));
        }
        if let Some(instance) = self.instances.iter().position(|one| one.end.is_some()) {
            return Err(Error::Moves { instance });
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
        // Built field by field, so that the shapes are not copied twice.
        Ok(Cow::Owned(Self {
            origin: self.origin,
            name: self.name.clone(),
            shapes,
            objects: Vec::new(),
            instances: Vec::new(),
            materials: self.materials.clone(),
            media: self.media.clone(),
            lights: self.lights.clone(),
            camera: self.camera.clone(),
            film: self.film.clone(),
            sampler: self.sampler,
            integrator: self.integrator,
            accelerator: self.accelerator.clone(),
        }))
    }

    /// Checks that every object exists and that the flattened scene is small enough.
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

/// Number of triangles of the shapes as [`MAX_FLAT_TRIANGLES`] counts them.
fn size(shapes: &[Shape]) -> u64 {
    shapes
        .iter()
        .map(|shape| match &shape.geometry {
            Geometry::Mesh(mesh) => {
                let vertices = mesh.positions.len();
                mesh.indices.len().max(vertices / 3).max(1) as u64
            }
            Geometry::Sphere(_) => 1,
            Geometry::Curves(curves) => (curves.points.len() as u64 * SEGMENTS).max(1),
        })
        .sum()
}

#[cfg(test)]
mod tests;
