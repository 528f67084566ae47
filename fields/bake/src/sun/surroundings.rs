//! Scenes in terrain: hills that hide the sun and the sky from them.

use antumbra::{Bvh, LocalOrigin};
use antumbra_terrain::{HeightField, Light, Skyline};
use rayon::prelude::*;

use crate::{Error, Key, Monitor, Orientation, UpAxis, ones};

/// A height field around a scene, in the same map coordinates: it hides lights from points of the scene (see
/// [`SunJob::within`](crate::SunJob::within)), and the scene hides them from its cells (see
/// [`FieldSunJob::among`](crate::FieldSunJob::among)).
pub struct Surroundings<'a> {
    skyline: Skyline<'a>,
    field: &'a HeightField<'a>,
    local: LocalOrigin,
    /// East, the north of the map, and up in the scene.
    plan: Orientation,
    up: UpAxis,
    north: f64,
}

impl<'a> Surroundings<'a> {
    /// The field around a scene whose points are measured from `local`. `up` and `north` are as of [`Orientation::new`], and those that
    /// sunlight is made with.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn new(
        field: &'a HeightField<'a>,
        local: LocalOrigin,
        (up, north): (UpAxis, f64),
    ) -> Result<Self, Error> {
        Ok(Self {
            skyline: Skyline::new(field)?,
            field,
            local,
            plan: Orientation::new(up, 0.0)?,
            up,
            north,
        })
    }

    /// Column and row of a point of the scene, and its height. The height is larger by the [origin offset](Bvh::origin_offset), so that
    /// a point on the surface is not below it for rounding.
    fn place(&self, bvh: &Bvh, point: [f32; 3]) -> ([f64; 2], f64) {
        let [x, y, z] = self.plan.local(self.local.world(point));
        let place = self.field.place([x, y]);
        (place, z + f64::from(bvh.origin_offset(point)))
    }

    /// Memory beside the heights of the field.
    pub fn bytes(&self) -> usize {
        self.skyline.bytes()
    }

    /// How many points are below the surface, from where nothing is seen.
    pub fn buried(&self, bvh: &Bvh, points: &[[f32; 3]]) -> usize {
        let is_below = |point: &&[f32; 3]| {
            let (place, height) = self.place(bvh, **point);
            self.skyline.buries(place, height)
        };
        points.par_iter().filter(is_below).count()
    }

    /// Suns and patches of the sky, as the field sees them.
    pub(crate) fn lights(&self, directions: &[[f64; 2]]) -> Result<Vec<Light>, Error> {
        let lights = directions.iter();
        let light = |&[azimuth, slope]: &[f64; 2]| Ok(self.skyline.light(azimuth, slope)?);
        lights.map(light).collect()
    }

    /// Removes the lights that the surface hides from rows of those that points see.
    pub(crate) fn hide(
        &self,
        (bvh, points): (&Bvh, &[[f32; 3]]),
        lights: &[Light],
        seen: &mut [u64],
        monitor: &dyn Monitor,
    ) -> Result<(), Error> {
        let rows = seen.par_chunks_exact_mut(lights.len().div_ceil(64).max(1));
        rows.zip(points).try_for_each(|(row, &point)| {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            let (place, height) = self.place(bvh, point);
            for (word, lights) in row.iter_mut().zip(lights.chunks(64)) {
                let all = [*word];
                let is_hidden = |&bit: &usize| self.skyline.hides(place, height, &lights[bit]);
                *word &= !ones(&all)
                    .filter(is_hidden)
                    .fold(0, |hidden, bit| hidden | 1 << bit);
            }
            Ok(())
        })
    }

    /// A place of the map in the scene, measured from its origin.
    pub(crate) fn point(&self, place: [f64; 3]) -> [f32; 3] {
        self.local.local(self.plan.scene(place))
    }

    /// A direction of the map in the scene.
    pub(crate) fn vector(&self, vector: [f32; 3]) -> [f64; 3] {
        self.plan.scene(vector.map(f64::from))
    }

    /// The orientation that sunlight of the scene is made with.
    pub(crate) fn orientation(&self) -> Result<Orientation, Error> {
        Orientation::new(self.up, self.north)
    }

    /// Angle from the north of the map to true north.
    pub(crate) fn north(&self) -> f64 {
        self.north
    }

    /// Adds where the scene lies in the field, and the field, to the key of a job.
    pub(crate) fn identify(&self, key: &mut Key) {
        let (size, transform) = (self.field.size(), self.field.transform());
        key.text(&format!(
            "in {size:?} {transform:?} {:?} {:?} {}",
            self.local.origin, self.up, self.north
        ));
        key.numbers(self.field.heights());
    }
}
