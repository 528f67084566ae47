//! Errors of building and learning. Tracing itself cannot fail.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use antumbra_simd::Level;

use crate::geometry::GeometryId;
use crate::shape::Shape;
use crate::tree::width::Width;

/// Why a tree could not be built or an order not be planned.
///
/// ```
/// use antumbra::{Bvh, Error, Geometry, Recipe};
///
/// let mesh = [Geometry::triangles(vec![[0.0; 3]; 3], vec![[0, 1, 7]])];
/// let error = Bvh::build(&mesh, &Recipe::default()).err().expect("there is no vertex 7");
/// assert!(matches!(error, Error::IndexOutOfRange { index: 7, vertices: 3, .. }));
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A triangle has the index of a vertex that does not exist.
    IndexOutOfRange {
        /// Index of the geometry.
        geom_id: u32,
        /// Index of the triangle in its geometry.
        prim_id: u32,
        /// The index found.
        index: u32,
        /// Indices must be below this.
        vertices: usize,
    },
    /// A quad has the index of a vertex that does not exist.
    QuadIndexOutOfRange {
        /// Index of the geometry.
        geom_id: u32,
        /// Index of the quad in its geometry.
        prim_id: u32,
        /// The index found.
        index: u32,
        /// Indices must be below this.
        vertices: usize,
    },
    /// An instance has the index of an object that does not exist.
    ObjectOutOfRange {
        /// Index of the instance.
        inst_id: u32,
        /// The index found.
        object: u32,
        /// Indices must be below this.
        objects: usize,
    },
    /// An object holds an instance of itself, or of an object that holds it.
    NestsItself {
        /// Index of the object.
        object: u32,
    },
    /// More geometries or primitives than 32-bit ids, or leaf references, can name.
    TooMany {
        /// Plural of the things counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        limit: usize,
    },
    /// There is no memory for a build. Found before it begins, by what such things take at most while a tree is built.
    OutOfMemory {
        /// Plural of the things that need it.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// Bytes that are needed.
        bytes: usize,
    },
    /// A column of rays has too few numbers.
    TooShort {
        /// Plural of what the column holds.
        what: &'static str,
        /// Numbers that the rays need.
        needed: usize,
        /// Numbers that the column has.
        found: usize,
    },
    /// A file was read with too few or too many [functions](crate::saved::Functions).
    OtherFunctions {
        /// Plural of the functions: filters or shapes of user geometry.
        what: &'static str,
        /// Geometries that need one each, in the order in which they are given.
        expected: Vec<GeometryId>,
        /// How many were given.
        found: usize,
    },
    /// A file is no such file, is damaged or was forged.
    Unreadable {
        /// Kind of file that was expected.
        what: &'static str,
        /// What is wrong.
        why: String,
    },
    /// Reading or writing failed. Only with the feature `std`.
    #[cfg(feature = "std")]
    Io {
        /// Kind of the failure.
        kind: std::io::ErrorKind,
        /// The failure in the words of the system.
        message: String,
    },
    /// A mesh or an instance that moves has another number of keys than the others, or none.
    OtherKeys {
        /// Singular of what has the keys.
        what: &'static str,
        /// Index of the mesh or instance.
        id: u32,
        /// Keys of the others.
        expected: usize,
        /// Keys that were found.
        found: usize,
    },
    /// A key of a mesh that moves has another number of vertices than the first one.
    OtherVertices {
        /// Index of the geometry.
        geom_id: u32,
        /// The key, counted from 0.
        key: u32,
        /// Vertices of the first key.
        expected: usize,
        /// Vertices that were found.
        found: usize,
    },
    /// A vertex of a mesh that moves is not finite, or beyond 2¹²⁵.
    KeyPosition {
        /// Index of the geometry.
        geom_id: u32,
        /// The key, counted from 0.
        key: u32,
        /// Index of the vertex in its key.
        vertex: usize,
        /// Position of the vertex.
        position: [f32; 3],
    },
    /// A transform of an instance that moves has a number that is not finite, or no inverse.
    KeyTransform {
        /// Index of the instance.
        inst_id: u32,
        /// The key, counted from 0.
        key: u32,
    },
    /// One of two transforms of an instance mirrors and the other does not, so that there is no motion between them.
    KeysMirror {
        /// Index of the instance.
        inst_id: u32,
        /// The first of the two keys, counted from 0.
        key: u32,
    },
    /// The path of an instance leaves the range of `f32`.
    OutOfRange {
        /// Index of the instance.
        inst_id: u32,
    },
    /// Something moves that cannot, in words.
    Moves(&'static str),
    /// A scene that moves got another number of trees than it has spans between two keys.
    OtherTrees {
        /// Spans of the scene.
        expected: usize,
        /// Trees that were found.
        found: usize,
    },
    /// A build was stopped by its [monitor](crate::BuildMonitor).
    Cancelled,
    /// A refit got another number of sound primitives than the tree was built over.
    OtherPrimitives {
        /// Number of sound primitives that the tree was built over.
        expected: usize,
        /// Number of sound primitives found.
        found: usize,
    },
    /// A primitive of the tree does not exist any more, or is not sound any more, when the tree is refitted.
    PrimitiveIsGone {
        /// Index of the geometry.
        geom_id: u32,
        /// Index of the primitive in its geometry.
        prim_id: u32,
    },
    /// A tree with instances was to be refitted: a [`World`](crate::World) refits its objects.
    HasInstances,
    /// A tree has another width than the world that it should join, or than the queries that should run in it.
    OtherWidth {
        /// Children per node of the world, or of the trees of the queries.
        expected: usize,
        /// Children per node of the tree.
        found: usize,
    },
    /// There are no queries for trees of this width on this level.
    NoEngine {
        /// The level of the recipe.
        level: Level,
        /// The width of the recipe.
        width: Width,
    },
    /// A learned order was requested without the log it learns from.
    NeedsLog(&'static str),
    /// A log holds too little for the order: it was made without box hits.
    NeedsBoxes(&'static str),
    /// A log holds too little for the order: it does not say what each ray hit.
    NeedsMasks(&'static str),
    /// A log or order was made for a tree of another shape.
    OtherTree {
        /// The shape of the tree.
        expected: Shape,
        /// The shape the log or order was made for.
        found: Shape,
    },
}

/// Matches an error and writes the text of its kind.
macro_rules! say {
    ($error:expr, $f:expr, { $($(#[$only:meta])* $kind:pat => $text:literal $(, $argument:expr)*;)* }) => {
        match $error {
            $($(#[$only])* $kind => write!($f, $text $(, $argument)*),)*
        }
    };
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        say!(self, f, {
            Self::IndexOutOfRange { geom_id, prim_id, index, vertices } =>
                "triangle {prim_id} of geometry {geom_id} uses vertex {index}, but there are {vertices} vertices";
            Self::QuadIndexOutOfRange { geom_id, prim_id, index, vertices } =>
                "quad {prim_id} of geometry {geom_id} uses vertex {index}, but there are {vertices} vertices";
            Self::ObjectOutOfRange { inst_id, object, objects } =>
                "instance {inst_id} places object {object}, but there are {objects} objects";
            Self::NestsItself { object } =>
                "object {object} holds an instance of itself, directly or by others";
            Self::TooMany { what, found, limit } =>
                "{found} {what} are more than the {limit} that can be numbered";
            Self::OutOfMemory { what, found, bytes } =>
                "not enough memory for {found} {what}: {bytes} bytes";
            Self::TooShort { what, needed, found } =>
                "{what} of the rays need {needed} numbers, but there are {found}";
            Self::OtherFunctions { what, expected, found } =>
                "the file needs {} {what}, and {found} were given{}", expected.len(), Listed(expected);
            Self::Unreadable { what, why } => "cannot read the {what}: {why}";
            #[cfg(feature = "std")]
            Self::Io { message, .. } => "{message}";
            Self::OtherKeys { what, id, expected, found } =>
                "{what} {id} has {found} keys, but needs 1 or {expected}, as everything that moves";
            Self::OtherVertices { geom_id, key, expected, found } =>
                "key {key} of mesh {geom_id} has {found} vertices, but key 0 has {expected}";
            Self::KeyPosition { geom_id, key, vertex, position: [x, y, z] } =>
                "vertex {vertex} in key {key} of mesh {geom_id} is at ({x}, {y}, {z}): coordinates must be finite and \
                 below 2^125";
            Self::KeyTransform { inst_id, key } =>
                "key {key} of instance {inst_id} must be a finite transform that has an inverse";
            Self::KeysMirror { inst_id, key } =>
                "of the keys {key} and {} of instance {inst_id} one mirrors and the other does not", key + 1;
            Self::OutOfRange { inst_id } =>
                "the path of instance {inst_id} leaves the range of single precision";
            Self::Moves(why) => "{why}";
            Self::OtherTrees { expected, found } =>
                "a scene that moves needs one tree per span between two keys, {expected} in all, but got {found}";
            Self::Cancelled => "the build was cancelled";
            Self::OtherPrimitives { expected, found } =>
                "a refit needs the {expected} sound primitives of the build, but {found} were found: build again";
            Self::PrimitiveIsGone { geom_id, prim_id } =>
                "primitive {prim_id} of geometry {geom_id} is gone or unsound, so the tree cannot be refitted: build again";
            Self::HasInstances =>
                "a tree with instances cannot be refitted: place objects in a world and refit those";
            Self::OtherWidth { expected, found } =>
                "a tree of {found} children per node does not fit one of {expected}";
            Self::NoEngine { level, width } =>
                "level `{level}` traces trees of {} children per node, not {width}; level `scalar` traces all",
                Width::auto(*level);
            Self::NeedsLog(order) => "order `{order}` is learned and needs a log of shadow rays";
            Self::NeedsBoxes(order) =>
                "order `{order}` needs a log with box hits, and this one has leaf hits only";
            Self::NeedsMasks(order) =>
                "order `{order}` needs a log with the masks of every ray, and this one has sums only";
            Self::OtherTree { expected, found } =>
                "a log or order made for {found} does not fit a tree of {expected}";
        })
    }
}

/// Geometries as the end of a text: `: for A, B`.
struct Listed<'a>(&'a [GeometryId]);

impl fmt::Display for Listed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, geometry) in self.0.iter().enumerate() {
            let before = if index == 0 { ": for" } else { "," };
            write!(f, "{before} {geometry}")?;
        }
        Ok(())
    }
}

impl core::error::Error for Error {}

#[cfg(feature = "std")]
impl From<std::io::Error> for Error {
    fn from(error: std::io::Error) -> Self {
        Self::Io {
            kind: error.kind(),
            message: alloc::format!("{error}"),
        }
    }
}

impl Error {
    /// Fails if there is no memory for things that take so many bytes each. What is reserved here is given back at once: it is a
    /// question that can be answered with no, where a list that grows would end the process.
    pub(crate) fn if_no_memory(what: &'static str, found: usize, each: usize) -> Result<(), Self> {
        let bytes = found.saturating_mul(each);
        let mut room = Vec::<u8>::new();
        let answer = room.try_reserve_exact(bytes);
        // Or the compiler would leave the question out.
        core::hint::black_box(&mut room);
        answer.map_err(|_| Self::OutOfMemory { what, found, bytes })
    }

    /// Fails if something moves where nothing may.
    pub(crate) fn if_moves(moves: bool, why: &'static str) -> Result<(), Self> {
        match moves {
            true => Err(Self::Moves(why)),
            false => Ok(()),
        }
    }

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
