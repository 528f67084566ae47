//! Azimuths whose lines pass through cells only at whole steps, so that a sweep can answer all cells of a line.

use crate::{Error, HeightField};

/// Largest step in columns or rows.
const MOST: i32 = 9;

/// Azimuths of steps between cells: from a cell so many columns and rows to the next one of its line. The numbers of a step have no
/// common divisor.
///
/// Steps of at most 1, 2, 3, ... columns and rows are 8, 16, 32, 48, 80, ... azimuths. They are not evenly spread: see
/// [`Lattice::weights`].
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    /// Columns and rows of each step, in the order of azimuths.
    pub steps: Vec<[i32; 2]>,
    /// Degrees from the north of the map (`y`) through east, from 0 on.
    pub azimuths: Vec<f64>,
}

impl Lattice {
    /// The lattice of so many azimuths.
    ///
    /// # Errors
    /// [`Error::Range`] if there is no such lattice: the smallest ones have 8, 16, 32, 48 and 80 azimuths.
    ///
    /// ```
    /// use antumbra_terrain::{HeightField, Lattice};
    ///
    /// let field = HeightField::new([2, 2], &[0.0; 4], [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
    /// let lattice = Lattice::new(&field, 8)?;
    /// assert_eq!(lattice.steps[..2], [[0, -1], [1, -1]], "rows run south");
    /// assert_eq!(lattice.azimuths[..2], [0.0, 45.0]);
    /// # Ok::<(), antumbra_terrain::Error>(())
    /// ```
    pub fn new(field: &HeightField<'_>, azimuths: usize) -> Result<Self, Error> {
        let of = |most: i32| {
            let steps = (-most..=most).flat_map(move |q| (-most..=most).map(move |p| [q, p]));
            steps.filter(|&[q, p]| divisor(q, p) == 1)
        };
        let most = (1..=MOST).find(|&most| of(most).count() == azimuths);
        let wanted = "8, 16, 32, 48, 80, 96, 144, 176 or 224";
        let found = azimuths as f64;
        Error::check_range("azimuths of a lattice", found, most.is_some(), wanted)?;
        let azimuth = |[q, p]: [i32; 2]| {
            let [east, north] = field.along([f64::from(q), f64::from(p)]);
            // Exact on the axes and the diagonals.
            let degrees = libm::atan2(east, north).to_degrees();
            if degrees < 0.0 {
                degrees + 360.0
            } else {
                degrees
            }
        };
        let mut all: Vec<_> = of(most.unwrap_or(1))
            .map(|step| (azimuth(step), step))
            .collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (azimuths, steps) = all.into_iter().unzip();
        Ok(Self { steps, azimuths })
    }

    /// Part of the circle that each azimuth stands for: see [`weights`].
    pub fn weights(&self) -> Vec<f64> {
        weights(&self.azimuths)
    }
}

/// Part of the circle that each of some azimuths in degrees stands for, in any order: half of the way to both neighbours. The sum is 1.
///
/// ```
/// assert_eq!(antumbra_terrain::weights(&[0.0, 270.0, 90.0]), [0.25, 0.375, 0.375]);
/// ```
pub fn weights(azimuths: &[f64]) -> Vec<f64> {
    let turned = |index: usize| azimuths[index].rem_euclid(360.0);
    let mut order: Vec<usize> = (0..azimuths.len()).collect();
    order.sort_by(|&a, &b| turned(a).total_cmp(&turned(b)));
    let mut weights = vec![0.0; azimuths.len()];
    for (place, &index) in order.iter().enumerate() {
        let next = order[(place + 1) % order.len()];
        let gap = match (turned(next) - turned(index)).rem_euclid(360.0) {
            // The only one has the whole circle.
            _ if order.len() == 1 => 360.0,
            gap => gap,
        };
        weights[index] += gap / 720.0;
        weights[next] += gap / 720.0;
    }
    weights
}

/// A direction in which horizons are wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Direction {
    /// A step of a [`Lattice`], for [`Sweep`](crate::Sweep).
    Step([i32; 2]),
    /// Degrees from the north of the map (`y`) through east, for [`March`](crate::March).
    Azimuth(f64),
}

impl Direction {
    /// The direction of an azimuth: a step where it is exactly one of at most two columns and rows, since sweeps are faster.
    pub fn new(field: &HeightField<'_>, azimuth: f64) -> Self {
        let lattice = Lattice::new(field, 16).ok();
        let step = lattice.and_then(|Lattice { steps, azimuths }| {
            let index = azimuths
                .iter()
                .position(|&own| own == azimuth.rem_euclid(360.0))?;
            steps.get(index).copied()
        });
        step.map_or(Self::Azimuth(azimuth), Self::Step)
    }
}

/// Greatest common divisor, which is 0 for two zeros.
pub(crate) fn divisor(a: i32, b: i32) -> i32 {
    match b {
        0 => a.abs(),
        _ => divisor(b, a % b),
    }
}
