//! What can go wrong before or while a picture is computed.

/// Why a scene could not be lowered or a picture not be rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A shape names a material that does not exist.
    #[error("shape {shape} uses material {material}, but there are only {materials}")]
    Material {
        /// Position of the shape among those stored: of the world, then of the objects.
        shape: usize,
        /// The index it names.
        material: usize,
        /// Number of materials.
        materials: usize,
    },
    /// A mesh whose vertex attributes do not match its positions.
    #[error("shape {shape} has {positions} positions but {found} {attribute}")]
    VertexAttribute {
        /// Position of the shape among those stored: of the world, then of the objects.
        shape: usize,
        /// `normals` or `texture coordinates`.
        attribute: &'static str,
        /// How many there are; none would be fine.
        found: usize,
        /// Number of positions.
        positions: usize,
    },
    /// An image of a texture without pixels, with more or fewer than its sides say, or too large to be looked up
    /// in.
    #[error("texture {name} of {width} x {height} texels has {found}")]
    Texture {
        /// The image's name.
        name: String,
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
        /// The number of pixels that it has.
        found: usize,
    },
    /// A material or a cut-out that is put together from too many others.
    #[error("{what} {index} is made of more than {limit} materials and textures")]
    Parts {
        /// `material` or `mask of shape`.
        what: &'static str,
        /// Its position in the scene; shapes of objects are counted after those of the world.
        index: usize,
        /// How many there may be.
        limit: usize,
    },
    /// The kernel refused the geometry.
    #[error("the geometry cannot be traced: {0}")]
    Geometry(#[source] antumbra::Error),
    /// A picture without pixels, or beyond what can be addressed.
    #[error("a picture of {width} x {height} pixels with crop window {crop:?} cannot be made")]
    EmptyPicture {
        /// Width of the full picture.
        width: u32,
        /// Height of the full picture.
        height: u32,
        /// The crop window, as `[x_min, x_max, y_min, y_max]` in fractions.
        crop: [f32; 4],
    },
    /// A filter radius that is not a positive, sensible number of pixels.
    #[error("filter radius {radius:?} is not in (0, 64] pixels")]
    FilterRadius {
        /// Half-widths in x and y.
        radius: [f32; 2],
    },
    /// A field of view outside (0, 180) degrees.
    #[error("field of view of {degrees} degrees is not between 0 and 180")]
    FieldOfView {
        /// The value given.
        degrees: f32,
    },
    /// A camera transformation that is not finite or flattens space.
    #[error("the camera transformation has determinant {determinant}")]
    CameraMatrix {
        /// Determinant of its linear part.
        determinant: f32,
    },
    /// No samples, of pixels or of ambient occlusion.
    #[error("{what} must be at least 1")]
    NoSamples {
        /// What there are none of.
        what: &'static str,
    },
    /// A share of logged samples outside 0..=1.
    #[error("share of logged samples {share} is not in 0..=1")]
    LogShare {
        /// The value given.
        share: f64,
    },
    /// The kernel could not order the tree.
    #[error("the tree cannot be ordered: {0}")]
    Order(#[source] antumbra::Error),
    /// The threads asked for could not be started.
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
    /// A snapshot or a lesson cannot be stored.
    #[error("the state of the rendering cannot be stored: {0}")]
    Encode(#[source] postcard::Error),
    /// Bytes that are no file of this program.
    #[error("it is no file of antumbra")]
    NotAnArchive,
    /// A file of this program with something else in it.
    #[error("it is not {expected}")]
    ArchiveKind {
        /// What should be in it.
        expected: &'static str,
    },
    /// A file of an older or newer version of this program.
    #[error("it is written in format {found}; this version reads format {known} alone")]
    ArchiveFormat {
        /// Version of its format.
        found: u32,
        /// The one that can be read.
        known: u32,
    },
    /// A file that was cut short or changed.
    #[error("it is truncated or damaged")]
    DamagedArchive,
    /// A snapshot of another scene, or made with other options.
    #[error("what is to be gone on with is of another scene or was made with other options")]
    OtherSnapshot,
    /// Parts of a picture that cannot be joined.
    #[error("{reason}")]
    Join {
        /// Names the parts.
        reason: String,
    },
    /// [`crate::Monitor::cancelled`] said so.
    #[error("rendering was cancelled")]
    Cancelled,
}
