//! How much of the sky the cells of height fields see, by their horizons.

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};
use rayon::prelude::*;

use crate::angles::sin_cos_degrees;
use crate::{Direction, Error, HeightField, degrees, memory, weights};

/// What of the sky [`FieldSky`] measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SkyMeasure {
    /// Part of the light of an even sky that the surface of the cell receives: 1 for level ground without a horizon, and
    /// `(1 + cos s) / 2` for a slope `s` without one (Dozier and Frew 1990, equation 7b).
    View,
    /// Part of the hemisphere above that is neither behind the horizon nor behind the surface of the cell, by solid angle.
    Open,
    /// Degrees from the zenith down to the horizon, on average over azimuths: more than 90 on peaks ("positive openness": Yokoyama,
    /// Shirasawa and Pike 2002). The surface of the cell counts only as far as it is a horizon.
    Openness,
}

/// A measure of the sky that each cell of a height field sees, summed over its horizons.
///
/// The sky ends at the horizontal. So a direction without any surface ahead, such as at the border, has its horizon at 0 degrees, and
/// only the openness counts horizons below that.
///
/// The memory is 20 bytes for each cell.
pub struct FieldSky<'a> {
    field: &'a HeightField<'a>,
    measure: SkyMeasure,
    ways: Vec<Way>,
    sums: Vec<f64>,
    /// Sums of some of the directions, which stand for all.
    fewer: Vec<f32>,
    /// Rise of the surface to the east and to the north; NaN for cells without a triangle, of which only the openness is known.
    rises: Vec<[f32; 2]>,
}

/// A direction, and the part of the circle that it stands for: among all, and among fewer.
#[derive(Clone, Copy, Debug)]
struct Way {
    east: f64,
    north: f64,
    weight: f64,
    fewer: f32,
}

/// Values of all cells, row by row, and how far they are from values of fewer directions.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyValues {
    /// The measure; NaN for cells without data, and where it is not known.
    pub values: Vec<f32>,
    /// Mean and greatest difference from the values of the next coarser lattice, or of every second azimuth. They estimate mean and
    /// greatest error, but a single cell may be off by more than it differs. `None` if there are too few directions.
    pub quadrature_error: Option<[f64; 2]>,
}

impl<'a> FieldSky<'a> {
    /// A measure of a field by its horizons in these directions.
    ///
    /// # Errors
    /// [`Error::NoMemory`], or [`Error::Range`] if there is no direction.
    pub fn new(
        field: &'a HeightField<'a>,
        directions: &[Direction],
        measure: SkyMeasure,
    ) -> Result<Self, Error> {
        let count = directions.len();
        let wanted = "at least 1";
        Error::check_range("directions", count as f64, count > 0, wanted)?;
        let [width, height] = field.size();
        let mut rises = memory::room("slopes", width * height)?;
        let rise = |cell: usize| match field.normal([cell % width, cell / width]) {
            Some([x, y, z]) => [-x / z, -y / z].map(|rise| rise as f32),
            None => [f32::NAN; 2],
        };
        (0..width * height)
            .into_par_iter()
            .map(rise)
            .collect_into_vec(&mut rises);
        Ok(Self {
            field,
            measure,
            ways: ways(field, directions),
            sums: memory::filled("sums", width * height, 0.0)?,
            fewer: memory::filled("sums", width * height, 0.0)?,
            rises,
        })
    }

    /// Bytes that a measure takes, with the horizons of a direction.
    pub fn memory(field: &HeightField<'_>) -> u64 {
        let bytes = size_of::<f64>() + 2 * size_of::<f32>() + size_of::<[f32; 2]>();
        (field.heights().len() * bytes) as u64
    }

