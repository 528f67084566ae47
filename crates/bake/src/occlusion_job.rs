//! The job of ambient occlusion.

use std::ops::Range;

use antumbra::{Bvh, Ray};

use crate::curve::{along_curve, in_order, put_back};
use crate::{
    AmbientOcclusion, Error, Job, Key, Monitor, ambient_occlusion, ambient_rays, bent_normals,
};

/// Job of [`ambient_occlusion`], or of [`bent_normals`].
///
/// Items are points along a curve, so that those of a chunk are near each other.
pub struct OcclusionJob {
    points: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// Where each of them stands in the list.
    order: Vec<u32>,
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
    /// The job of these points, `[n, 3]`, with a normal each. `bent_normals` asks for the mean directions of the open sky, too.
    ///
    /// # Errors
    /// [`Error::Length`] if the lists differ in length, or [`Error::NoMemory`].
    pub fn new(
        points: &[[f32; 3]],
        normals: &[[f32; 3]],
        options: AmbientOcclusion,
        bent_normals: bool,
    ) -> Result<Self, Error> {
        if points.len() != normals.len() {
            return Err(Error::Length {
                what: "normals",
                found: normals.len(),
                wanted: points.len(),
            });
        }
        let order = along_curve(points)?;
        Ok(Self {
            points: in_order(&order, points)?,
            normals: in_order(&order, normals)?,
            order,
            options,
            bent_normals,
        })
    }
}

impl Job for OcclusionJob {
    type Found = Openness;

    const NAME: &'static str = "ao/2";

    fn items(&self) -> usize {
        self.points.len()
    }

    fn rays_per_item(&self) -> u64 {
        let sides = if self.options.two_sided { 2 } else { 1 };
        sides * u64::from(self.options.samples)
    }

    fn identify(&self, key: &mut Key) {
        key.text(&format!("{:?} {}", self.options, self.bent_normals));
        for list in [&self.points, &self.normals] {
            key.vectors(list);
        }
    }

    fn answers(
        &self,
        bvh: &Bvh,
        items: Range<usize>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<u8>, Error> {
        let (points, normals) = (&self.points[items.clone()], &self.normals[items]);
        if self.bent_normals {
            let found = bent_normals(bvh, points, normals, &self.options, monitor)?;
            let numbers = found.iter().flat_map(|point| {
                let [x, y, z] = point.direction;
                [point.open, x, y, z]
            });
            return Ok(numbers.flat_map(f32::to_le_bytes).collect());
        }
        let found = ambient_occlusion(bvh, points, normals, &self.options, monitor)?;
        Ok(found.into_iter().flat_map(f32::to_le_bytes).collect())
    }

    fn finish(&self, answers: &[Vec<u8>]) -> Result<Openness, Error> {
        let bytes = answers.iter().flat_map(|bytes| bytes.as_chunks::<4>().0);
        let mut numbers: Vec<f32> = bytes.map(|bytes| f32::from_le_bytes(*bytes)).collect();
        let width = if self.bent_normals { 4 } else { 1 };
        if numbers.len() != width * self.points.len() {
            return Err(Error::Answers);
        }
        put_back(self.order.clone(), width, &mut numbers);
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
        let places = (&self.points[..], &self.normals[..]);
        ambient_rays(bvh, places, &self.options, count, per_item)
    }
}
