//! Why there is no scene.

use std::path::PathBuf;

use antumbra_mesh::Warning;
use antumbra_pbrt::Diagnostic;
use antumbra_scene::builtin;

use crate::{Crop, MemorySize};

/// The formats a scene may have.
const KNOWN: &str = ".pbrt, .ply, .obj, .stl, .gltf, .glb, height rasters as .tif, .asc, .npy or .vrt, a folder of rasters, or builtin:NAME";

/// Why a scene was not loaded or cannot be used as requested.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A `builtin:` name that no built-in scene has.
    #[error("there is no builtin:{name}; there is {known}", known = builtin_names())]
    UnknownBuiltin {
        /// The text after `builtin:`.
        name: String,
    },
    /// A file whose extension names no known format.
    #[error("{}: {}; known are {KNOWN}", path.display(), unknown(extension))]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// Extension; empty if there is none.
        extension: String,
    },
    /// A compressed file of a format that is read only as it is.
    #[error("{}: only .pbrt and .ply files may be compressed; decompress it first", path.display())]
    Compressed {
        /// The file.
        path: PathBuf,
    },
    /// A mesh file without triangles.
    #[error("{}: there is no triangle in it", path.display())]
    EmptyMesh {
        /// The file.
        path: PathBuf,
    },
    /// A `.pbrt` or `.ply` file that cannot be read. See [`Error::diagnostics`].
    #[error(transparent)]
    Pbrt(#[from] antumbra_pbrt::Error),
    /// A mesh file that cannot be read. The text names file and place, and says `error` at every mistake.
    #[error(transparent)]
    Mesh(#[from] antumbra_mesh::Error),
    /// A height raster that cannot be read. The text names the file, and says `error`.
    #[error(transparent)]
    Raster(#[from] antumbra_raster::Error),
    /// Warnings about a mesh file, where warnings are errors: see [`Options::strict`](crate::Options::strict).
    #[error("{}", as_errors(.0))]
    Strict(Vec<Warning>),
    /// A scene that takes more memory than allowed.
    #[error(
        "{scene}: {triangles} triangles and {instances} instances take about {needed} with their trees, more than \
         the {allowed} allowed"
    )]
    SceneTooLarge {
        /// Name of the scene.
        scene: String,
        /// Stored triangles.
        triangles: usize,
        /// Instances.
        instances: usize,
        /// Estimate of the memory needed.
        needed: MemorySize,
        /// Memory allowed.
        allowed: MemorySize,
    },
    /// A picture that takes more memory, together with its scene, than allowed.
    #[error(
        "{scene}: {pixels} pixels of {samples} samples take about {needed} with their scene, more than the {allowed} \
         allowed"
    )]
    PictureTooLarge {
        /// Name of the scene.
        scene: String,
        /// Pixels inside the crop window.
        pixels: u64,
        /// Samples per pixel.
        samples: u32,
        /// Estimate of the memory needed.
        needed: MemorySize,
        /// Memory allowed.
        allowed: MemorySize,
    },
    /// A resolution at which the crop window of the scene holds no pixel.
    #[error("with {width}x{height} pixels none is inside the crop window {crop:?} of {scene}")]
    EmptyCrop {
        /// Name of the scene.
        scene: String,
        /// Requested width in pixels.
        width: u32,
        /// Requested height in pixels.
        height: u32,
        /// The crop window, as `[x_min, x_max, y_min, y_max]` in fractions.
        crop: [f32; 4],
    },
    /// A rectangle that reaches beyond the picture.
    #[error(
        "the crop of {}x{} pixels at {},{} reaches beyond the picture of {}x{} pixels",
        crop.size[0], crop.size[1], crop.corner[0], crop.corner[1], resolution[0], resolution[1]
    )]
    Crop {
        /// The rectangle.
        crop: Crop,
        /// Size of the picture.
        resolution: [u32; 2],
    },
    /// A camera that looks nowhere.
    #[error(
        "the camera looks nowhere: its eye is where it looks, or its up vector points along the view"
    )]
    Camera,
    /// A number of scattering events for an integrator that scatters nothing.
    #[error(
        "the integrator ambientocclusion of {scene} scatters no light, so it has no largest depth"
    )]
    NoDepth {
        /// Name of the scene.
        scene: String,
    },
    /// A number of light samples for an integrator that does not take one.
    #[error(
        "the integrator path of {scene} takes no number of light samples: it asks one light once at every vertex"
    )]
    NoSampleCount {
        /// Name of the scene.
        scene: String,
    },
    /// A distance of occlusion for an integrator other than ambient occlusion.
    #[error("the integrator of {scene} is not ambientocclusion, so it takes no distance")]
    NoDistance {
        /// Name of the scene.
        scene: String,
    },
}

impl Error {
    /// Mistakes of a `.pbrt` file with file, line and column; empty for other errors.
    pub fn diagnostics(&self) -> &[Diagnostic] {
        match self {
            Self::Pbrt(antumbra_pbrt::Error::Scene(mistakes)) => mistakes.as_slice(),
            _ => &[],
        }
    }

    /// Whether the text says `error` at every mistake, after its place.
    pub fn names_places(&self) -> bool {
        matches!(
            self,
            Self::Pbrt(antumbra_pbrt::Error::Scene(_))
                | Self::Mesh(_)
                | Self::Raster(_)
                | Self::Strict(_)
        )
    }
}

/// Largest number of warnings in an error.
const MOST_WARNINGS: usize = 20;

/// Warnings as errors, one per line.
fn as_errors(warnings: &[Warning]) -> String {
    let shown = warnings.iter().take(MOST_WARNINGS);
    let mut lines: Vec<String> = shown
        .map(|warning| format!("{}: error: {}", warning.place, warning.text))
        .collect();
    if let Some(more @ 1..) = warnings.len().checked_sub(MOST_WARNINGS) {
        lines.push(format!("and {more} more"));
    }
    lines.join("\n")
}

/// Message about an extension that no reader has.
fn unknown(extension: &str) -> String {
    match extension {
        "" => "a scene file has an extension that tells its format".to_owned(),
        _ => format!("unknown scene format `{extension}`"),
    }
}

fn builtin_names() -> String {
    let names = builtin::ALL
        .iter()
        .map(|scene| format!("builtin:{}[:TRIANGLES]", scene.name));
    names.collect::<Vec<_>>().join(", ")
}
