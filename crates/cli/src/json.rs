//! JSON documents: one per command, with a `schema` field. Values that are not finite become `null`.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use antumbra_image::atomic_write;
use serde::Serialize;

use crate::exit::{Failure, print};

/// Where a document goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Destination {
    /// The standard output, written `-`.
    Stdout,
    /// A file.
    File(PathBuf),
}

impl FromStr for Destination {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "-" => Self::Stdout,
            path => Self::File(path.into()),
        })
    }
}

impl Destination {
    /// The file, if it is one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::Stdout => None,
            Self::File(path) => Some(path),
        }
    }
}

/// Writes a document where it was asked for, if it was.
pub fn write(document: &impl Serialize, to: Option<&Destination>) -> Result<(), Failure> {
    match to {
        None => Ok(()),
        Some(Destination::Stdout) => print(text(document)?),
        Some(Destination::File(path)) => write_file(document, path),
    }
}

/// Writes a document to a file.
pub fn write_file(document: &impl Serialize, path: &Path) -> Result<(), Failure> {
    let text = text(document)?;
    atomic_write(path, |file| writeln!(file, "{text}"))?;
    Ok(())
}

fn text(document: &impl Serialize) -> Result<String, Failure> {
    serde_json::to_string_pretty(document).map_err(Failure::work)
}
