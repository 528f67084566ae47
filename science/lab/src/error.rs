//! Why an experiment ends early.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Why a study or a benchmark was not finished, or its results are refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scene that cannot be rendered.
    #[error("{scene}: {source}")]
    Scene {
        /// Name of the scene.
        scene: String,
        /// Error of the renderer.
        source: antumbra_render::Error,
    },
    /// Eye, target and up vector, as in pbrt's `LookAt`, that span no camera.
    #[error("a camera at {} cannot look at {} with {} upwards", triple(.0, 0), triple(.0, 3), triple(.0, 6))]
    LookAt(
        /// The nine numbers.
        [f64; 9],
    ),
    /// A directory whose journal is of another study, or damaged.
    #[error("{} is of another study: {reason}", path.display())]
    OtherStudy {
        /// The journal.
        path: PathBuf,
        /// How the studies differ.
        reason: String,
    },
    /// A file or directory that cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file or directory.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// A shared library that cannot be used as Embree 4.
    #[error("cannot use {} as Embree: {reason}", path.display())]
    EmbreeLibrary {
        /// The library.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A failure of Embree at work.
    #[error("{0}")]
    Embree(
        /// Message of Embree.
        String,
    ),
    /// Threads that cannot be started.
    #[error("cannot start {threads} threads: {source}")]
    Threads {
        /// Number of threads.
        threads: usize,
        /// Error of the thread pool.
        source: rayon::ThreadPoolBuildError,
    },
    /// Geometry or an order that the kernel refuses.
    #[error("the kernel cannot trace this: {0}")]
    Kernel(#[from] antumbra::Error),
    /// A rendering that failed.
    #[error(transparent)]
    Render(antumbra_render::Error),
    /// An image that cannot be written or read again.
    #[error(transparent)]
    Image(#[from] antumbra_image::Error),
    /// A chart, a page or a table that cannot be made of the results.
    #[error("cannot make the report: {0}")]
    Report(
        /// The step that failed.
        String,
    ),
    /// Images or answers that are not the same bits although they must be.
    #[error("{rule}, but these differ:\n  {}", found.join("\n  "))]
    Differ {
        /// The rule that is broken.
        rule: &'static str,
        /// The results that are not.
        found: Vec<String>,
    },
    /// Results that the [watcher](crate::Watcher) cannot show.
    #[error("cannot write the result: {0}")]
    Show(
        /// Error of the system.
        io::Error,
    ),
    /// A request of the [watcher](crate::Watcher) to stop.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// A report that cannot be made.
    pub(crate) fn report(reason: impl fmt::Display) -> Self {
        Self::Report(reason.to_string())
    }

    /// A file that cannot be written.
    pub(crate) fn write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Write {
            path: path.to_path_buf(),
            source,
        }
    }

    /// A scene that cannot be rendered.
    pub(crate) fn scene(scene: &str) -> impl FnOnce(antumbra_render::Error) -> Self {
        move |source| Self::Scene {
            scene: scene.to_owned(),
            source,
        }
    }
}

impl From<antumbra_render::Error> for Error {
    fn from(error: antumbra_render::Error) -> Self {
        match error {
            antumbra_render::Error::Cancelled => Self::Interrupted,
            error => Self::Render(error),
        }
    }
}

/// Three of the numbers, separated by commas.
fn triple(numbers: &[f64; 9], first: usize) -> String {
    let [x, y, z] = [0, 1, 2].map(|axis| numbers[first + axis]);
    format!("{x},{y},{z}")
}
