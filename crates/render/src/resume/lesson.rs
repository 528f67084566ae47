//! Training rays as a file.

use crate::Error;
use crate::training::Lesson;

use super::Place;
use super::archive::{self, Kind};

impl Lesson {
    /// Bytes of a file. Equal training rays have equal bytes.
    ///
    /// # Errors
    /// [`Error::Encode`].
    pub fn to_bytes(&self, place: &Place) -> Result<Vec<u8>, Error> {
        archive::encode(Kind::Lesson, &(place, self))
    }

    /// Reads the bytes of a file. Damaged files are refused.
    ///
    /// # Errors
    /// [`Error::NotAnArchive`], [`Error::ArchiveKind`], [`Error::ArchiveFormat`], [`Error::DamagedArchive`].
    pub fn from_bytes(bytes: &[u8]) -> Result<(Place, Self), Error> {
        archive::decode(Kind::Lesson, bytes)
    }
}
