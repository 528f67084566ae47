//! Viewsheds of height fields as a job, and runs of cells that keep them small.

use std::ops::Range;

use antumbra::Bvh;
use antumbra_terrain::{HeightField, Limits, Observer, Share, Viewer, memory};

use crate::jobs::job::in_pieces;
use crate::{Answers, BitMatrix, Error, Job, Key, Monitor, Numbers, Size};

/// Job of [`Viewsheds`]: which cells of a height field each observer sees, as [`Viewer`] says.
pub struct ViewshedJob<'a> {
    viewer: Viewer<'a>,
    observers: &'a [Observer],
    limits: Limits,
}

impl<'a> ViewshedJob<'a> {
    /// The job of these observers.
    ///
    /// # Errors
    /// [`Error::NoMemory`].
    pub fn new(
        field: &'a HeightField<'a>,
        observers: &'a [Observer],
        limits: Limits,
    ) -> Result<Self, Error> {
        Ok(Self {
            viewer: Viewer::new(field)?,
            observers,
            limits,
        })
    }

    /// Number of cells.
    fn cells(&self) -> usize {
        self.viewer.field().heights().len()
    }

    /// Least [elevation](Viewer::elevation) in degrees of all lines from observers to the targets that they see, for each cell; NaN where
    /// none of them sees the cell. `found` are the viewsheds of this job.
    pub fn elevations(&self, found: &Viewsheds) -> Vec<f32> {
        let mut least = vec![f32::NAN; self.cells()];
        for (index, observer) in self.observers.iter().enumerate() {
            for cell in found.seen(index).flatten() {
                let elevation = self.viewer.elevation(observer, &self.limits, cell);
                least[cell] = least[cell].min(elevation);
            }
        }
        least
    }
}

impl Job for ViewshedJob<'_> {
    type Found = Viewsheds;
    type Number = u8;

    const NAME: &'static str = "viewshed/1";

    fn size(&self) -> Size {
        Size {
            items: self.observers.len(),
            rays: self.cells() as u64,
            // Runs of cells; an observer that sees nothing has the fewest.
            numbers: Numbers::AtLeast(8),
        }
    }

    fn identify(&self, key: &mut Key) {
        let (field, limits) = (self.viewer.field(), &self.limits);
        let (target, drop, range) = (limits.target, limits.drop, limits.range);
        let options = (field.size(), field.transform(), target, drop, range);
        key.text(&format!("{options:?}"));
        key.text(&format!("{:?}", self.observers));
        key.numbers(field.heights());
    }

    fn answers(&self, _: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        in_pieces(items, 1, monitor, |item| {
            let seen = self
                .viewer
                .sees(&self.observers[item.start], &self.limits)?;
            encode(self.cells(), &seen)
        })
    }

    fn found(&self, bytes: Vec<u8>) -> Result<Viewsheds, Error> {
        let cells = self.cells();
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

/// Groups of observers that [`TargetHeightJob`] answers together.
const GROUPS: usize = 16;

/// Job of the least height above ground from which one of the observers sees each cell, as [`Viewer::target_heights`] says.
///
/// Its items are at most 16 groups of observers, because the answers of an item are as many as cells, and are kept.
pub struct TargetHeightJob<'a>(pub ViewshedJob<'a>);

impl TargetHeightJob<'_> {
    /// Heights of all cells, in 4 bytes a cell. The job itself takes 8 more for each group.
    ///
    /// # Errors
    /// [`Error::NoMemory`], [`Error::Cancelled`].
    pub fn heights(&self, monitor: &dyn Monitor) -> Result<Vec<f32>, Error> {
        self.of(self.0.observers, monitor)
    }

    fn of(&self, observers: &[Observer], monitor: &dyn Monitor) -> Result<Vec<f32>, Error> {
        let ViewshedJob { viewer, limits, .. } = &self.0;
        Ok(viewer.target_heights(observers, limits, monitor)?)
    }

    fn groups(&self) -> std::slice::Chunks<'_, Observer> {
        let observers = self.0.observers;
        observers.chunks(observers.len().div_ceil(GROUPS).max(1))
    }
}

impl Job for TargetHeightJob<'_> {
    type Found = Vec<f32>;
    type Number = f32;

    const NAME: &'static str = "target-height/1";

    fn size(&self) -> Size {
        let cells = self.0.cells();
        Size::each(self.groups().len(), cells as u64, cells)
    }

    fn identify(&self, key: &mut Key) {
        self.0.identify(key);
    }

    fn answers(&self, _: &Bvh, items: Range<usize>, monitor: &dyn Monitor) -> Answers<Self> {
        let mut all = Vec::new();
        let groups = self.groups().skip(items.start).take(items.len());
        for (index, group) in groups.enumerate() {
            let heights = self.of(group, &Share(monitor, [index, items.len()]))?;
            memory::grow(&mut all, "heights", heights.len())?;
            all.extend(heights);
        }
        Ok(all)
    }

    fn found(&self, numbers: Vec<f32>) -> Result<Vec<f32>, Error> {
        let mut least = self.of(&[], &())?;
        for heights in numbers.chunks_exact(least.len()) {
            let pairs = least.iter_mut().zip(heights);
            pairs.for_each(|(least, height)| *least = least.min(*height));
        }
        Ok(least)
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

    /// Number of pairs of a cell and an observer that sees it.
    pub fn count(&self) -> u64 {
        let runs = (0..self.observers()).flat_map(|observer| self.seen(observer));
        runs.map(|run| run.len() as u64).sum()
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
