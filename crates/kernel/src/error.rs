//! Errors of building and learning. Tracing itself cannot fail.

use crate::shape::Shape;

/// Why a tree could not be built or an order not be planned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A triangle names a vertex that is not there.
    #[error(
        "triangle {prim_id} of geometry {geom_id} uses vertex {index}, but there are {vertices} vertices"
    )]
    IndexOutOfRange {
        /// The geometry.
        geom_id: u32,
        /// The triangle.
        prim_id: u32,
        /// The index found.
        index: u32,
        /// Indices must be below this.
        vertices: usize,
    },
    /// An instance names an object that is not there.
    #[error("instance {inst_id} places object {object}, but there are {objects} objects")]
    ObjectOutOfRange {
        /// The instance.
        inst_id: u32,
        /// The index found.
        object: u32,
        /// Indices must be below this.
        objects: usize,
    },
    /// More geometries or primitives than 32-bit ids, or leaf references, can name.
    #[error("{found} {what} are more than the {limit} that can be numbered")]
    TooMany {
        /// Plural of the things counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A learned order was asked for without the log it learns from.
    #[error("order `{0}` is learned and needs a log of shadow rays")]
    NeedsLog(&'static str),
    /// A log holds too little for the order: it was made without box hits.
    #[error("order `{0}` needs a log with box hits, and this one has leaf hits only")]
    NeedsBoxes(&'static str),
    /// A log holds too little for the order: it does not say what each ray met.
    #[error("order `{0}` needs a log with the masks of every ray, and this one has sums only")]
    NeedsMasks(&'static str),
    /// A log or order was made for a tree of another shape.
    #[error("a log or order made for {found} does not fit a tree of {expected}")]
    OtherTree {
        /// The shape of the tree.
        expected: Shape,
        /// The shape the log or order was made for.
        found: Shape,
    },
}

impl Error {
    /// Fails unless what was made for a tree of shape `found` fits a tree of shape `tree`.
    pub(crate) fn unless_fits(found: Shape, tree: Shape) -> Result<(), Self> {
        if found == tree {
            Ok(())
        } else {
            Err(Self::OtherTree {
                expected: tree,
                found,
            })
        }
    }
}
