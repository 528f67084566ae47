//! Functions of a scene, which no file can hold: filters of cut-outs and shapes of user geometry.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

use crate::error::Error;
use crate::geometry::{Opacity, UserGeometry};

/// Filters and shapes of a saved tree, object or world. No file can hold functions, so the reader of the file gives them
/// again.
///
/// | list | one for each |
/// |---|---|
/// | [filters](Functions::filters) | mesh that was [built with a filter](crate::Geometry::cutouts) |
/// | [shapes](Functions::shapes) | [user geometry](crate::Geometry::user) of which the tree has a primitive |
///
/// Both lists go by [`GeometryId`]: the geometries of the world itself by their `geom_id`, then the geometries of object
/// 0, of object 1 and so on. A list that is too short or too long is [`Error::OtherFunctions`], which names all
/// geometries of the list. Whether a function is the one of the build cannot be checked: another one gives other
/// answers. Functions are called with the `prim_id`s of the file. They must not trust these if somebody else may have
/// written the file.
///
/// Opacity micromaps and the boxes of user geometry come from the file. No filter is called while a file is read, and of a shape
/// only what queries call.
///
/// ```
/// use std::sync::Arc;
/// use antumbra::cutout::{Candidate, Opacity};
/// use antumbra::saved::Functions;
/// use antumbra::{Bvh, Geometry, Ray, Recipe};
///
/// #[derive(Debug)]
/// struct Hole;
/// impl Opacity for Hole {
///     fn opacity(&self, at: &Candidate) -> f32 {
///         if at.u + at.v < 0.5 { 0.0 } else { 1.0 }
///     }
/// }
///
/// let positions = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
/// let mesh = Geometry::cutouts(&positions[..], vec![[0, 1, 2]], Arc::new(Hole));
/// let bvh = Bvh::build(&[mesh], &Recipe::default())?;
/// let file = bvh.to_bytes();
/// assert!(Bvh::from_bytes(&file).is_err(), "a filter is missing");
///
/// let functions = Functions::new().filters(vec![Arc::new(Hole)]);
/// let loaded: Bvh = functions.from_bytes(&file)?;
/// let up = |x| Ray::new([x, 0.1, 0.0], [0.0, 0.0, 1.0]);
/// assert!(loaded.occluded(&up(0.5)) && !loaded.occluded(&up(0.2)));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Functions {
    filters: Vec<Arc<dyn Opacity>>,
    shapes: Vec<Arc<dyn UserGeometry>>,
}

impl Functions {
    /// A list without filters and shapes.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the filters of meshes, in the order that [`Functions`] describes.
    #[must_use]
    pub fn filters(self, filters: Vec<Arc<dyn Opacity>>) -> Self {
        Self { filters, ..self }
    }

    /// Sets the shapes of user geometry, in the order that [`Functions`] describes.
    #[must_use]
    pub fn shapes(self, shapes: Vec<Arc<dyn UserGeometry>>) -> Self {
        Self { shapes, ..self }
    }

    /// The filters of these meshes. Fails unless there is one for each.
    pub(crate) fn filters_of(&self, meshes: &[GeometryId]) -> Result<&[Arc<dyn Opacity>], Error> {
        one_each("filters", &self.filters, meshes)
    }

    /// The shapes of these geometries. Fails unless there is one for each.
    pub(crate) fn shapes_of(
        &self,
        geometries: &[GeometryId],
    ) -> Result<&[Arc<dyn UserGeometry>], Error> {
        one_each("shapes of user geometry", &self.shapes, geometries)
    }
}

/// Fails unless there is one function for each geometry.
fn one_each<'a, F>(
    what: &'static str,
    functions: &'a [F],
    geometries: &[GeometryId],
) -> Result<&'a [F], Error> {
    if functions.len() == geometries.len() {
        Ok(functions)
    } else {
        Err(Error::OtherFunctions {
            what,
            expected: geometries.to_vec(),
            found: functions.len(),
        })
    }
}

/// Name of a geometry. Sorted, the geometries of the world itself come first.
///
/// ```
/// use antumbra::saved::GeometryId;
///
/// let (ground, wheel) = (GeometryId { object: None, geom_id: 5 }, GeometryId { object: Some(0), geom_id: 0 });
/// assert!(ground < wheel);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GeometryId {
    /// Index of the object that has the geometry; `None` in the world itself.
    pub object: Option<u32>,
    /// Index of the geometry in the list of the object or the world.
    pub geom_id: u32,
}

impl fmt::Display for GeometryId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "geometry {}", self.geom_id)?;
        match self.object {
            Some(object) => write!(f, " of object {object}"),
            None => Ok(()),
        }
    }
}