    /// Adds the horizons of all cells in the direction of this number, such as
    /// [`Sweep::horizons`](crate::Sweep::horizons) makes of [`degrees`]. Each direction is added once, and their order decides the last bits.
    ///
    /// # Panics
    /// If there is no such direction, or the horizons are not as many as cells.
    pub fn add(&mut self, index: usize, horizons: &[f32]) {
        assert_eq!(horizons.len(), self.sums.len(), "a horizon for each cell");
        /// Cells at a time.
        const CELLS: usize = 1 << 14;
        let sums = self.sums.par_chunks_mut(CELLS);
        let sums = sums.zip(self.fewer.par_chunks_mut(CELLS));
        let cells = horizons.par_chunks(CELLS).zip(self.rises.par_chunks(CELLS));
        let (way, measure) = (self.ways[index], self.measure);
        sums.zip(cells).for_each(|(sums, cells)| {
            let part = Part {
                measure,
                way,
                sums,
                cells,
            };
            Isa::best().dispatch(part);
        });
    }

    /// The values, once all directions were added.
    pub fn finish(self) -> SkyValues {
        let is_view = self.measure == SkyMeasure::View;
        let factor = |[east, north]: [f32; 2]| match is_view {
            true => 1.0 / f64::from(1.0 + east * east + north * north).sqrt(),
            false => 1.0,
        };
        let mut values = Vec::new();
        self.sums
            .par_iter()
            .zip(&self.rises)
            .map(|(sum, &rise)| (factor(rise) * sum) as f32)
            .collect_into_vec(&mut values);
        let heights = self.field.heights();
        let (mut sum, mut most, mut count) = (0.0, 0.0_f64, 0_u64);
        for (cell, value) in values.iter_mut().enumerate() {
            if heights[cell].is_nan() {
                *value = f32::NAN;
            }
            let fewer = factor(self.rises[cell]) * f64::from(self.fewer[cell]);
            let apart = (f64::from(*value) - fewer).abs();
            if !apart.is_nan() {
                (sum, most, count) = (sum + apart, most.max(apart), count + 1);
            }
        }
        let is_known = count > 0 && self.ways.iter().any(|way| way.fewer == 0.0);
        let quadrature_error = is_known.then(|| [sum / count as f64, most]);
        SkyValues {
            values,
            quadrature_error,
        }
    }
}

/// Sums of some cells, and their horizons and rises in a direction.
struct Part<'a> {
    measure: SkyMeasure,
    way: Way,
    sums: (&'a mut [f64], &'a mut [f32]),
    cells: (&'a [f32], &'a [[f32; 2]]),
}

impl WithSimd<8> for Part<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(self, _: S) {
        match self.measure {
            SkyMeasure::View => self.add(view),
            SkyMeasure::Open => self.add(open),
            SkyMeasure::Openness => self.add(openness),
        }
    }
}

impl Part<'_> {
    /// Adds what `of` makes of the horizon in degrees, of the rise of the surface, and of the greater one of their elevations and 0 in
    /// radians.
    #[inline(always)]
    fn add(self, of: impl Fn(f32, f64, f64) -> f64) {
        /// Cells at a time, in lists of a known length, which compilers make vectors of.
        const LANES: usize = 64;
        let (way, (horizons, rises)) = (self.way, self.cells);
        let (mut high, mut plane) = ([0.0; LANES], [0.0; LANES]);
        let (mut rise, mut above, mut part) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for first in (0..horizons.len()).step_by(LANES) {
            let cells = first..(first + LANES).min(horizons.len());
            for (lane, cell) in cells.clone().enumerate() {
                let [east, north] = rises[cell];
                high[lane] = horizons[cell];
                rise[lane] = f64::from(east) * way.east + f64::from(north) * way.north;
            }
            // Each loop on its own, since none of them branches then.
            for lane in 0..LANES {
                plane[lane] = degrees(rise[lane]);
            }
            for lane in 0..LANES {
                let own = if plane[lane] > high[lane] {
                    plane[lane]
                } else {
                    high[lane]
                };
                above[lane] = f64::from(if own < 0.0 { 0.0 } else { own }).to_radians();
            }
            for lane in 0..LANES {
                part[lane] = of(high[lane], rise[lane], above[lane]);
            }
            let sums = self.sums.0[cells.clone()].iter_mut();
            let sums = sums.zip(&mut self.sums.1[cells]);
            for ((sum, fewer), part) in sums.zip(part) {
                *sum += way.weight * part;
                *fewer += way.fewer * part as f32;
            }
        }
    }
}

