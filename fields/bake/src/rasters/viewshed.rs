//! Viewsheds of height fields: the cells that observers see, exactly and without rays.

use std::ops::Range;

use antumbra::Bvh;
use rayon::prelude::*;

use crate::jobs::job::in_pieces;
use crate::rasters::height_field::{HeightField, Observer, Side};
use crate::rasters::sweep::{Limits, SECTORS, Sector};
use crate::vector::dot;
use crate::{Answers, BitMatrix, Error, Job, Key, Monitor, Numbers, Size, memory};

/// Job of [`Viewsheds`]: which cells of a height field each observer sees.
///
/// A cell is seen if no part of the surface is strictly above the line from the eye to the centre of the cell, raised by the height
/// of targets. [`HeightField`] says what the surface is. A line may touch the surface: slopes of lines that differ by less than 1e-12
/// count as equal. Cells without data are not seen. An observer sees its own cell, and nothing if its eye is below the surface.
///
/// All is computed in double precision. Bits are the same for any number of threads and shares.
#[derive(Clone, Debug)]
pub struct ViewshedJob<'a> {
    /// Surface with the cells that observers look at.
    pub field: &'a HeightField<'a>,
    /// Who looks.
    pub observers: &'a [Observer],
    /// Height of targets above the surface.
    pub target: f64,
    /// Height that places lose per squared distance, as of [`Curvature::factor`](crate::Curvature::factor); 0 on a flat earth.
    pub drop: f64,
    /// Greatest distance in plan; infinite for all cells.
    pub range: f64,
}

impl ViewshedJob<'_> {
    /// Whether the eye of an observer is below the surface.
    pub fn is_buried(&self, observer: &Observer) -> bool {
        self.field.buries(observer)
    }

    /// The cells that an observer sees, as runs: see [`encode`].
    fn runs(&self, observer: &Observer) -> Result<Vec<u8>, Error> {
        let cells = self.field.heights().len();
        let mut seen = memory::filled("cells", cells.div_ceil(64), 0)?;
        if observer.is_finite() && !self.is_buried(observer) {
            self.see_own_cell(observer, &mut seen);
            let limits = Limits {
                target: self.target,
                drop: self.drop,
                range: self.range,
            };
            let sectors: Vec<_> = Side::ALL
                .into_iter()
                .flat_map(|side| (0..SECTORS).map(move |i| (side, i)))
                .collect();
            let found: Vec<_> = sectors
                .par_iter()
                .map(|&(side, index)| {
                    Sector::new(self.field, observer, limits, side, index).sweep()
                })
                .collect();
            for (&(side, _), parts) in sectors.iter().zip(found) {
                let view = self.field.view(side, observer.place);
                for (line, range) in parts {
                    for at in range {
                        let cell = view.cell(line as usize, at as usize);
                        seen[cell / 64] |= 1 << (cell % 64);
                    }
                }
            }
            self.hide_behind_normal(observer, &mut seen);
        }
        encode(cells, &seen)
    }

    /// Marks the cell that the observer is exactly above.
    fn see_own_cell(&self, observer: &Observer, seen: &mut [u64]) {
        let [width, height] = self.field.size();
        let [column, row] = observer.place;
        let is_centre = column.fract() == 0.0 && row.fract() == 0.0;
        let is_inside =
            (0.0..width as f64).contains(&column) && (0.0..height as f64).contains(&row);
        if is_centre && is_inside {
            let cell = row as usize * width + column as usize;
            if self.field.heights()[cell].is_finite() {
                seen[cell / 64] |= 1 << (cell % 64);
            }
        }
    }

    /// Removes cells that are behind the surface of an observer.
    fn hide_behind_normal(&self, observer: &Observer, seen: &mut [u64]) {
        if observer.normal == [0.0; 3] {
            return;
        }
        let [width, _] = self.field.size();
        for (index, word) in seen.iter_mut().enumerate() {
            let seen = *word;
            for bit in (0..64).filter(|bit| seen >> bit & 1 != 0) {
                let cell = 64 * index + bit;
                let at = [cell % width, cell / width].map(|at| at as f64);
                let [x, y] = observer.place;
                let [east, north] = self.field.along([at[0] - x, at[1] - y]);
                let drop = self.drop * (east * east + north * north);
                let up = self.field.heights()[cell] + self.target - drop - observer.height;
                let apart = [east, north, up];
                if apart != [0.0; 3] && dot(observer.normal, apart) <= 0.0 {
                    *word &= !(1 << bit);
                }
            }
        }
    }
}

