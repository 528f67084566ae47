//! The job of ambient occlusion.

use std::ops::Range;

use antumbra::{Bvh, Ray};

use crate::points::curve::Places;
use crate::sight::ambient_occlusion::check;
use crate::{
    AmbientOcclusion, Answers, Error, Job, Key, Monitor, Size, ambient_occlusion, ambient_rays,
    bent_normals,
};

/// Job of [`ambient_occlusion`], or of [`bent_normals`].
///
/// Items are points along a curve, so that the items of a chunk are near each other.
pub struct OcclusionJob {
    places: Places,
    options: AmbientOcclusion,
    bent_normals: bool,
}

/// Result of an [`OcclusionJob`].
#[derive(Clone, Debug, PartialEq)]
pub struct Openness {
    /// Open part of the sky, `[n]`.
    pub open: Vec<f32>,
    /// Mean direction of the open sky, `[n, 3]`, or empty.
    pub bent_normals: Vec<[f32; 3]>,
}

impl OcclusionJob {
    /// The job of these points, `[n, 3]`, with a normal each. With `bent_normals`, the job
    /// also computes the mean directions of the open sky.
    ///
    /// # Errors
    /// All errors of [`ambient_occlusion`], and [`Error::NoMemory`].
    pub fn new(
        points: &[[f32; 3]],
        normals: &[[f32; 3]],
        options: AmbientOcclusion,
        bent_normals: bool,
    ) -> Result<Self, Error> {
        check(points, normals, &options)?;
        Ok(Self {
            places: Places::new(points, normals)?,
            options,
            bent_normals,
        })
    }
}

impl Job for OcclusionJob {
    type Found = Openness;
    type Number = f32;

    const NAME: &'static str = "ao/2";

    fn size(&self) -> Size {
        let sides = if self.options.two_sided { 2 } else { 1 };
        let rays = sides * u64::from(self.options.samples);
        let numbers = if self.bent_normals { 4 } else { 1 };
        Size::each(self.places.points.len(), rays, numbers)
    }

    fn places(&self) -> Option<&Places> {
        Some(&self.places)
    }

    fn identify(&self, key: &mut Key) {
        key.text(&format!("{:?} {}", self.options, self.bent_normals));
        key.places(&self.places);
    }

    fn answers(&self, bvh: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        let [points, normals] = self.places.at(items);
        if !self.bent_normals {
            return ambient_occlusion(bvh, points, normals, &self.options, monitor);
        }
        let found = bent_normals(bvh, points, normals, &self.options, monitor)?;
        let numbers = found.iter().flat_map(|point| {
            let [x, y, z] = point.direction;
            [point.open, x, y, z]
        });
        Ok(numbers.collect())
    }

    fn found(&self, numbers: Vec<f32>) -> Result<Openness, Error> {
        if !self.bent_normals {
            return Ok(Openness {
                open: numbers,
                bent_normals: Vec::new(),
            });
        }
        let (fours, _) = numbers.as_chunks::<4>();
        Ok(Openness {
            open: fours.iter().map(|[open, ..]| *open).collect(),
            bent_normals: fours.iter().map(|&[_, x, y, z]| [x, y, z]).collect(),
        })
    }

    fn training_rays(&self, bvh: &Bvh, count: usize, per_item: usize) -> Vec<Ray> {
        let places = (&self.places.points[..], &self.places.normals[..]);
        ambient_rays(bvh, places, &self.options, count, per_item)
    }
}
