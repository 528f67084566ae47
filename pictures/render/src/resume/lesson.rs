//! Training rays as a file.

use std::io::{self, Write};

use crate::Error;
use crate::training::Lesson;

use super::Place;
use super::archive::{self, Kind};

impl Lesson {
    /// Writes the bytes of a file. Equal training rays have equal bytes.
    ///
    /// # Errors
    /// Errors of `file`.
    pub fn write(&self, place: &Place, file: &mut dyn Write) -> io::Result<()> {
        archive::write(Kind::Lesson, &(place, self), file)
    }

    /// Reads the bytes of a file. Damaged files are refused.
    ///
    /// # Errors
    /// [`Error::NotAnArchive`], [`Error::ArchiveKind`], [`Error::ArchiveFormat`], [`Error::DamagedArchive`].
    pub fn from_bytes(bytes: &[u8]) -> Result<(Place, Self), Error> {
        archive::decode(Kind::Lesson, bytes)
    }
}
