//! Viewsheds of height fields: the cells that observers see, exactly and without rays.
//!
//! # Method
//!
//! The plan around an observer has four sides, and each side some sectors. A sector is swept line by line, from near to far. A
//! [horizon](crate::horizon) has all edges that the sweep has passed. A cell of a line is seen if the line of sight to it ends
//! above the horizon. So each edge is projected once, and the work grows with the number of cells.
//!
//! Sectors are the same for any number of threads, and so are all bits.

use std::ops::Range;

use antumbra::Bvh;
use rayon::prelude::*;

use crate::height_field::{HeightField, Side, View};
use crate::horizon::{Edge, Horizon, Point};
use crate::orientation::dot;
use crate::{BitMatrix, Error, Job, Key, Monitor, memory};

/// Sectors of a side.
const SECTORS: usize = 4;

/// Width by which horizons reach beyond their sectors: a cell on the edge of a sector may have all its edges on the other side.
const BEYOND: f64 = 1.0 / 256.0;

/// A target is seen if it is no lower than this below the horizon, as a slope: the surface may touch the line of sight.
const GRAZING: f64 = 1e-12;

/// An observer on a height field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Column and row, where the centre of the first cell is at 0, 0: see [`HeightField::place`].
    pub place: [f64; 2],
    /// Height of the eye.
    pub height: f64,
    /// Normal of the surface that the observer is on, in map coordinates; nothing behind it is seen. 0 for a free eye.
    pub normal: [f64; 3],
}

/// Job of [`Viewsheds`]: which cells of a height field each observer sees.
///
/// A cell is seen if no part of the surface is strictly above the line from the eye to the centre of the cell, raised by the height
/// of targets. The surface is that of [`HeightField`]. A line may touch the surface: slopes of lines that differ by less than 1e-12
/// count as equal. Cells without data are not seen. An observer sees its own cell, and nothing if its eye is below the surface.
///
/// All is computed in double precision. Bits are the same for any number of threads and shares.
#[derive(Clone, Debug)]
pub struct ViewshedJob<'a> {
    /// The surface.
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
        let surface = self.field.surface(observer.place);
        surface.is_some_and(|surface| surface - observer.height > 1e-9 * self.field.unit())
    }

    /// The cells that an observer sees, as runs: see [`encode`].
    fn runs(&self, observer: &Observer) -> Result<Vec<u8>, Error> {
        let cells = self.field.heights().len();
        let mut seen: Vec<u64> = memory::room("cells", cells.div_ceil(64))?;
        seen.resize(cells.div_ceil(64), 0);
        let is_finite = observer
            .place
            .iter()
            .chain([&observer.height])
            .all(|x| x.is_finite());
        if is_finite && !self.is_buried(observer) {
            self.see_own_cell(observer, &mut seen);
            let sectors: Vec<_> = Side::ALL
                .into_iter()
                .flat_map(|side| (0..SECTORS).map(move |i| (side, i)))
                .collect();
            let found: Vec<_> = sectors
                .par_iter()
                .map(|&(side, index)| Sector::new(self, observer, side, index).sweep())
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
        let [_, a, b, _, d, e] = self.field.transform();
        for (index, word) in seen.iter_mut().enumerate() {
            for bit in (0..64)
                .filter(|bit| *word >> bit & 1 != 0)
                .collect::<Vec<_>>()
            {
                let cell = 64 * index + bit;
                let [x, y] = [
                    (cell % width) as f64 - observer.place[0],
                    (cell / width) as f64 - observer.place[1],
                ];
                let up = self.field.heights()[cell] + self.target - observer.height;
                let apart = [a * x + b * y, d * x + e * y, up];
                if apart != [0.0; 3] && dot(observer.normal, apart) <= 0.0 {
                    *word &= !(1 << bit);
                }
            }
        }
    }
}

