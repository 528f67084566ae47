//! Lines of cells along a step, walked side by side from far to near.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};
use rayon::prelude::*;

use super::border::Line;
use super::crossing::Crossing;
use super::hulls::{Hulls, LINES, Points, Row};
use super::{Sweep, TileSweep};
use crate::{Error, Monitor, Progress};

/// The lines of cells along a step, in a tile of a field.
///
/// A line has one cell in each row, or in each second, third, ... one if the step is longer; in columns instead if the step is along
/// a row. These are its stations `u`, and `v` is the place there.
pub struct Lines<'a> {
    part: &'a TileSweep<'a>,
    /// Steps from station to station, and beside.
    ahead: [isize; 2],
    /// Stations and places of the field, and of the tile.
    field: [Range<isize>; 2],
    tile: [Range<isize>; 2],
    /// Cells from each to the next, in the field and in the tile.
    strides: [[isize; 2]; 2],
    is_along_rows: bool,
    crossings: Vec<Crossing>,
    /// Parts of a step.
    parts: f64,
    /// Length of a step.
    length: f64,
}

/// Lines side by side that begin at the same station: the station, how many there are from there on, and the place of the first line
/// at the first one, which may be beside the raster.
type Block = (isize, isize, isize);

impl<'a> Lines<'a> {
    pub fn new(part: &'a TileSweep<'a>, step: [i32; 2]) -> Self {
        let field = part.sweep.field;
        let [east, north] = field.along(step.map(f64::from));
        let step = step.map(|steps| steps as isize);
        let (crossings, parts) = Crossing::all(step, part.has_holes);
        let is_along_rows = step[1] == 0;
        let size = field.size().map(|size| size as isize);
        let (at, own) = (part.tile.at, part.tile.size.map(|cells| cells as i64));
        let tile = [0, 1].map(|axis| {
            let first = at[axis] - part.at[axis];
            first as isize..(first + own[axis]) as isize
        });
        let strides = [size[0], own[0] as isize];
        Self {
            part,
            ahead: turn(is_along_rows, step),
            field: turn(is_along_rows, size.map(|size| 0..size)),
            tile: turn(is_along_rows, tile),
            strides: strides.map(|width| turn(is_along_rows, [1, width])),
            is_along_rows,
            crossings,
            parts,
            length: libm::hypot(east, north),
        }
    }

    /// What a round earth takes: see [`Hulls`].
    pub fn bend(&self) -> f64 {
        self.part.sweep.drop * self.length * self.length / self.parts
    }

    /// Parts of the longest line of a raster.
    pub fn longest(&self, size: [i64; 2]) -> f64 {
        let [stations, places] = turn(self.is_along_rows, size.map(|size| size as f64));
        let [ahead, beside] = self.ahead.map(|steps| steps.abs() as f64);
        (stations / ahead).min(places / beside) * self.parts
    }

