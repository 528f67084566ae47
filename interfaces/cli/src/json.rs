//! JSON documents: one per command, with a `schema` field. Values that are not finite become `null`.

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use antumbra_lab::write_json;
use serde::Serialize;

use crate::exit::{Failure, print, say};

/// Where a document goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Destination {
    /// The standard output, written `-`.
    Stdout,
    /// A file.
    File(PathBuf),
}

impl FromStr for Destination {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text {
            "-" | "/dev/stdout" => Self::Stdout,
            path => Self::File(path.into()),
        })
    }
}

impl Destination {
    /// The path of the file; `/dev/stdout` for `-`.
    pub fn path(&self) -> &Path {
        match self {
            Self::Stdout => Path::new("/dev/stdout"),
            Self::File(path) => path,
        }
    }
}

/// Writes a document to the file of the flag, if there is one.
pub fn write(document: &impl Serialize, to: Option<&Destination>) -> Result<(), Failure> {
    match to {
        None => Ok(()),
        Some(Destination::Stdout) => print(antumbra_lab::json(document)?),
        Some(Destination::File(path)) => Ok(write_json(document, path)?),
    }
}

/// Prints a result for people: to the standard output, or to the standard error output if the standard output belongs
/// to a document.
pub fn print_beside(to: Option<&Destination>, text: &str) -> Result<(), Failure> {
    if to == Some(&Destination::Stdout) {
        say(format_args!("{text}"));
        Ok(())
    } else {
        print(text)
    }
}
