//! Lines of cells along a step, walked side by side from far to near.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use antumbra_simd::{Dispatch, Isa, Simd, Width, WithSimd};
use rayon::prelude::*;

use super::Sweep;
use super::crossing::Crossing;
use super::hulls::{Hulls, LINES, Points, Row};
use crate::{Error, Monitor, Progress};

/// The lines of cells along a step.
///
/// A line has one cell in each row, or in each second, third, ... one if the step is longer; in columns instead if the step is along
/// a row. These are its stations `u`, and `v` is the place there.
pub struct Lines<'a> {
    sweep: &'a Sweep<'a>,
    /// Steps from station to station, and beside.
    ahead: [isize; 2],
    /// Numbers of stations and places, and cells from each to the next.
    size: [isize; 2],
    stride: [isize; 2],
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
    pub fn new(sweep: &'a Sweep<'a>, step: [i32; 2]) -> Self {
        let size = sweep.field.size().map(|size| size as isize);
        let [east, north] = sweep.field.along(step.map(f64::from));
        let step = step.map(|steps| steps as isize);
        let (crossings, parts) = Crossing::all(step, sweep.field.has_holes());
        let is_along_rows = step[1] == 0;
        Self {
            sweep,
            ahead: turn(is_along_rows, step),
            size: turn(is_along_rows, size),
            stride: turn(is_along_rows, [1, size[0]]),
            is_along_rows,
            crossings,
            parts,
            length: libm::hypot(east, north),
        }
    }

    /// Walks all lines, and notes what `of` makes of the slope of the horizon of each cell with data.
    pub fn walk(
        &self,
        isa: Isa,
        of: &(impl Fn(f64) -> f32 + Sync),
        found: &[AtomicU32],
        monitor: &dyn Monitor,
    ) -> Result<(), Error> {
        let blocks = self.blocks();
        let progress = Progress::new(monitor, blocks.len());
        let bend = self.sweep.drop * self.length * self.length / self.parts;
        let hulls = || Hulls::new(bend);
        let all = blocks.into_par_iter();
        all.try_for_each_init(hulls, |hulls, block| {
            if monitor.cancelled() {
                return Err(Error::Cancelled);
            }
            isa.dispatch(Walk {
                lines: self,
                block,
                hulls,
                of,
                found,
            });
            progress.add(1);
            Ok(())
        })
    }

    /// Blocks of lines, which together have each cell once.
    fn blocks(&self) -> Vec<Block> {
        let [stations, places] = self.size;
        let [forward, beside] = self.ahead;
        let mut blocks = Vec::new();
        // Lines of the first, second, ... station do not meet.
        for phase in 0..forward.abs().min(stations) {
            let count = (stations - phase + forward.abs() - 1) / forward.abs();
            let moved = (count - 1) * beside;
            let range = moved.min(0)..places + moved.max(0);
            let first = match forward > 0 {
                true => stations - 1 - phase,
                false => phase,
            };
            blocks.extend(range.step_by(LINES).map(|place| (first, count, place)));
        }
        blocks
    }

    /// Column and row of a station and a place.
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
            if !(0..self.size[0]).contains(&(station + u)) {
                return None;
            }
            let range = within(place, -v..self.size[1] - v);
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
        self.sweep.field.has_edge(ends[0], ends[1])
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
}

impl<Of: Fn(f64) -> f32> WithSimd<8> for Walk<'_, Of> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<8>>(mut self, _: S) {
        let lines = self.lines;
        let ([forward, beside], (first, count, line)) = (lines.ahead, self.block);
        for index in 0..count {
            let station = first - index * forward;
            let place = line - index * beside;
            let inside = within(place, 0..lines.size[1]);
            if inside.is_empty() {
                continue;
            }
            // Lines whose last cell, if any, is beside the raster.
            let known = match index {
                0 => 0..0,
                _ => within(place, -beside..lines.size[1] - beside),
            };
            let begun = known.start.clamp(inside.start, inside.end);
            let begun = begun..known.end.clamp(begun, inside.end);
            self.hulls.clear(inside.start..begun.start);
            self.hulls.clear(begun.end..inside.end);
            self.hulls.reserve(lines.crossings.len() + 1);
            self.station((index as f64 * lines.parts, station, place), &inside);
        }
    }
}

/// Lines from one at `place` on that are within some places.
#[inline(always)]
fn within(place: isize, places: Range<isize>) -> Range<usize> {
    let line = |at: isize| (at - place).clamp(0, LINES as isize) as usize;
    line(places.start)..line(places.end)
}

impl<Of: Fn(f64) -> f32> Walk<'_, Of> {
    /// Walks to the cells of a station. The first line of the block is at `place`, and a range of its lines is `inside` the raster.
    #[inline(always)]
    fn station(&mut self, (at, station, place): (f64, isize, isize), inside: &Range<usize>) {
        let lines = self.lines;
        let field = lines.sweep.field;
        let (heights, has_holes) = (field.heights(), field.has_holes());
        let none = [f64::NAN; LINES];
        let origin = station * lines.stride[0] + place * lines.stride[1];
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
                    (&heights[first..first + crossed.len()], share)
                });
                let ends = a.iter().zip(b);
                for (new, (a, b)) in new.heights[crossed.clone()].iter_mut().zip(ends) {
                    *new = share_a * a + share_b * b;
                }
                if has_holes {
                    leave_out(&mut new.heights, &crossed, |line| {
                        !lines.has_edge([station, place + line as isize], crossing)
                    });
                }
            }
            self.hulls.pass(inside.clone(), &new);
        }
        let cell = |line: usize| (origin + line as isize * lines.stride[1]) as usize;
        let mut new = Points { at, heights: none };
        for line in inside.clone() {
            new.heights[line] = lines.parts * heights[cell(line)];
        }
        let rise = lines.parts * lines.sweep.rise;
        let eyes = new.heights.map(|height| height + rise);
        if has_holes {
            leave_out(&mut new.heights, inside, |line| {
                !field.has_triangle(lines.cell([station, place + line as isize]))
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
        for line in inside.clone() {
            if !eyes[line].is_nan() {
                let value = if rise < 0.0 { buried } else { found[line] };
                self.found[cell(line)].store(value.to_bits(), Ordering::Relaxed);
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