impl Job for ViewshedJob<'_> {
    type Found = Viewsheds;
    type Number = u8;

    const NAME: &'static str = "viewshed/1";

    fn size(&self) -> Size {
        Size {
            items: self.observers.len(),
            rays: self.field.heights().len() as u64,
            // Runs of cells; an observer that sees nothing has the fewest.
            numbers: Numbers::AtLeast(8),
        }
    }

    fn identify(&self, key: &mut Key) {
        let options = (
            self.field.size(),
            self.field.transform(),
            self.target,
            self.drop,
            self.range,
        );
        key.text(&format!("{options:?}"));
        key.text(&format!("{:?}", self.observers));
        key.numbers(self.field.heights());
    }

    fn answers(&self, _: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        in_pieces(items, 1, monitor, |item| {
            self.runs(&self.observers[item.start])
        })
    }

    fn found(&self, bytes: Vec<u8>) -> Result<Viewsheds, Error> {
        let cells = self.field.heights().len();
        let mut observers = memory::room("viewsheds", self.observers.len())?;
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            let length = decode(cells, rest).try_fold(0, |_, run| run.map(|(_, end)| end));
            let length = length.ok_or(Error::Answers)?;
            observers.push(rest[..length].to_vec());
            rest = &rest[length..];
        }
        match observers.len() == self.observers.len() {
            true => Ok(Viewsheds { cells, observers }),
            false => Err(Error::Answers),
        }
    }
}

/// The cells that each observer sees.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Viewsheds {
    cells: usize,
    /// Runs of cells, see [`encode`].
    observers: Vec<Vec<u8>>,
}

impl Viewsheds {
    /// Number of observers.
    pub fn observers(&self) -> usize {
        self.observers.len()
    }

    /// Cells that an observer sees, as ranges in ascending order.
    ///
    /// # Panics
    /// If there is no such observer.
    pub fn seen(&self, observer: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut at = 0;
        let runs = decode(self.cells, &self.observers[observer]).flatten();
        runs.enumerate().filter_map(move |(index, (length, _))| {
            let from = at;
            at += length;
            (index % 2 == 1 && length > 0).then_some(from..at)
        })
    }

    /// Number of observers that see each cell.
    pub fn counts(&self) -> Vec<u32> {
        let mut counts = vec![0; self.cells];
        for observer in 0..self.observers() {
            for run in self.seen(observer) {
                counts[run].iter_mut().for_each(|count| *count += 1);
            }
        }
        counts
    }

    /// Matrix of some cells by observers.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if there is no memory for it.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn matrix(&self, cells: &[u32]) -> Result<BitMatrix, Error> {
        let mut rows = vec![u32::MAX; self.cells];
        for (row, &cell) in (0..).zip(cells) {
            rows[cell as usize] = row;
        }
        let mut matrix = BitMatrix::new(cells.len(), self.observers())?;
        for observer in 0..self.observers() {
            for &row in self.seen(observer).flat_map(|run| &rows[run]) {
                if row != u32::MAX {
                    matrix.set(row as usize, observer, true);
                }
            }
        }
        Ok(matrix)
    }
}

/// Lengths of runs of cells that are not seen and seen, one after the other, as numbers of 7 bits a byte. They begin with a run that
/// is not seen, and add up to the number of cells.
fn encode(cells: usize, seen: &[u64]) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    let (mut at, mut is_seen) = (0, false);
    while at < cells {
        let from = at;
        // The next cell that is otherwise: whole words at a time.
        while at < cells {
            let word = if is_seen {
                !seen[at / 64]
            } else {
                seen[at / 64]
            } >> (at % 64);
            if word != 0 {
                at += word.trailing_zeros() as usize;
                break;
            }
            at = (at / 64 + 1) * 64;
        }
        at = at.min(cells);
        let mut length = at - from;
        memory::grow(&mut bytes, "bytes of viewsheds", 10)?;
        while length >= 128 {
            bytes.push((length % 128) as u8 | 128);
            length /= 128;
        }
        bytes.push(length as u8);
        is_seen = !is_seen;
    }
    Ok(bytes)
}

/// Runs of one observer: lengths, and the bytes up to the end of each. `None` where bytes are no runs of so many cells.
fn decode(cells: usize, bytes: &[u8]) -> impl Iterator<Item = Option<(usize, usize)>> + '_ {
    let (mut left, mut at) = (cells, 0);
    std::iter::from_fn(move || {
        if left == 0 {
            return None;
        }
        let (mut length, mut shift) = (0usize, 0);
        let found = loop {
            let Some(&byte) = bytes.get(at).filter(|_| shift < 35) else {
                break None;
            };
            at += 1;
            length |= usize::from(byte & 127) << shift;
            shift += 7;
            if byte < 128 {
                break (length <= left).then_some((length, at));
            }
        };
        left = found.map_or(0, |_| left - length);
        Some(found)
    })
}
