//! Values of sensors step by step.

use crate::sun::sunlight::{facing, to_suns};
use crate::vector::dot;
use crate::{BitMatrix, Error, Moment, Sunlight, perez_sky};

/// What a sensor receives in a step of time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Receipt {
    /// Hours of direct sun.
    pub hours: f64,
    /// Irradiation by the sun in Wh/m².
    pub direct: f64,
    /// Irradiation by the sky in Wh/m².
    pub diffuse: f64,
}

/// Steps of time, with what [`Receipt`]s are computed from.
pub struct Hourly<'a> {
    sunlight: &'a Sunlight,
    /// For each step, its sun if one is above the horizon, and the radiances of the sky if there are any.
    steps: Vec<(Option<usize>, Vec<f64>)>,
    to_suns: Vec<[f64; 3]>,
}

impl<'a> Hourly<'a> {
    /// Steps of a period. Skies that are known are computed once here.
    ///
    /// # Errors
    /// [`Error::Range`] if a measured sky is out of its range.
    pub fn new(sunlight: &'a Sunlight) -> Result<Self, Error> {
        let mut suns = 0;
        let mut steps = Vec::new();
        for (step, sun) in sunlight.timeline() {
            let number = sunlight
                .suns
                .times
                .get(suns)
                .filter(|&&time| time == step.middle);
            let number = number.map(|_| suns);
            suns += usize::from(number.is_some());
            let sky = match sunlight.is_measured() && step.irradiance.diffuse_horizontal > 0.0 {
                true => {
                    let day = step.begin.day_of_year();
                    perez_sky(&sunlight.patches, sun, day, &step.irradiance)?
                }
                false => Vec::new(),
            };
            steps.push((number, sky));
        }
        Ok(Self {
            sunlight,
            steps,
            to_suns: to_suns(&sunlight.suns),
        })
    }

    /// Number of steps.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether there is no step.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Beginning of a step on local clocks.
    pub fn begin(&self, step: usize) -> Moment {
        self.sunlight.timeline()[step].0.begin
    }

    /// Number of the sun of a step among the [suns](Sunlight::suns); `None` if none is above the horizon.
    pub fn sun(&self, step: usize) -> Option<usize> {
        self.steps[step].0
    }

    /// Beginning of a step in Unix time.
    pub fn unix(&self, step: usize) -> f64 {
        let step = &self.sunlight.timeline()[step].0;
        step.middle - 1800.0 * step.hours
    }

    /// What a sensor receives in a step: a row of the matrices of what sensors see, and its normal in the scene, or none in free
    /// space. `None` if the normal has no direction. Sums over all steps are the [`SunValues`](crate::SunValues).
    pub fn receipt(
        &self,
        step: usize,
        (suns_seen, sky_seen, row): (&BitMatrix, &BitMatrix, usize),
        normal: Option<[f32; 3]>,
    ) -> Option<Receipt> {
        let normal = facing(normal, &self.sunlight.orientation)?;
        let (sun, sky) = &self.steps[step];
        let mut receipt = Receipt::default();
        if let Some(sun) = *sun
            && suns_seen.get(row, sun)
        {
            receipt.hours = self.sunlight.suns.hours[sun];
            let cosine = dot(normal, self.to_suns[sun]).max(0.0);
            receipt.direct = self.sunlight.suns.direct[sun] * cosine;
        }
        if !sky.is_empty() {
            let hours = self.sunlight.timeline()[step].0.hours;
            let light = (self.sunlight.patches).irradiance(normal, sky, sky_seen.row(row));
            receipt.diffuse = hours * light;
        }
        Some(receipt)
    }
}
