//! Height fields: what the cells of a raster of heights see.

use antumbra_terrain::angles::slope;
use antumbra_terrain::{
    Direction, Error, FieldSky, HeightField as Field, Lattice, Limits, March, Shadows, SkyMeasure,
    Sweep, Viewer, degrees,
};
use rayon::prelude::*;

use crate::arrays::{Answers, Handle, Items, Slot};
use crate::interface::{frees, functions};
use crate::status::{Failure, Outcome, Status, if_no_memory};
use crate::threads::Place;

/// Places for answers.
type Places<'a, T> = Outcome<Answers<'a, T>>;

/// Heights with the places of their cells, `antumbra_height_field`.
pub struct HeightField {
    heights: Vec<f64>,
    size: [usize; 2],
    transform: [f64; 6],
}

impl HeightField {
    /// The field, as the crate that answers has it.
    fn field(&self) -> Outcome<Field<'_>> {
        let field = Field::new(self.size, &self.heights, self.transform);
        Ok(field?)
    }

    /// Places for answers, so many for each cell.
    ///
    /// # Safety
    /// As [`Answers::new`].
    unsafe fn answers<T: Copy>(&self, to: *mut T, times: usize, name: &str) -> Places<'_, T> {
        let count = self.heights.len().saturating_mul(times);
        // SAFETY: the caller's promise.
        unsafe { Answers::new(to, count, 0, name) }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match &error {
            Error::Length { .. } | Error::Range { .. } => Status::InvalidArgument,
            Error::NoMemory { .. } => Status::NoMemory,
            _ => Status::Internal,
        };
        Self::new(status, error)
    }
}

