//! Errors of lowering a scene, of rendering, and of reading files.

/// Reason why a scene cannot be lowered, a picture not rendered, or a file not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A shape names a material that does not exist.
    #[error(
        "shape {shape} uses material {material}, but the scene has {materials}, counted from 0"
    )]
    Material {
        /// Position of the shape among the stored shapes: first of the world, then of the objects.
        shape: usize,
        /// Index that the shape names.
        material: usize,
        /// Number of materials.
        materials: usize,
    },
    /// A mesh has another number of vertex attributes than of positions.
    #[error(
        "shape {shape} has {positions} positions but {found} {attribute}; give one for each, or none"
    )]
    VertexAttribute {
        /// Position of the shape among the stored shapes: first of the world, then of the objects.
        shape: usize,
        /// `normals` or `texture coordinates`.
        attribute: &'static str,
        /// Number of attributes. None would be fine.
        found: usize,
        /// Number of positions.
        positions: usize,
    },
    /// A curve emits light.
    #[error("shape {shape} is a curve that emits light; meshes and spheres may")]
    CurveLight {
        /// Position of the shape among the stored shapes: first of the world, then of the objects.
        shape: usize,
    },
    /// The scene moves, but its queries are answered without times: by an observer, or in an experiment.
    #[error(
        "the scene moves while the shutter is open, which this command does not support; `render` does"
    )]
    Moves,
    /// A texture's image is empty, has another number of pixels than its sides say, or is too large.
    #[error(
        "texture {name} of {width} x {height} texels has {found} pixels; sides may have 1 to 16777216 texels"
    )]
    Texture {
        /// Name of the image.
        name: String,
        /// Width of the image.
        width: u32,
        /// Height of the image.
        height: u32,
        /// Number of its pixels.
        found: usize,
    },
    /// A material or an alpha mask has too many parts.
    #[error("{what} {index} is made of more than {limit} materials and textures")]
    Parts {
        /// `material` or `mask of shape`.
        what: &'static str,
        /// Position in the scene. Shapes of objects count after the shapes of the world.
        index: usize,
        /// Largest number of parts.
        limit: usize,
    },
    /// A material with subsurface scattering cannot be rendered.
    #[error("material {index}, with subsurface scattering, cannot be rendered: {reason}")]
    Interior {
        /// Index of the material.
        index: usize,
        /// Description of the mistake.
        reason: &'static str,
    },
    /// The lenses of the camera make no picture.
    #[error("the lens system cannot be used: {reason}")]
    Lens {
        /// Description of the mistake.
        reason: String,
    },
    /// A participating medium cannot be used.
    #[error("medium {index} cannot be used: {reason}")]
    Medium {
        /// Index of the medium.
        index: usize,
        /// Description of the mistake.
        reason: &'static str,
    },
    /// A shape or the camera names a medium that does not exist.
    #[error("medium {index} is named, but the scene has {media}, counted from 0")]
    NoMedium {
        /// Index that is named.
        index: u32,
        /// Number of media.
        media: usize,
    },
    /// A table of scattering contradicts itself.
    #[error("the table {name:?} of a material cannot be used: {reason}")]
    Table {
        /// Name of the table.
        name: String,
        /// Description of the mistake.
        reason: String,
    },
    /// The kernel refused the geometry.
    #[error("the geometry cannot be traced: {0}")]
    Geometry(#[source] antumbra::Error),
    /// A picture has no pixels, or more than can be addressed.
    #[error(
        "a picture of {width} x {height} pixels with crop window {crop:?} has no pixels, or too many"
    )]
    EmptyPicture {
        /// Width of the full picture.
        width: u32,
        /// Height of the full picture.
        height: u32,
        /// The crop window, as `[x_min, x_max, y_min, y_max]` in fractions.
        crop: [f32; 4],
    },
    /// A filter radius is not a positive, sensible number of pixels.
    #[error("filter radius {radius:?} is not above 0 and at most 64 pixels")]
    FilterRadius {
        /// Half-widths in x and y.
        radius: [f32; 2],
    },
    /// A field of view is outside of (0, 180) degrees.
    #[error("field of view of {degrees} degrees is not between 0 and 180")]
    FieldOfView {
        /// The value given.
        degrees: f32,
    },
    /// A camera transformation is not finite, or flattens space.
    #[error(
        "the camera transformation has determinant {determinant}, which is not finite and different from 0"
    )]
    CameraMatrix {
        /// Determinant of its linear part.
        determinant: f32,
    },
    /// A number of samples is 0.
    #[error("{what} must be at least 1")]
    NoSamples {
        /// Kind of samples.
        what: &'static str,
    },
    /// A share of logged samples is outside of 0..=1.
    #[error("share of logged samples {share} is not in 0..=1")]
    LogShare {
        /// The value given.
        share: f64,
    },
    /// The kernel could not order the tree.
    #[error("the tree cannot be ordered: {0}")]
    Order(#[source] antumbra::Error),
    /// The requested threads could not be started.
    #[error("{threads} threads cannot be started: {source}")]
    Threads {
        /// Number of threads.
        threads: usize,
        /// Why not.
        source: rayon::ThreadPoolBuildError,
    },
    /// The picture could not be assembled.
    #[error("the picture cannot be assembled: {0}")]
    Image(#[source] antumbra_image::Error),
    /// Bytes are no file of this program.
    #[error("it is no file of antumbra")]
    NotAnArchive,
    /// A file of this program has other contents.
    #[error("it is not {expected}")]
    ArchiveKind {
        /// Contents that were expected.
        expected: &'static str,
    },
    /// A file is of an older or newer version of this program.
    #[error("it is written in format {found}, but this version reads format {known} alone")]
    ArchiveFormat {
        /// Format of the file.
        found: u32,
        /// Format that can be read.
        known: u32,
    },
    /// A file was cut short or changed.
    #[error("it is truncated or damaged")]
    DamagedArchive,
    /// A snapshot is of another scene, or of other options.
    #[error("the snapshot to resume is of another scene, part or options than the rendering")]
    OtherSnapshot,
    /// A finished picture cannot get more samples.
    #[error("{reason}")]
    Extend {
        /// Reason.
        reason: &'static str,
    },
    /// Parts of a picture cannot be joined.
    #[error("{reason}")]
    Join {
        /// Reason, with the names of the parts.
        reason: String,
    },
    /// [`crate::Monitor::cancelled`] returned true.
    #[error("rendering was cancelled")]
    Cancelled,
}

impl Error {
    /// Why a build of the kernel ended.
    pub(crate) fn of_build(error: antumbra::Error) -> Self {
        match error {
            antumbra::Error::Cancelled => Self::Cancelled,
            other => Self::Geometry(other),
        }
    }
}