    /// Walks all lines, goes on with those that enter, notes what `of` makes of the slope of the horizon of each cell with data, and
    /// returns the lines that leave.
    pub fn walk(
        &self,
        isa: Isa,
        entering: &BTreeMap<[i64; 2], &Line>,
        of: &(impl Fn(f64) -> f32 + Sync),
        found: &[AtomicU32],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<Line>>, Error> {
        let blocks = self.blocks();
        let progress = Progress::new(monitor, blocks.len());
        let hulls = || Hulls::new(self.bend());
        let all = blocks.into_par_iter();
        let walked = all.map_init(hulls, |hulls, block| {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            let leaving = isa.dispatch(Walk {
                lines: self,
                block,
                hulls,
                entering,
                of,
                found,
            });
            progress.add(1);
            Ok(leaving)
        });
        walked.collect()
    }

    /// Blocks of lines, which together have each cell once.
    fn blocks(&self) -> Vec<Block> {
        let [stations, places] = &self.tile;
        let [forward, beside] = self.ahead;
        let mut blocks = Vec::new();
        // Lines of the first, second, ... station do not meet.
        let all = stations.end - stations.start;
        for phase in 0..forward.abs().min(all) {
            let count = (all - phase + forward.abs() - 1) / forward.abs();
            let moved = (count - 1) * beside;
            let range = places.start + moved.min(0)..places.end + moved.max(0);
            let first = match forward > 0 {
                true => stations.end - 1 - phase,
                false => stations.start + phase,
            };
            blocks.extend(range.step_by(LINES).map(|place| (first, count, place)));
        }
        blocks
    }

    /// Row and column of a station and a place in the whole raster.
    fn whole(&self, place: [isize; 2]) -> [i64; 2] {
        let cell = turn(self.is_along_rows, place);
        [1, 0].map(|axis| self.part.at[axis] + cell[axis] as i64)
    }

    /// Column and row of a station and a place in the field.
    fn cell(&self, place: [isize; 2]) -> [f64; 2] {
        turn(self.is_along_rows, place).map(|x| x as f64)
    }

    /// The lines of those inside that cross an edge on the way to a station, since both ends of it are inside.
    #[inline(always)]
    fn crossed(
        &self,
        crossing: &Crossing,
        [station, place]: [isize; 2],
        inside: &Range<usize>,
    ) -> Option<Range<usize>> {
        let mut lines = inside.clone();
        for (offset, _) in crossing.ends {
            let [u, v] = turn(self.is_along_rows, offset);
            let range = within([station + u, place + v], &self.field);
            lines = lines.start.max(range.start)..lines.end.min(range.end);
        }
        (!lines.is_empty()).then_some(lines)
    }

    /// Whether the edge that a line crosses on the way to a cell is an edge of a triangle, if both ends have data.
    fn has_edge(&self, place: [isize; 2], crossing: &Crossing) -> bool {
        let [column, row] = self.cell(place);
        let ends = crossing
            .ends
            .map(|([c, r], _)| [column + c as f64, row + r as f64]);
        self.part.sweep.field.has_edge(ends[0], ends[1])
    }
}

/// Stations and places of columns and rows, or the reverse.
fn turn<T>(is_along_rows: bool, [a, b]: [T; 2]) -> [T; 2] {
    match is_along_rows {
        true => [a, b],
        false => [b, a],
    }
}

/// A walk along the lines of a block.
struct Walk<'a, Of> {
    lines: &'a Lines<'a>,
    block: Block,
    hulls: &'a mut Hulls,
    of: &'a Of,
    found: &'a [AtomicU32],
    /// Lines from other tiles.
    entering: &'a BTreeMap<[i64; 2], &'a Line>,
}

impl<Of: Fn(f64) -> f32> WithSimd<8> for Walk<'_, Of> {
    type Output = Vec<Line>;

    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(mut self, _: S) -> Vec<Line> {
        let lines = self.lines;
        let ([forward, beside], (first, count, line)) = (lines.ahead, self.block);
        let mut leaving = Vec::new();
        for index in 0..count {
            let station = first - index * forward;
            let place = line - index * beside;
            let inside = within([station, place], &lines.tile);
            if inside.is_empty() {
                continue;
            }
            let at = index as f64 * lines.parts;
            let last = [station + forward, place + beside];
            self.begin(at, last, without(&inside, within(last, &lines.tile)));
            self.hulls.reserve(lines.crossings.len() + 1);
            self.station((at, station, place), &inside);
            let next = [station - forward, place - beside];
            let going = within(next, &lines.field);
            let ended = without(&inside, within(next, &lines.tile));
            for line in ended.filter(|line| going.contains(line)) {
                let cell = lines.whole([station, place + line as isize]);
                leaving.push(self.hulls.leave(line, cell));
            }
        }
        leaving
    }
}

/// Lines of a block that are in a rectangle of stations and places, where the first one is at a station and place.
#[inline(always)]
fn within([station, place]: [isize; 2], [stations, places]: &[Range<isize>; 2]) -> Range<usize> {
    if !stations.contains(&station) {
        return 0..0;
    }
    let line = |at: isize| (at - place).clamp(0, LINES as isize) as usize;
    line(places.start)..line(places.end)
}

/// Some lines without others.
fn without(lines: &Range<usize>, others: Range<usize>) -> impl Iterator<Item = usize> {
    let first = others.start.clamp(lines.start, lines.end);
    let second = others.end.clamp(first, lines.end);
    (lines.start..first).chain(second..lines.end)
}

