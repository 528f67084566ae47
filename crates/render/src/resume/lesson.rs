//! Training rays as a file.

use crate::Error;
use crate::training::Lesson;

use super::Place;
use super::archive::{self, Kind};

impl Lesson {
    /// The bytes of a file; equal ones for equal lessons.
    ///
    /// # Errors
    /// [`Error::Encode`].
    pub fn to_bytes(&self, place: &Place) -> Result<Vec<u8>, Error> {
        archive::encode(Kind::Lesson, &(place, self))
    }

    /// What is in the bytes of a file. Damaged ones are refused.
    ///
    /// # Errors
    /// [`Error::NotAnArchive`], [`Error::ArchiveKind`], [`Error::ArchiveFormat`], [`Error::DamagedArchive`].
    pub fn from_bytes(bytes: &[u8]) -> Result<(Place, Self), Error> {
        archive::decode(Kind::Lesson, bytes)
    }
}
