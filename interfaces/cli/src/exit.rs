//! How the program ends after an error, and how it prints messages.

use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::progress::line::{COLUMNS, Line, wrapped};
use crate::progress::lock;

/// Why the program stops, one variant per exit code. The text is complete: it is printed as it is.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Something went wrong while working: code 1.
    #[error("error: {0}")]
    Work(String),
    /// The command line names something that does not exist: code 2, as for errors that clap finds.
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

    /// A name of a file that cannot be meant.
    pub fn name(path: &Path, reason: impl fmt::Display) -> Self {
        Self::Usage(format!("{}: {reason}", path.display()))
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
            Error::Read { .. } | Error::Decode { .. } => Self::Data(error.to_string()),
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
            antumbra_bake::Error::Answers => Self::Data(error.to_string()),
            _ => Self::work(error),
        }
    }
}

impl From<antumbra_tiles::Error> for Failure {
    fn from(error: antumbra_tiles::Error) -> Self {
        match error {
            antumbra_tiles::Error::Terrain(error) => antumbra_bake::Error::from(error).into(),
            _ => Self::Scene(error.to_string()),
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
            Error::NoDistance { .. } => Self::Usage(format!("--ao-distance: {error}")),
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

impl From<antumbra_view::Error> for Failure {
    fn from(error: antumbra_view::Error) -> Self {
        use antumbra_view::Error;
        match error {
            Error::Render(error) => error.into(),
            Error::Image(error) => error.into(),
            _ => Self::work(error),
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

/// How much is said.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Loudness {
    /// Only errors: `-q`.
    Quiet,
    /// The usual.
    Usual,
    /// Details, too: `-v`.
    Verbose,
}

static LOUDNESS: AtomicU8 = AtomicU8::new(Loudness::Usual as u8);
/// Whether the terminal shows a line about progress.
static DRAWN: Mutex<bool> = Mutex::new(false);

/// Sets how much is said.
pub fn set_loudness(loudness: Loudness) {
    LOUDNESS.store(loudness as u8, Ordering::Relaxed);
}

/// Does something while no more is said than this.
pub fn quietly<T>(loudness: Loudness, work: impl FnOnce() -> T) -> T {
    let before = LOUDNESS.swap(loudness as u8, Ordering::Relaxed);
    let found = work();
    LOUDNESS.store(before, Ordering::Relaxed);
    found
}

/// Whether only errors are said.
pub fn is_quiet() -> bool {
    LOUDNESS.load(Ordering::Relaxed) == Loudness::Quiet as u8
}

/// Whether details are said.
pub fn is_verbose() -> bool {
    LOUDNESS.load(Ordering::Relaxed) == Loudness::Verbose as u8
}

/// Whether people read the standard error output on a terminal.
pub fn is_terminal() -> bool {
    io::stderr().is_terminal()
}

/// A text without characters that a terminal obeys, which names of files may have.
fn printable(text: &str) -> String {
    let is_obeyed = |c: char| c.is_control() && c != '\n' && c != '\t';
    text.replace(is_obeyed, "\u{fffd}")
}

/// Prints an error, a requested text or, unless `-q` is given, a warning. On a terminal long lines are broken between words.
/// Nobody may be listening: failing to say it is no failure.
pub fn say(text: fmt::Arguments<'_>) {
    let text = printable(&text.to_string());
    if is_quiet() && text.starts_with("warning: ") {
        return;
    }
    let mut drawn = lock(&DRAWN);
    let mut out = io::stderr().lock();
    erase(&mut drawn, &mut out);
    let _ = if is_terminal() {
        writeln!(out, "{}", wrapped(&text))
    } else {
        writeln!(out, "{text}")
    };
}

/// Prints a message about the work or a file, unless `-q` is given.
pub fn tell(text: fmt::Arguments<'_>) {
    if !is_quiet() {
        say(text);
    }
}

/// Prints a detail, if `-v` is given.
pub fn detail(text: fmt::Arguments<'_>) {
    if is_verbose() {
        say(text);
    }
}

/// Draws a line about progress in place of the last one, or adds it to a log.
pub fn draw(line: &Line) {
    let mut drawn = lock(&DRAWN);
    let mut out = io::stderr().lock();
    // Work of which nothing is known yet says nothing.
    if line.doing.is_empty() && line.share.is_none() {
        return;
    }
    if is_terminal() {
        let bar = printable(&line.bar());
        let _ = write!(out, "\r{bar:<COLUMNS$}").and_then(|()| out.flush());
        *drawn = true;
    } else {
        let _ = writeln!(out, "{}", printable(&line.log()));
    }
}

/// Takes the line about progress off the terminal.
pub fn undraw() {
    let mut drawn = lock(&DRAWN);
    erase(&mut drawn, &mut io::stderr().lock());
}

fn erase(drawn: &mut bool, out: &mut impl Write) {
    if std::mem::take(drawn) {
        // Spaces, because not every terminal knows how to erase a line.
        let _ = write!(out, "\r{:COLUMNS$}\r", "").and_then(|()| out.flush());
    }
}

/// Prints a result.
pub fn print(text: impl fmt::Display) -> Result<(), Failure> {
    writeln!(io::stdout().lock(), "{text}")
        .map_err(|source| Failure::Work(format!("cannot write the result: {source}")))
}