impl<Of: Fn(f64) -> f32> Walk<'_, Of> {
    /// Begins lines, or goes on where they left other tiles. The cell of the first line before is at `last`.
    fn begin(&mut self, at: f64, last: [isize; 2], begun: impl Iterator<Item = usize>) {
        let lines = self.lines;
        // What was passed last: a cell, and before it a crossing or another cell.
        let held = at - lines.parts;
        let before = lines.crossings.last();
        let prior = held - before.map_or(lines.parts, |crossing| crossing.before);
        for line in begun {
            let place = lines.whole([last[0], last[1] + line as isize]);
            match self.entering.get(&place) {
                Some(from) => self.hulls.enter(line, [held, prior], from),
                // There is nothing ahead in the whole.
                None => self.hulls.begin(line),
            }
        }
    }

    /// Walks to the cells of a station. The first line of the block is at `place`, and a range of its lines is `inside` the raster.
    #[inline(always)]
    fn station(&mut self, (at, station, place): (f64, isize, isize), inside: &Range<usize>) {
        let lines = self.lines;
        let Sweep { field, rise, .. } = lines.part.sweep;
        let (heights, has_holes) = (field.heights(), lines.part.has_holes);
        let none = [f64::NAN; LINES];
        let [stride, own] = lines.strides;
        let origin = station * stride[0] + place * stride[1];
        for crossing in &lines.crossings {
            let mut new = Points {
                at: at - crossing.before,
                heights: none,
            };
            if let Some(crossed) = lines.crossed(crossing, [station, place], inside) {
                // Lines with crossings are side by side in a row.
                let [(a, share_a), (b, share_b)] = crossing.ends.map(|([columns, rows], share)| {
                    let offset = rows * field.size()[0] as isize + columns;
                    let first = (origin + offset + crossed.start as isize) as usize;
                    (first..first + crossed.len(), share)
                });
                let has_hole = field.has_holes() && field.surrounded()[a.clone()].contains(&false);
                if has_hole || !crossing.is_of_holes() {
                    let ends = heights[a].iter().zip(&heights[b]);
                    for (new, (a, b)) in new.heights[crossed.clone()].iter_mut().zip(ends) {
                        *new = share_a * a + share_b * b;
                    }
                }
                if has_hole {
                    leave_out(&mut new.heights, &crossed, |line| {
                        !lines.has_edge([station, place + line as isize], crossing)
                    });
                }
            }
            self.hulls.pass(inside.clone(), &new);
        }
        let cell = |line: usize| (origin + line as isize * stride[1]) as usize;
        let mut new = Points { at, heights: none };
        for line in inside.clone() {
            new.heights[line] = lines.parts * heights[cell(line)];
        }
        let rise = lines.parts * rise;
        let eyes = new.heights.map(|height| height + rise);
        if field.has_holes() {
            leave_out(&mut new.heights, inside, |line| {
                !field.surrounded()[cell(line)]
                    && !field.has_triangle(lines.cell([station, place + line as isize]))
            });
        }
        self.hulls.pass(inside.clone(), &new);
        self.hulls.look(inside.clone());
        let mut slopes = self.hulls.slopes(at, &eyes);
        for line in inside.clone() {
            // The last point is not the horizon of those who are above the ground, or beside it.
            if rise > 0.0 || has_holes && new.heights[line].is_nan() {
                slopes[line] = self.hulls.horizon(line, at, eyes[line]);
            }
        }
        let found = slopes.map(|slope| (self.of)(slope / lines.length));
        let buried = (self.of)(f64::INFINITY);
        let [station, place] = [station - lines.tile[0].start, place - lines.tile[1].start];
        let first = station * own[0] + place * own[1];
        for line in inside.clone() {
            if !eyes[line].is_nan() {
                let value = if rise < 0.0 { buried } else { found[line] };
                let cell = (first + line as isize * own[1]) as usize;
                self.found[cell].store(value.to_bits(), Ordering::Relaxed);
            }
        }
    }
}

/// Leaves out the points of some lines.
fn leave_out(new: &mut Row, lines: &Range<usize>, is_out: impl Fn(usize) -> bool) {
    for line in lines.clone() {
        if !new[line].is_nan() && is_out(line) {
            new[line] = f64::NAN;
        }
    }
}
