//! Reads pbrt version 3 scenes and PLY meshes.
//!
//! [`load`] makes an [`antumbra_scene::Scene`] of a `.pbrt` file and what it includes. Everything that
//! is wrong is reported together, each mistake with file, line, column, the line itself and, where
//! known, what would be right. What pbrt-v3 can do and this reader cannot is an error that says so; the
//! little that cannot change the picture but for its noise is accepted and mentioned in [`Loaded::notes`].
//!
//! The way of the data: bytes → tokens (`lexer`) → directives (`parser`, `params`) → scene (`builder`).
//!
//! - `source`, `report`, `diagnostic`, `suggest`: files in memory, places in them, what is said of them
//! - `number`, `lexer`, `params`, `directive`, `parser`: the syntax
//! - `lookup`: what a directive asks its parameters, and what was never asked for
//! - `state`, `builder`: what is in force, and the scene that grows;  `budget`: how far
//! - `camera`, `film`, `settings`, `light`, `material`, `texture`, `shape`: one group of directives each
//! - `material_key`: when two materials are the same;  `parts`: how many they and textures may be made of
//! - `transform`, `spectrum`: matrices and colours as pbrt-v3 defines them
//! - `ply`, `mesh_file`: meshes in files of their own
#![forbid(unsafe_code)]

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
mod material_key;
mod mesh_file;
mod number;
mod params;
mod parser;
mod parts;
mod ply;
mod report;
mod settings;
mod shape;
mod source;
mod spectrum;
mod state;
mod suggest;
#[cfg(test)]
mod support;
mod texture;
mod transform;

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use antumbra_scene::Scene;

pub use diagnostic::{Diagnostic, Diagnostics, Severity};
pub use ply::{PlyError, PlyPlace, load_ply, parse_ply};

/// What the caller lets a scene choose.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options<'a> {
    /// Names that `Accelerator "qbvh" "string order"` may have.
    pub orders: &'a [&'a str],
    /// Bytes that shapes, instances and images may take in all, meshes and images in files of their own included;
    /// `None` is no limit. While a file is read it may take a few times its size besides.
    pub max_memory: Option<u64>,
}

/// A scene that was read without mistakes.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// The scene files that it was read from, without links and dots: the main one, then all that it includes.
    pub files: Vec<PathBuf>,
    /// What was left out or mapped; the picture is the same up to its noise.
    pub notes: Vec<Diagnostic>,
    /// Where the time went.
    pub times: Times,
}

/// What the reader spent its time on. Times of the clock: meshes and images are read by many threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct Times {
    /// Everything else: the text of the scene and what is made of it.
    pub parse: Duration,
    /// Reading meshes from their files and moving them to where they stand.
    pub meshes: Duration,
    /// Reading images.
    pub images: Duration,
}

/// Why nothing was read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file itself cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// There are mistakes in the scene.
    #[error("{0}")]
    Scene(Diagnostics),
    /// A mesh that was read on its own is broken.
    #[error("{0}")]
    Ply(PlyError),
}

/// Reads a `.pbrt` file and everything it includes.
///
/// Relative paths within start at the folder of this file. The scene is named after it.
///
/// # Errors
/// [`Error::Io`] if this file cannot be read, [`Error::Scene`] with every mistake otherwise: also
/// missing includes and broken meshes, at the place that names them.
pub fn load(path: &Path, options: &Options) -> Result<Loaded, Error> {
    read(path, options, |sources| {
        sources.open(path).map(|(file, _)| file)
    })
}

/// The same for a text in memory that is taken for the file `path`, whether there is one or not.
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
    report.sources.folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let main_file = open(&mut report.sources).map_err(|source| Error::Io {
        path: path.to_path_buf(),
        source,
    })?;
    let mut builder = builder::Builder::new(options);
    let end = parser::parse(main_file, &mut builder, &mut report);
    let name = path.file_stem().unwrap_or_default();
    let (scene, mut times) = builder.finish(name.to_string_lossy().into_owned(), end, &mut report);
    let files = report.sources.paths();
    let notes = report.finish().map_err(Error::Scene)?;
    times.parse = start.elapsed() - times.meshes - times.images;
    Ok(Loaded {
        scene,
        files,
        notes,
        times,
    })
}
