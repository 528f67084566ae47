//! What an order was learned from, to be learned from again.

use antumbra::Ray;
use serde::{Deserialize, Serialize};

use crate::Error;
use crate::resume::Place;
use crate::resume::archive::{self, Kind};

/// Shadow rays of a scene, a fair sample of those of its pre-pass, no more than are worth it: one in 2048 of those that a
/// picture will ask for, but 2¹² if there are so many, and at most 2¹⁴.
///
/// Everything that is learned, the nodes of a tree as well as their order, follows from them within some
/// hundredths of a second, for any width and any order. So they are what is kept in place of a tree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Vec<[f32; 8]>", into = "Vec<[f32; 8]>")]
pub struct Lesson {
    rays: Vec<Ray>,
}

impl Lesson {
    /// The rays.
    pub fn rays(&self) -> &[Ray] {
        &self.rays
    }
}

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

impl From<Vec<Ray>> for Lesson {
    fn from(rays: Vec<Ray>) -> Self {
        Self { rays }
    }
}

impl From<Vec<[f32; 8]>> for Lesson {
    fn from(rows: Vec<[f32; 8]>) -> Self {
        let ray = |[ox, oy, oz, tnear, dx, dy, dz, tfar]: [f32; 8]| Ray {
            org: [ox, oy, oz],
            tnear,
            dir: [dx, dy, dz],
            tfar,
        };
        Self {
            rays: rows.into_iter().map(ray).collect(),
        }
    }
}

impl From<Lesson> for Vec<[f32; 8]> {
    fn from(lesson: Lesson) -> Self {
        let row = |ray: Ray| {
            let ([ox, oy, oz], [dx, dy, dz]) = (ray.org, ray.dir);
            [ox, oy, oz, ray.tnear, dx, dy, dz, ray.tfar]
        };
        lesson.rays.into_iter().map(row).collect()
    }
}
