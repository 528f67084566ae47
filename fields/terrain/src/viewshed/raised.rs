//! The heights above ground from which cells are seen.
//!
//! The horizon over a cell does not depend on what is built there. So the sweep that finds which cells are seen also knows how much the
//! others lack, if it compares all cells of a line with the horizon instead of those that may be seen.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::sector::{Note, Sector};
use super::{ALL_SECTORS, Limits, Viewer};
use crate::{Error, Monitor, Observer, Progress, memory};

impl Viewer<'_> {
    /// How far a target must be raised above the surface of each cell until one of the observers sees it, in the unit of heights and row
    /// by row: 0 where the cell itself is seen. NaN without data; infinite where no height helps, because the cell is beyond the range of
    /// all observers, or because all eyes are below the surface. `target` of the limits does not count.
    ///
    /// Of one observer, a target is [seen](Self::sees) above this height and hidden below it, and 0 is where [`Limits::default`]'s target
    /// is seen. Only targets within rounding of the height, 1e-7 of it and 1e-12 of the distance, may differ. An observer with a normal
    /// sees what is before its surface; normals that point down are not meant, since they hide what is raised.
    ///
    /// Takes 4 bytes a cell for any number of observers. Bits are the same for any number of threads and any order of observers, so
    /// that the least of several results is the result of all their observers.
    ///
    /// ```
    /// use antumbra_terrain::{HeightField, Limits, Observer, Viewer};
    ///
    /// // An eye at 2 m looks over a wall of 3 m, which is 2 m away. Each 2 m farther the line is 1 m higher.
    /// let heights = [0.0, 0.0, 3.0, 0.0, 0.0].repeat(3);
    /// let field = HeightField::new([5, 3], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
    /// let eye = Observer { place: [0.0, 1.0], height: 2.0, normal: [0.0; 3] };
    /// let raised = Viewer::new(&field)?.target_heights(&[eye], &Limits::default(), &())?;
    /// let middle: Vec<f32> = raised[5..10].iter().map(|height| (height * 1e6).round() / 1e6).collect();
    /// assert_eq!(middle, [0.0, 0.0, 0.0, 3.5, 4.0]);
    /// # Ok::<(), antumbra_terrain::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::NoMemory`], [`Error::Cancelled`].
    pub fn target_heights(
        &self,
        observers: &[Observer],
        limits: &Limits,
        monitor: &dyn Monitor,
    ) -> Result<Vec<f32>, Error> {
        let mut limits = *limits;
        limits.target = 0.0;
        let heights = self.field().heights();
        let mut least = memory::room("heights", heights.len())?;
        least.extend(heights.iter().map(|height| match height.is_nan() {
            true => AtomicU32::new(f32::NAN.to_bits()),
            false => AtomicU32::new(f32::INFINITY.to_bits()),
        }));
        let looks = |observer: &&Observer| observer.is_finite() && !self.field().buries(observer);
        let observers: Vec<&Observer> = observers.iter().filter(looks).collect();
        let sectors = observers.len() * ALL_SECTORS;
        let progress = Progress::new(monitor, sectors);
        (0..sectors).into_par_iter().try_for_each(|index| {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            let raised = Raised {
                viewer: self,
                observer: observers[index / ALL_SECTORS],
                limits: &limits,
                least: &least,
            };
            raised.sweep(index % ALL_SECTORS);
            progress.add(1);
            Ok(())
        })?;
        let least = least.into_iter().map(AtomicU32::into_inner);
        Ok(least.map(f32::from_bits).collect())
    }
}

/// The heights from which an observer sees cells, and the least ones so far: numbers from 0 on, which have the order of their bits.
struct Raised<'a> {
    viewer: &'a Viewer<'a>,
    observer: &'a Observer,
    limits: &'a Limits,
    least: &'a [AtomicU32],
}

impl Raised<'_> {
    fn sweep(self, index: usize) {
        if let Some(cell) = self.viewer.own_cell(self.observer) {
            self.note(cell, 0.0);
        }
        let sector = self.viewer.sector(self.observer, self.limits, index);
        sector.sweep(self);
    }

    /// Notes that no edge hides a cell from this height on.
    fn note(&self, cell: usize, mut height: f64) {
        let [a, b, c] = self.observer.normal;
        if [a, b, c] != [0.0; 3] {
            let [east, north, up] = self.viewer.way(self.observer, self.limits, cell);
            let before = a * east + b * north + c * (up + height);
            if before <= 0.0 && [east, north, up + height] != [0.0; 3] {
                height = match c > 0.0 {
                    true => height - before / c,
                    false => f64::INFINITY,
                };
            }
        }
        self.least[cell].fetch_min((height as f32).to_bits(), Ordering::Relaxed);
    }
}

impl Note for Raised<'_> {
    const ALL: bool = true;

    #[inline(always)]
    fn cell(&mut self, sector: &Sector<'_>, line: usize, at: usize, lacks: f64) {
        if !lacks.is_nan() {
            let ahead = line as f64 - sector.view.eye[0];
            let lacks = if lacks > 0.0 { lacks } else { 0.0 };
            let height = lacks * ahead * self.viewer.field().unit();
            self.note(sector.view.cell(line, at), height);
        }
    }
}
