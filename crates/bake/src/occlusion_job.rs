//! The job of ambient occlusion.

use std::ops::Range;

use antumbra::{Bvh, Ray};

use crate::{
    AmbientOcclusion, Error, Job, Key, Monitor, ambient_occlusion, ambient_rays, bent_normals,
};

/// Job of [`ambient_occlusion`], or of [`bent_normals`].
pub struct OcclusionJob<'a> {
    /// Points, `[n, 3]`.
    pub points: &'a [[f32; 3]],
    /// Normals, `[n, 3]`.
    pub normals: &'a [[f32; 3]],
    /// Options.
    pub options: AmbientOcclusion,
    /// Whether the mean directions of the open sky are found, too.
    pub bent_normals: bool,
}

/// Result of an [`OcclusionJob`].
#[derive(Clone, Debug, PartialEq)]
pub struct Openness {
    /// Open part of the sky, `[n]`.
    pub open: Vec<f32>,
    /// Mean direction of the open sky, `[n, 3]`, or empty.
    pub bent_normals: Vec<[f32; 3]>,
}

impl Job for OcclusionJob<'_> {
    type Found = Openness;

    const NAME: &'static str = "ao/1";

    fn items(&self) -> usize {
        self.points.len()
    }

    fn rays_per_item(&self) -> u64 {
        let sides = if self.options.two_sided { 2 } else { 1 };
        sides * u64::from(self.options.samples)
    }

    fn identify(&self, key: &mut Key) {
        key.text(&format!("{:?} {}", self.options, self.bent_normals));
        for list in [self.points, self.normals] {
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
        let numbers: Vec<f32> = bytes.map(|bytes| f32::from_le_bytes(*bytes)).collect();
        let width = if self.bent_normals { 4 } else { 1 };
        if numbers.len() != width * self.points.len() {
            return Err(Error::Answers);
        }
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
        let places = (self.points, self.normals);
        ambient_rays(bvh, places, &self.options, count, per_item)
    }
}