/// Part of [`SkyMeasure::View`] in a direction, for a normal whose vertical part is 1.
#[inline(always)]
fn view(_: f32, rise: f64, angle: f64) -> f64 {
    let [sin, cos] = sin_cos(angle);
    cos * cos - rise * (std::f64::consts::FRAC_PI_2 - angle - sin * cos)
}

/// Part of [`SkyMeasure::Open`] in a direction.
#[inline(always)]
fn open(_: f32, rise: f64, angle: f64) -> f64 {
    // Not known without a triangle, where the rise is NaN.
    1.0 - sin_cos(angle)[0] + 0.0 * rise
}

/// Part of [`SkyMeasure::Openness`] in a direction.
#[inline(always)]
fn openness(horizon: f32, _: f64, _: f64) -> f64 {
    90.0 - f64::from(if horizon == -90.0 { 0.0 } else { horizon })
}

/// Sine and cosine of an angle from 0 to 90 degrees.
#[inline(always)]
fn sin_cos(angle: f64) -> [f64; 2] {
    // Terms up to the 21st power are right to 1e-16, in vectors.
    let square = angle * angle;
    let mut series = 1.0;
    for term in (1..=10).rev() {
        let next = f64::from(2 * term * (2 * term + 1));
        series = 1.0 - square * (1.0 / next) * series;
    }
    let sin = angle * series;
    let square = 1.0 - sin * sin;
    [sin, (if square > 0.0 { square } else { 0.0 }).sqrt()]
}

/// Directions with the parts of the circle that they stand for: half of the way to both neighbours.
fn ways(field: &HeightField<'_>, directions: &[Direction]) -> Vec<Way> {
    let unit = |direction: &Direction| match *direction {
        Direction::Step(step) => {
            let [east, north] = field.along(step.map(f64::from));
            let length = libm::hypot(east, north);
            [east / length, north / length]
        }
        Direction::Azimuth(azimuth) => sin_cos_degrees(azimuth).into(),
    };
    let units: Vec<[f64; 2]> = directions.iter().map(unit).collect();
    let azimuth = |&[east, north]: &[f64; 2]| libm::atan2(east, north).to_degrees();
    let azimuths: Vec<f64> = units.iter().map(azimuth).collect();
    let kept = coarser(directions);
    let few: Vec<f64> = kept.iter().map(|&index| azimuths[index]).collect();
    let mut fewer = vec![0.0; units.len()];
    for (index, weight) in kept.into_iter().zip(weights(&few)) {
        fewer[index] = weight as f32;
    }
    let all = units.iter().zip(weights(&azimuths)).zip(fewer);
    let way = |((&[east, north], weight), fewer): ((&[f64; 2], f64), f32)| Way {
        east,
        north,
        weight,
        fewer,
    };
    all.map(way).collect()
}

/// The directions of the next coarser lattice, else every second one. All, if there are too few.
fn coarser(directions: &[Direction]) -> Vec<usize> {
    let size = |direction: &Direction| match direction {
        Direction::Step(step) => step.iter().map(|steps| steps.abs()).max(),
        Direction::Azimuth(_) => None,
    };
    let sizes: Option<Vec<i32>> = directions.iter().map(size).collect();
    let sizes = sizes.unwrap_or_default();
    let most = sizes.iter().copied().max().unwrap_or(0);
    let all = 0..directions.len();
    match most > 1 {
        true => all.filter(|&index| sizes[index] < most).collect(),
        false if all.len() >= 4 && all.len().is_multiple_of(2) => all.step_by(2).collect(),
        false => all.collect(),
    }
}
