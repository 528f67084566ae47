//! Primitives and instances that were left out, and why.

use core::fmt;

/// Something that was given and is not among the primitives.
///
/// ```
/// use antumbra::shapes::{DropReason, Dropped};
/// use antumbra::{Geometry, Primitives};
///
/// let flat = [Geometry::triangles(vec![[0.0; 3]; 3], vec![[0, 1, 2]])];
/// let primitives = Primitives::new(&flat)?;
/// let [Dropped::Primitive { prim_id, reason, .. }] = primitives.dropped_list() else {
///     panic!("one triangle is dropped");
/// };
/// assert_eq!((*prim_id, *reason), (0, DropReason::CornersCoincide));
/// # Ok::<(), antumbra::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Dropped {
    /// A primitive of any kind.
    Primitive {
        /// Index of the object whose primitive it is; `None` in the world itself. An object counts once, however often it is
        /// placed.
        object: Option<u32>,
        /// Index of the geometry in the list of the world or the object.
        geom_id: u32,
        /// Index of the primitive in its geometry.
        prim_id: u32,
        /// Reason for which the primitive was dropped.
        reason: DropReason,
    },
    /// An instance.
    Instance {
        /// Index of the instance.
        inst_id: u32,
        /// Reason for which the instance was dropped.
        reason: DropReason,
    },
}

/// Reason for which something was dropped.
///
/// ```
/// use antumbra::shapes::DropReason;
///
/// assert_eq!(DropReason::NoNormal.to_string(), "the normal is zero");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DropReason {
    /// A coordinate is NaN or infinite, or the box of a primitive is.
    NotFinite,
    /// Two corners of a triangle are one point, or two of both triangles of a quad are, or both ends of a segment of a curve.
    CornersCoincide,
    /// The radius of a sphere or disk is not positive. A radius of a segment of a curve is negative, or both are 0.
    NoRadius,
    /// The normal of a disk is zero.
    NoNormal,
    /// The box of a primitive of user geometry is empty.
    EmptyBounds,
    /// A transform has a NaN or infinite number, has no inverse, or brings the object or its inverse out of the range of
    /// `f32`.
    Transform,
    /// The object that an instance places has no primitives.
    EmptyObject,
}

impl fmt::Display for DropReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a coordinate is not finite",
            Self::CornersCoincide => "two corners are the same point",
            Self::NoRadius => "the radius is not positive",
            Self::NoNormal => "the normal is zero",
            Self::EmptyBounds => "the box is empty",
            Self::Transform => "the transform cannot be used",
            Self::EmptyObject => "the object has no primitives",
        })
    }
}

impl fmt::Display for Dropped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Primitive {
                object,
                geom_id,
                prim_id,
                reason,
            } => {
                write!(f, "primitive {prim_id} of geometry {geom_id}")?;
                if let Some(object) = object {
                    write!(f, " of object {object}")?;
                }
                write!(f, ": {reason}")
            }
            Self::Instance { inst_id, reason } => write!(f, "instance {inst_id}: {reason}"),
        }
    }
}
