//! How the program ends when it cannot do what was asked, and how it speaks to people.

use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Why the program stops, one variant per exit code. The text is complete: it is printed as it is.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Something went wrong while working: code 1.
    #[error("error: {0}")]
    Work(String),
    /// The command line asks for what does not exist: code 2, as for what clap finds.
    #[error("error: {0}")]
    Usage(String),
    /// The scene is bad: code 65 (`EX_DATAERR`). Holds every message about it.
    #[error("{0}")]
    Scene(String),
    /// A file that is damaged or something else than it should be: code 65, too.
    #[error("error: {0}")]
    Data(String),
    /// Ctrl-C or SIGTERM, and the same command goes on from here: code 75 (`EX_TEMPFAIL`).
    #[error("interrupted; the same command goes on from {}", .0.display())]
    Continuable(PathBuf),
    /// Ctrl-C or SIGTERM: code 130 (128 + SIGINT).
    #[error("interrupted; nothing was written of what was not finished")]
    Interrupted,
}

impl Failure {
    /// A failure while working.
    pub fn work(reason: impl fmt::Display) -> Self {
        Self::Work(reason.to_string())
    }

    /// A mistake on the command line.
    pub fn usage(reason: impl fmt::Display) -> Self {
        Self::Usage(reason.to_string())
    }

    /// A scene with one thing to say about it.
    pub fn scene(name: impl fmt::Display, reason: impl fmt::Display) -> Self {
        Self::Scene(format!("error: {name}: {reason}"))
    }

    /// A file of ours that was refused.
    pub fn refused(path: &Path, error: &antumbra_render::Error) -> Self {
        use antumbra_render::Error;
        let text = format!("{}: {error}", path.display());
        match error {
            Error::NotAnArchive | Error::DamagedArchive => Self::Data(text),
            _ => Self::Usage(text),
        }
    }

    /// The exit code.
    pub fn code(&self) -> ExitCode {
        self.number().into()
    }

    /// The exit code as a number.
    pub fn number(&self) -> u8 {
        match self {
            Self::Work(_) => 1,
            Self::Usage(_) => 2,
            Self::Scene(_) | Self::Data(_) => 65,
            Self::Continuable(_) => 75,
            Self::Interrupted => 130,
        }
    }
}

impl From<antumbra_image::Error> for Failure {
    fn from(error: antumbra_image::Error) -> Self {
        use antumbra_image::Error;
        match error {
            // What formats there are can be known before anything is tried.
            Error::UnknownFormat { .. } | Error::Unsupported { .. } => Self::usage(error),
            Error::BadOption { .. } | Error::BadRange { .. } => Self::usage(error),
            _ => Self::work(error),
        }
    }
}

impl From<antumbra_render::Error> for Failure {
    fn from(error: antumbra_render::Error) -> Self {
        match error {
            antumbra_render::Error::Cancelled => Self::Interrupted,
            _ => Self::work(error),
        }
    }
}

impl From<antumbra_bake::Error> for Failure {
    fn from(error: antumbra_bake::Error) -> Self {
        match error {
            antumbra_bake::Error::Cancelled => Self::Interrupted,
            _ => Self::work(error),
        }
    }
}

impl From<antumbra_load::Error> for Failure {
    fn from(error: antumbra_load::Error) -> Self {
        use antumbra_load::Error;
        match error {
            Error::UnknownBuiltin { .. } | Error::UnknownFormat { .. } => Self::usage(error),
            Error::EmptyCrop { .. } => Self::usage(error),
            Error::NoSampleCount { .. } => Self::Usage(format!("--samples: {error}")),
            Error::SceneTooLarge { .. } => Self::Scene(format!(
                "error: {error}; leave something out, or allow more with --max-memory"
            )),
            Error::PictureTooLarge { .. } => Self::Scene(format!(
                "error: {error}; choose another --resolution or --spp, or allow more with --max-memory"
            )),
            _ if error.names_places() => Self::Scene(error.to_string()),
            _ => Self::Scene(format!("error: {error}")),
        }
    }
}

impl From<antumbra_lab::Error> for Failure {
    fn from(error: antumbra_lab::Error) -> Self {
        use antumbra_lab::Error;
        match error {
            Error::Interrupted => Self::Interrupted,
            Error::Image(error) => error.into(),
            Error::Render(error) => error.into(),
            Error::Scene { scene, source } => Self::scene(scene, source),
            Error::LookAt(_) | Error::EmbreeLibrary { .. } => Self::usage(error),
            Error::OtherStudy { .. } => Self::Usage(format!(
                "{error}; choose another folder, or --restart to forget it"
            )),
            _ => Self::work(error),
        }
    }
}

/// Tells people something. Nobody may be listening: failing to say it is no failure.
pub fn say(text: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Prints a result.
pub fn print(text: impl fmt::Display) -> Result<(), Failure> {
    writeln!(io::stdout().lock(), "{text}")
        .map_err(|source| Failure::Work(format!("cannot write the result: {source}")))
}
