//! The training rays of a scene, kept in place of a tree.

use antumbra::Ray;
use serde::{Deserialize, Serialize};

/// Training rays of a scene: a fair sample of the shadow rays of its pre-pass.
///
/// A picture is learned from one in 2048 of its shadow rays, clamped to 2¹²..=2¹⁴. The nodes of a tree and their
/// child order follow from these rays within some hundredths of a second, for any width and any order. Files
/// therefore keep the rays in place of a tree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Vec<[f32; 8]>", into = "Vec<[f32; 8]>")]
pub struct Lesson {
    rays: Vec<Ray>,
}

impl Lesson {
    /// Training rays.
    pub fn rays(&self) -> &[Ray] {
        &self.rays
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