functions! {
    /// Makes a height field of rows * columns heights, row by row, which are copied. NAN is no data. `transform` has 6 numbers in
    /// the order of GDAL, and says where corners of cells are on the map: x = t[0] + column * t[1] + row * t[2], y = t[3] + column *
    /// t[4] + row * t[5]. NULL stands for cells of 1 in rows from north to south.
    ///
    /// Errors: INVALID_ARGUMENT if there are no cells, they have no size, or a height is infinite; NO_MEMORY.
    fn antumbra_height_field_new(
        heights: *const f64, rows: usize, columns: usize, stride: usize, transform: *const f64, field: Handle<HeightField>,
    ) {
        let cells = rows.saturating_mul(columns);
        // SAFETY: the header says what is at these addresses.
        let (heights, transform) = unsafe {
            let count = if transform.is_null() { 0 } else { 6 };
            (Items::new(heights, cells, stride, "heights")?, Items::new(transform, count, 0, "transform")?)
        };
        if_no_memory(cells, size_of::<f64>(), "heights")?;
        let mut all = [0.0, 1.0, 0.0, 0.0, 0.0, -1.0];
        all.iter_mut().zip(transform.iter()).for_each(|(own, given)| *own = given);
        let made = HeightField { heights: heights.to_vec(), size: [columns, rows], transform: all };
        made.field()?;
        field.give(made);
        Ok(())
    }

    /// Writes the azimuths of a lattice of so many, 8, 16, 32, 48, 80, 96, 144, 176 or 224: degrees from the north of the map (y)
    /// through east. They are steps between cells, and not evenly spread.
    fn antumbra_height_field_lattice(field: &HeightField, count: usize, azimuths: *mut f64) {
        let lattice = Lattice::new(&field.field()?, count)?;
        // SAFETY: the header says what is at this address.
        let answers = unsafe { Answers::new(azimuths, count, 0, "azimuths") }?;
        (0..count).for_each(|index| answers.set(index, lattice.azimuths[index]));
        Ok(())
    }

    /// Writes how high the horizon of each cell is in an azimuth, in degrees: -90 where no surface is ahead, NAN without data. Eyes
    /// are `rise` above their cells, and places d away lie `drop` * d * d lower; 0 for a flat earth. Azimuths of the lattices of 8
    /// and 16 take the least time.
    fn antumbra_height_field_horizons(
        field: &HeightField, azimuth: f64, rise: f64, drop: f64, threads: Place<'_>, angles: *mut f32,
    ) {
        // SAFETY: the header says what is at this address.
        let answers = unsafe { field.answers(angles, 1, "angles") }?;
        let field = &field.field()?;
        let found = threads.run(|| match Direction::new(field, azimuth) {
            Direction::Step(step) => Sweep { field, rise, drop }.horizons(step, degrees, &()),
            Direction::Azimuth(azimuth) => March::new(field, rise, drop)?.horizons(azimuth, degrees, &()),
        });
        let found = found?.into_iter();
        found.enumerate().for_each(|(cell, angle)| answers.set(cell, angle));
        Ok(())
    }

    /// Writes how open the sky is over each cell, summed over the horizons in the azimuths of a lattice of so many; NAN without data.
    /// Eyes are `rise` above their cells. `measure` is ANTUMBRA_SKY_VIEW, ANTUMBRA_SKY_OPEN or ANTUMBRA_SKY_OPENNESS. The sky ends at the
    /// horizontal, so nothing beyond the border of the field hides it.
    fn antumbra_height_field_sky(
        field: &HeightField, count: usize, measure: u32, rise: f64, threads: Place<'_>, values: *mut f32,
    ) {
        // SAFETY: the header says what is at this address.
        let answers = unsafe { field.answers(values, 1, "values") }?;
        let measure = match measure {
            0 => SkyMeasure::View,
            1 => SkyMeasure::Open,
            2 => SkyMeasure::Openness,
            other => return Err(Failure::argument(format_args!("`measure` is {other}, and at most 2"))),
        };
        let (field, drop) = (&field.field()?, 0.0);
        let steps = Lattice::new(field, count)?.steps;
        let directions: Vec<Direction> = steps.iter().copied().map(Direction::Step).collect();
        let found = threads.run(|| {
            let mut sky = FieldSky::new(field, &directions, measure)?;
            for (index, &step) in steps.iter().enumerate() {
                sky.add(index, &Sweep { field, rise, drop }.horizons(step, degrees, &())?);
            }
            Ok::<_, Error>(sky.finish().values)
        });
        let found = found?.into_iter();
        found.enumerate().for_each(|(cell, value)| answers.set(cell, value));
        Ok(())
    }

    /// Writes which cells see lights far away: bytes 1 or 0, for each light all cells. A light is 2 doubles, its azimuth and its
    /// elevation above the horizon in degrees, from -90 to 90. A light exactly on the horizon of a cell is hidden, and cells without
    /// data have 0.
    fn antumbra_height_field_lit(
        field: &HeightField, lights: *const f64, count: usize, stride: usize, rise: f64, threads: Place<'_>, lit: *mut u8,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (lights, answers) = unsafe {
            (Items::<[f64; 2]>::new(lights.cast(), count, stride, "lights")?, field.answers(lit, count, "lit")?)
        };
        let ([columns, rows], field) = (field.size, field.field()?);
        let shadows = Shadows::new(&field, rise)?;
        threads.run(|| {
            (0..count).into_par_iter().try_for_each(|light| {
                let [azimuth, elevation] = lights.get(light);
                let plane = shadows.lit(azimuth, slope(elevation))?;
                for cell in 0..rows * columns {
                    let (row, column) = (cell / columns, cell % columns);
                    let word = plane[row * columns.div_ceil(64) + column / 64];
                    answers.set(light * rows * columns + cell, (word >> (column % 64) & 1) as u8);
                }
                Ok::<(), Error>(())
            })
        })?;
        Ok(())
    }

    /// Returns the height of the surface at x, y of the map; NAN beside it.
    fn antumbra_height_field_height(field: &HeightField, x: f64, y: f64, height: Slot<f64>) {
        let observer = field.field()?.observer([x, y, f64::NAN]);
        height.put(observer.map_or(f64::NAN, |observer| observer.height));
        Ok(())
    }

    /// Writes which cells an eye at x, y, z sees, 3 doubles on the map: bytes 1 or 0. A cell is seen if no part of the surface is above
    /// the line to its centre, raised by `target`, and it is at most `radius` away in plan, which may be INFINITY. An eye whose z is
    /// NAN is on the surface, and one below it sees nothing. `drop` is as for antumbra_height_field_horizons().
    fn antumbra_height_field_viewshed(
        field: &HeightField, eye: *const f64, target: f64, radius: f64, drop: f64, threads: Place<'_>, seen: *mut u8,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (eye, answers) = unsafe {
            (Items::<[f64; 3]>::new(eye.cast(), 1, 0, "eye")?, field.answers(seen, 1, "seen")?)
        };
        let (eye, field) = (eye.get(0), field.field()?);
        let off = || Failure::argument("`eye` is beside the surface, and its z is NAN");
        let (observer, limits) = (field.observer(eye).ok_or_else(off)?, Limits { target, drop, range: radius });
        let words = threads.run(|| Viewer::new(&field)?.sees(&observer, &limits))?;
        let seen = |cell: usize| (words[cell / 64] >> (cell % 64) & 1) as u8;
        (0..field.heights().len()).for_each(|cell| answers.set(cell, seen(cell)));
        Ok(())
    }
}

frees! {
    /// Frees a height field.
    fn antumbra_height_field_free(field: HeightField);
}
