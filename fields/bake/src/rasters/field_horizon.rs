//! Horizons of all cells of a height field as a job.

use std::ops::Range;

use antumbra::Bvh;
use antumbra_terrain::{Direction, HeightField, March, Share, Sweep, degrees};

use crate::{Answers, Error, FieldSky, Job, Key, Monitor, Size, SkyMeasure, SkyValues};

/// Job of the horizons of a height field: the elevation of the highest surface in degrees, `[directions, cells]`, as
/// [`Sweep::horizons`] and [`March::horizons`] say. Cells without data have NaN.
///
/// Its items are directions, since a sweep answers all cells at once.
pub struct FieldHorizonJob<'a> {
    sweep: Sweep<'a>,
    march: March<'a>,
    directions: &'a [Direction],
}

impl<'a> FieldHorizonJob<'a> {
    /// The horizons of eyes that are `rise` above their cells. `drop` is [`Curvature::factor`](crate::Curvature::factor), or 0 on a
    /// flat earth.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn new(
        field: &'a HeightField<'a>,
        directions: &'a [Direction],
        rise: f64,
        drop: f64,
    ) -> Result<Self, Error> {
        Ok(Self {
            sweep: Sweep { field, rise, drop },
            march: March::new(field, rise, drop)?,
            directions,
        })
    }

    /// Angles of all cells in the direction of this number.
    ///
    /// # Errors
    /// [`Error::NoMemory`], [`Error::Cancelled`]; [`Error::Range`] if the direction makes no sense.
    ///
    /// # Panics
    /// If there is no such direction.
    pub fn plane(&self, index: usize, monitor: &dyn Monitor) -> Result<Vec<f32>, Error> {
        Ok(match self.directions[index] {
            Direction::Step(step) => self.sweep.horizons(step, degrees, monitor)?,
            Direction::Azimuth(azimuth) => self.march.horizons(azimuth, degrees, monitor)?,
        })
    }

    /// What of the sky each cell sees, with little memory: one direction at a time.
    ///
    /// # Errors
    /// As of [`FieldHorizonJob::plane`]; [`Error::Range`] if there is no direction.
    pub fn sky(&self, measure: SkyMeasure, monitor: &dyn Monitor) -> Result<SkyValues, Error> {
        let count = self.directions.len();
        let mut sky = FieldSky::new(self.sweep.field, self.directions, measure)?;
        for index in 0..count {
            sky.add(index, &self.plane(index, &Share(monitor, [index, count]))?);
        }
        Ok(sky.finish())
    }

    /// [`FieldHorizonJob::sky`] of the angles that [`run`](crate::run) or shards found.
    ///
    /// # Errors
    /// [`Error::NoMemory`]; [`Error::Range`] if there is no direction.
    ///
    /// # Panics
    /// If there are not as many angles as directions and cells.
    pub fn sky_of(&self, angles: &[f32], measure: SkyMeasure) -> Result<SkyValues, Error> {
        let mut sky = FieldSky::new(self.sweep.field, self.directions, measure)?;
        let planes = angles.chunks_exact(self.sweep.field.heights().len());
        planes
            .enumerate()
            .for_each(|(index, plane)| sky.add(index, plane));
        Ok(sky.finish())
    }
}

impl Job for FieldHorizonJob<'_> {
    type Found = Vec<f32>;
    type Number = f32;

    const NAME: &'static str = "field-horizon/2";

    fn size(&self) -> Size {
        let cells = self.sweep.field.heights().len();
        Size::each(self.directions.len(), cells as u64, cells)
    }

    fn identify(&self, key: &mut Key) {
        let Sweep { field, rise, drop } = self.sweep;
        let options = (field.size(), field.transform(), rise, drop, self.directions);
        key.text(&format!("{options:?}"));
        key.numbers(field.heights());
    }

    fn answers(&self, _: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        let mut all = Vec::new();
        let (first, count) = (items.start, items.len());
        for index in items {
            let plane = self.plane(index, &Share(monitor, [index - first, count]))?;
            crate::memory::grow(&mut all, "horizons", plane.len())?;
            all.extend(plane);
        }
        Ok(all)
    }

    fn found(&self, angles: Vec<f32>) -> Result<Vec<f32>, Error> {
        Ok(angles)
    }
}
