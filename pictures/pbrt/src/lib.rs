//! Reader of pbrt version 3 scenes and PLY meshes.
//!
//! [`load`] reads a `.pbrt` file and its includes as an [`antumbra_scene::Scene`]. All mistakes are reported together,
//! each with file, line, column, the line itself and, where known, what would be right. Features of pbrt-v3 that the
//! reader lacks are errors which say so, or warnings with [`Options::skip_unsupported`]. Features that change only the noise of the
//! picture are accepted and listed in [`Loaded::notes`].
//!
//! # Example
//!
//! ```
//! use antumbra_pbrt::{Options, parse};
//! use std::path::Path;
//!
//! let text = r#"WorldBegin Shape "sphere" "float radius" 2 WorldEnd"#;
//! let loaded = parse(text.into(), Path::new("ball.pbrt"), &Options::default())?;
//! assert_eq!(loaded.scene.shapes.len(), 1);
//!
//! let text = text.replace("radius", "raduis");
//! let mistakes = parse(text.into(), Path::new("ball.pbrt"), &Options::default()).unwrap_err();
//! assert!(mistakes.to_string().contains(r#"did you mean "radius"?"#));
//! # Ok::<(), antumbra_pbrt::Error>(())
//! ```
//!
//! # Files
//!
//! Data flows from bytes to tokens (`lexer`), to directives (`parser`, `params`), to the scene (`builder`).
//!
//! - `source`, `report`, `diagnostic`, `suggest`: files in memory, places in them, and messages about them
//! - `number`, `lexer`, `params`, `arguments`, `directive`, `parser`: the syntax, with directives as rows
//! - `lookup`: typed parameters of a directive, and the report of unknown ones
//! - `state`, `builder`: the graphics state, and the scene under construction
//! - `budget`, `parts`: limits on memory, and on nested textures and materials
//! - `camera`, `film`, `settings`, `light`, `material`, `texture`, `shape`: one group of directives each
//! - `named_spectra`: metals, glasses and illuminants by name
//! - `version4`: scenes of pbrt-v4
//! - `transform`, `spectrum`: matrices and colours as pbrt-v3 defines them
//! - `ply`, `mesh_file`: PLY meshes, and meshes that scenes name;  `bsdf_file`: tables of scattering
#![forbid(unsafe_code)]

mod arguments;
mod bsdf_file;
mod budget;
mod builder;
mod camera;
mod diagnostic;
mod directive;
mod film;
mod lexer;
mod light;
mod lookup;
mod material;
mod medium;
mod mesh_file;
mod named_spectra;
mod number;
mod params;
mod parser;
mod parts;
mod ply;
mod presets;
mod report;
mod settings;
mod shape;
mod source;
mod spectrum;
mod state;
mod suggest;
#[cfg(test)]
mod support_tests;
mod texture;
mod transform;
mod version4;

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use antumbra_scene::Scene;
use glam::DVec3;

pub use diagnostic::{Diagnostic, Diagnostics, Severity};
pub use ply::{
    ColoredPly, PlyError, PlyPlace, load_colored_ply_within, load_ply, load_ply_within, parse_ply,
};

/// Options of reading: names and memory that a scene may use.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    /// Names that `Accelerator "qbvh" "string order"` accepts. Other names are errors.
    pub orders: &'a [&'a str],
    /// Largest memory of all shapes, instances and images in bytes; `None` means no limit.
    ///
    /// Meshes and images in separate files count too, and so do the texts of the scene. Reading a file needs a few times its size in addition.
    pub max_memory: Option<u64>,
    /// Where positions of the [scene](Scene::origin) are measured from.
    pub origin: DVec3,
    /// Whether unsupported features are left out with warnings. Otherwise they are errors.
    pub skip_unsupported: bool,
    /// Whether warnings and notes about what only a picture shows are left out: materials, textures, lights, film, sampling.
    pub only_geometry: bool,
    /// Whether names of unknown and undefined materials are errors. Otherwise they are warnings, and pbrt-v3's choice is taken.
    pub strict: bool,
}

/// Scene that was read without mistakes.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Loaded {
    /// Scene, named after its file.
    pub scene: Scene,
    /// Canonical paths of the scene files: the main file, then all included files.
    pub files: Vec<PathBuf>,
    /// Paths of all other files that were read: meshes, images and spectra.
    pub resources: Vec<PathBuf>,
    /// Warnings and notes about parts that were left out or taken as something else, in order of file and position.
    pub notes: Vec<Diagnostic>,
    /// Time spent on the parts of reading.
    pub times: Times,
}

/// Time spent on the parts of reading, in wall-clock time. Meshes and images are read by several threads.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct Times {
    /// Parsing the text of the scene and building the scene.
    pub parse: Duration,
    /// Reading meshes from their files and transforming them.
    pub meshes: Duration,
    /// Reading images from their files.
    pub images: Duration,
}

/// Reason why a scene or mesh could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The main file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system, or the reason for the refusal.
        source: io::Error,
    },
    /// The scene contains mistakes.
    #[error("{0}")]
    Scene(Diagnostics),
    /// A mesh that [`load_ply`] or [`parse_ply`] reads is broken.
    #[error("{0}")]
    Ply(PlyError),
}

/// Reads a `.pbrt` file and all files it includes.
///
/// Relative paths start at the folder of the main file. The scene is named after the main file. Reading ends where the
/// scene needs more memory than is allowed, and where files that are included again have more than 4 GiB in all.
///
/// # Errors
/// [`Error::Io`] if the main file cannot be read. [`Error::Scene`] with all mistakes otherwise; missing includes and
/// broken meshes are reported at the place that names them.
pub fn load(path: &Path, options: &Options) -> Result<Loaded, Error> {
    read(path, options, |sources| {
        sources.open(path).map(|(file, _)| file)
    })
}

/// Reads a scene from a text in memory. Messages and relative paths use `path`, which need not exist.
///
/// # Errors
/// [`Error::Io`] if the text is 2 GiB or longer, otherwise as [`load`].
pub fn parse(text: Vec<u8>, path: &Path, options: &Options) -> Result<Loaded, Error> {
    read(path, options, |sources| sources.take(path, text))
}

fn read(
    path: &Path,
    options: &Options,
    open: impl FnOnce(&mut source::Sources) -> io::Result<u32>,
) -> Result<Loaded, Error> {
    let start = Instant::now();
    let mut report = report::Report::default();
    report.skips_unsupported = options.skip_unsupported;
    report.is_strict = options.strict;
    report.sources.limit = options.max_memory.unwrap_or(u64::MAX);
    report.sources.folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let main_file = open(&mut report.sources).map_err(|source| Error::Io {
        path: path.to_path_buf(),
        source,
    })?;
    let is_version4 = version4::is_version4(&report, main_file);
    let mut builder = builder::Builder::new(options);
    if is_version4 {
        builder.set_version4();
        report.is_version4 = true;
        // A name that is not translated mostly belongs to a feature that is missing.
        report.is_strict = true;
    }
    let end = parser::parse(main_file, &mut builder, &mut report);
    let name = path.file_stem().unwrap_or_default();
    let (scene, mut times) = builder.finish(name.to_string_lossy().into_owned(), end, &mut report);
    let files = report.sources.paths();
    let resources = report.sources.others();
    if is_version4 {
        version4::say(main_file, &mut report);
    }
    let notes = report.finish(options.only_geometry).map_err(Error::Scene)?;
    times.parse = start.elapsed() - times.meshes - times.images;
    Ok(Loaded {
        scene,
        files,
        resources,
        notes,
        times,
    })
}