impl Job for ViewshedJob<'_> {
    type Found = Viewsheds;

    const NAME: &'static str = "viewshed/1";

    fn items(&self) -> usize {
        self.observers.len()
    }

    fn rays_per_item(&self) -> u64 {
        self.field.heights().len() as u64
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

    fn answers(
        &self,
        _: &Bvh,
        items: Range<usize>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<u8>, Error> {
        let total = items.len();
        let done = std::sync::atomic::AtomicUsize::new(0);
        let found: Result<Vec<Vec<u8>>, Error> = items
            .into_par_iter()
            .map(|item| {
                if monitor.cancelled() {
                    return Err(Error::Cancelled);
                }
                let runs = self.runs(&self.observers[item]);
                let before = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                monitor.progress(before + 1, total);
                runs
            })
            .collect();
        Ok(found?.concat())
    }

    fn finish(&self, answers: &[Vec<u8>]) -> Result<Viewsheds, Error> {
        let cells = self.field.heights().len();
        let mut observers = memory::room("viewsheds", self.observers.len())?;
        for piece in answers {
            let mut rest = &piece[..];
            while !rest.is_empty() {
                let length = decode(cells, rest).try_fold(0, |_, run| run.map(|(_, end)| end));
                let length = length.ok_or(Error::Answers)?;
                observers.push(rest[..length].to_vec());
                rest = &rest[length..];
            }
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

/// Cells of a line.
type Run = (u32, Range<u32>);

/// A part of the plan that is swept.
struct Sector<'a> {
    view: View<'a>,
    height: f64,
    /// Reciprocal of the unit of heights, which is the side of a cell.
    scale: f64,
    target: f64,
    drop: f64,
    range: f64,
    /// Ends in multiples of the distance ahead.
    ends: [f64; 2],
    /// Whether cells on the diagonals between two sides count.
    has_diagonals: bool,
}

/// Projected cells of a line, from `first` on.
#[derive(Default)]
struct Cells {
    line: usize,
    first: usize,
    points: Vec<Point>,
    has_holes: bool,
}

impl Cells {
    fn at(&self, at: usize) -> Point {
        let point = at
            .checked_sub(self.first)
            .and_then(|index| self.points.get(index));
        point.copied().unwrap_or(NOTHING)
    }
}

const NOTHING: Point = Point {
    m: f64::NAN,
    q: f64::NAN,
};

impl<'a> Sector<'a> {
    fn new(job: &ViewshedJob<'a>, observer: &Observer, side: Side, index: usize) -> Self {
        let end = |index: usize| 2.0 * index as f64 / SECTORS as f64 - 1.0;
        Self {
            view: job.field.view(side, observer.place),
            height: observer.height,
            scale: 1.0 / job.field.unit(),
            target: job.target / job.field.unit(),
            drop: job.drop,
            range: job.range,
            ends: [end(index), end(index + 1)],
            has_diagonals: matches!(side, Side::East | Side::West),
        }
    }

    /// Runs of cells that are seen.
    fn sweep(&self) -> Vec<Run> {
        let mut runs = Vec::new();
        let mut horizon = Horizon::new(self.ends[0] - BEYOND, self.ends[1] + BEYOND);
        let (mut before, mut now) = (Cells::default(), Cells::default());
        let first = (self.view.eye[0].floor() + 1.0).max(0.0);
        let last = self.view.eye[0] + self.view.most_lines(self.range);
        let [first, end] = [first, last + 2.0].map(|at| at.min(self.view.lines as f64) as usize);
        for line in first..end {
            self.project(line, &mut now);
            match line {
                _ if line > first => self.raise_strip(&mut horizon, &before, &now),
                0 => {}
                _ => self.raise_around_eye(&mut horizon, line),
            }
            self.look(&horizon, &now, &mut runs);
            let pairs = now.points.windows(2).enumerate();
            horizon.raise(pairs.filter_map(|(index, pair)| {
                let at = now.first + index;
                let is_joined = || self.view.is_joined([line, at], [line, at + 1]);
                (!now.has_holes || is_joined()).then(|| Edge::new(pair[0], pair[1]))
            }));
            std::mem::swap(&mut before, &mut now);
        }
        runs
    }

    /// Height of a cell as the eye sees it, in sides of cells.
    fn rise(&self, line: usize, at: usize) -> (f64, f64, f64) {
        let x = line as f64 - self.view.eye[0];
        let y = at as f64 - self.view.eye[1];
        let drop = self.drop * self.view.squared(x, y);
        (
            x,
            y,
            (self.view.height(line, at) - self.height - drop) * self.scale,
        )
    }

    /// Cells of a line that edges of the sector may end at.
    fn reach(&self, line: usize) -> Range<usize> {
        let [x, y] = self.view.eye;
        let ahead = line as f64 - x;
        let low = (y + (self.ends[0] - BEYOND) * ahead).floor() - 2.0;
        let high = (y + (self.ends[1] + BEYOND) * ahead).ceil() + 3.0;
        let [low, high] = [low, high].map(|at| at.clamp(0.0, self.view.length as f64) as usize);
        low..high
    }

    fn project(&self, line: usize, cells: &mut Cells) {
        let range = self.reach(line);
        (cells.line, cells.first) = (line, range.start);
        cells.points.clear();
        cells.points.extend(range.map(|at| {
            let (x, y, z) = self.rise(line, at);
            Point::new(x, y, z)
        }));
        cells.has_holes = cells.points.iter().any(|point| point.q.is_nan());
    }

    /// Adds the edges between two lines.
    fn raise_strip(&self, horizon: &mut Horizon, near: &Cells, far: &Cells) {
        let range = near.first.max(far.first)
            ..(near.first + near.points.len()).min(far.first + far.points.len());
        let (from, to) = (range.start, range.end.max(range.start));
        let [near_at, far_at] =
            [near, far].map(|cells| &cells.points[from - cells.first..to - cells.first]);
        if !(near.has_holes || far.has_holes) {
            horizon.raise(
                near_at
                    .iter()
                    .zip(far_at)
                    .map(|(&near, &far)| Edge::new(near, far)),
            );
            // Neighbouring diagonals may overlap.
            for odd in [0, 1] {
                let ends = near_at.iter().zip(far_at.iter().skip(1));
                horizon.raise(
                    ends.skip(odd)
                        .step_by(2)
                        .map(|(&near, &far)| Edge::new(near, far)),
                );
            }
            return;
        }
        horizon.raise((from..to).filter_map(|at| {
            let is_joined = self.view.is_joined([near.line, at], [far.line, at]);
            is_joined.then(|| Edge::new(near.at(at), far.at(at)))
        }));
        for first in [from, from + 1] {
            let squares = || (first..to.saturating_sub(1)).step_by(2);
            let has = |point: Point| !point.q.is_nan();
            horizon.raise(squares().filter_map(|at| {
                let is_joined = has(near.at(at + 1)) || has(far.at(at));
                is_joined.then(|| Edge::new(near.at(at), far.at(at + 1)))
            }));
            // The other diagonal is an edge where one end of the first is missing.
            horizon.raise(squares().filter_map(|at| {
                let is_edge = has(near.at(at)) != has(far.at(at + 1));
                is_edge.then(|| Edge::new(near.at(at + 1), far.at(at)))
            }));
        }
    }

    /// Adds the edges between the line behind the eye and the line ahead, as far as they are ahead of the eye.
    fn raise_around_eye(&self, horizon: &mut Horizon, line: usize) {
        let middle = self.view.eye[1];
        let low = (middle.floor() - 3.0).clamp(0.0, self.view.length as f64) as usize;
        let high = (middle.ceil() + 4.0).clamp(0.0, self.view.length as f64) as usize;
        let (near, far) = (line - 1, line);
        let has = |line: usize, at: usize| {
            at < self.view.length && self.view.height(line, at).is_finite()
        };
        let mut raise = |a: usize, b: usize| {
            if has(near, a) && has(far, b) {
                horizon.raise(self.ahead([near, a], [far, b]).into_iter());
            }
        };
        for at in low..high {
            if self.view.is_joined([near, at], [far, at]) {
                raise(at, at);
            }
            if has(near, at + 1) || has(far, at) {
                raise(at, at + 1);
            }
            if has(near, at) != has(far, at + 1) {
                raise(at + 1, at);
            }
        }
    }

    /// The part of an edge between both diagonals ahead of the eye, and a little beyond.
    fn ahead(&self, a: [usize; 2], b: [usize; 2]) -> Option<Edge> {
        let [a, b] = [a, b].map(|[line, at]| self.rise(line, at));
        let (mut from, mut to) = (0.0, 1.0);
        let wide = 1.0 + BEYOND;
        let over = |sign: f64| [a, b].map(|(x, y, _)| wide * x + sign * y);
        for [a, b] in [over(-1.0), over(1.0)] {
            match (a >= 0.0, b >= 0.0) {
                (false, false) => return None,
                (false, true) => from = f64::max(from, a / (a - b)),
                (true, false) => to = f64::min(to, a / (a - b)),
                (true, true) => {}
            }
        }
        let mix = |part: f64| {
            let at = |a: f64, b: f64| a + part * (b - a);
            Point::new(at(a.0, b.0), at(a.1, b.1), at(a.2, b.2))
        };
        (from < to).then(|| Edge::new(mix(from), mix(to)))
    }

    /// Notes the cells of a line that are seen.
    fn look(&self, horizon: &Horizon, cells: &Cells, runs: &mut Vec<Run>) {
        let [start, end] = self.ends;
        let x = cells.line as f64 - self.view.eye[0];
        let raised = self.target / x;
        let mut heights = horizon.heights();
        let mut run: Option<Range<u32>> = None;
        for (at, point) in (cells.first..).zip(&cells.points) {
            let is_inside = match point.m.abs() == 1.0 {
                true => self.has_diagonals && (start..=end).contains(&point.m),
                false => (start..end).contains(&point.m),
            };
            let is_seen = is_inside
                && point.q + raised >= heights.at(point.m) - GRAZING
                && self.is_near(x, at as f64 - self.view.eye[1]);
            let at = at as u32;
            run = match (run, is_seen) {
                (Some(run), true) => Some(run.start..at + 1),
                (None, true) => Some(at..at + 1),
                (Some(run), false) => {
                    runs.push((cells.line as u32, run));
                    None
                }
                (None, false) => None,
            };
        }
        runs.extend(run.map(|run| (cells.line as u32, run)));
    }

    fn is_near(&self, x: f64, y: f64) -> bool {
        self.range == f64::INFINITY || self.view.squared(x, y) <= self.range * self.range
    }
}
