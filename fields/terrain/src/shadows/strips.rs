//! Strips of light.

use std::ops::Range;

use antumbra_simd::{Lanes, Mask, Simd, Width, WithSimd};

use super::ray::{Eye, NEAR, Ray};
use super::{Grid, PAD, Shadows};
use crate::{Error, memory};

/// Rows of a block.
const BLOCK: usize = 8;

/// Columns that are taken at once.
pub const LANES: usize = 16;

/// Parts of a column from a centre of a cell at which a line is on it, more than places are rounded.
const CLOSE: f64 = 1e-9;

/// A height that hides nothing.
const NONE: f32 = f32::NEG_INFINITY;

/// A crossing of lines with an edge.
#[derive(Clone, Copy)]
struct Tap {
    /// Rows ahead, and columns, of both ends.
    ends: [(usize, isize); 2],
    /// Part of the edge before the crossing.
    part: f32,
    /// Rows to the crossing.
    ahead: f64,
}

impl Tap {
    /// The crossing with a row, of a line that is `part` of a column behind a column.
    fn along(part: f64) -> Self {
        // The last column has none behind it.
        let second = isize::from(part > 0.0);
        Self {
            ends: [(0, 0), (0, second)],
            part: part as f32,
            ahead: 0.0,
        }
    }
}

/// Lines from the light over a raster, which is walked from row to row.
struct Path<'a> {
    grid: &'a Grid,
    ray: &'a Ray<'a>,
    has_holes: bool,
    rise: f32,
    /// More than keys are rounded.
    slack: f32,
    /// Crossings of rays just in front of their cells: with edges, with what is an edge only beside holes, and corners that may be crossed
    /// instead of what is beside them.
    near: [Vec<Tap>; 3],
    /// Number of the line at column 0 of the first row.
    first: isize,
}

impl<'a> Path<'a> {
    fn new(shadows: &'a Shadows<'a>, ray: &'a Ray<'a>) -> Self {
        let grid = &shadows.grids[usize::from(ray.is_turned)];
        let moved = (ray.shift.min(0.0).abs() * grid.rows as f64).ceil() as isize;
        let most = (ray.climb * grid.rows as f64).abs() + shadows.relief + shadows.rise;
        let mut path = Self {
            grid,
            ray,
            has_holes: shadows.field.has_holes(),
            rise: shadows.rise as f32,
            slack: (most * 16.0 / f64::from(1 << 24)) as f32,
            near: Default::default(),
            first: moved + 4,
        };
        for row in 0..NEAR {
            let place = ray.shift * row as f64;
            let (whole, part) = (place.floor(), place - place.floor());
            let [mut taps, more] = path.taps(part);
            if row > 0 {
                taps.push(Tap::along(part));
            }
            let mut corners = Vec::new();
            if row > 0 && (place - place.round()).abs() < CLOSE {
                let column = (place.round() - whole) as isize;
                corners.push(Tap {
                    ends: [(0, column); 2],
                    ..Tap::along(0.0)
                });
            }
            for (near, taps) in path.near.iter_mut().zip([taps, more, corners]) {
                near.extend(taps.into_iter().map(|tap| {
                    Tap {
                        ends: tap
                            .ends
                            .map(|(ahead, column)| (ahead + row, column + whole as isize)),
                        ahead: tap.ahead + row as f64,
                        ..tap
                    }
                }));
            }
        }
        path
    }

    /// Crossings between a row and the next one of a line that is `part` of a column behind a column: with edges, and with diagonals that
    /// are edges only beside holes.
    fn taps(&self, part: f64) -> [Vec<Tap>; 2] {
        let shift = self.ray.shift;
        let mut taps = [Vec::new(), Vec::new()];
        let end = part + shift;
        if end > 1.0 || end < 0.0 && part > 0.0 {
            let column = isize::from(end > 1.0);
            let ahead = (column as f64 - part) / shift;
            taps[0].push(Tap {
                ends: [(0, column), (1, column)],
                part: ahead as f32,
                ahead,
            });
        }
        // Diagonals run towards the last row and the last column; beside holes there are others, too.
        let kinds = [self.ray.is_down, !self.ray.is_down];
        let kinds = &kinds[..if self.has_holes { 2 } else { 1 }];
        for (taps, &rises) in taps.iter_mut().zip(kinds) {
            for column in -1..=1 {
                let [near, far] = if rises {
                    [column, column + 1]
                } else {
                    [column + 1, column]
                };
                let ahead = (part - near as f64) / ((far - near) as f64 - shift);
                if ahead > 0.0 && ahead < 1.0 {
                    taps.push(Tap {
                        ends: [(0, near), (1, far)],
                        part: ahead as f32,
                        ahead,
                    });
                }
            }
        }
        taps
    }

    /// Number of the line in or behind column 0 of a row, and the part of a column that it is behind.
    fn line(&self, row: usize) -> (usize, f64) {
        let place = -self.ray.shift * row as f64;
        let (whole, part) = match (place - place.round()).abs() < CLOSE {
            true => (place.round(), 0.0),
            false => (place.floor(), place - place.floor()),
        };
        ((self.first - whole as isize) as usize, part)
    }

    /// Row of the raster.
    fn own_row(&self, row: usize) -> usize {
        if self.ray.is_down {
            self.grid.rows - 1 - row
        } else {
            row
        }
    }

    /// What heights so many rows from the light gain, so that places on a ray have one key.
    fn key(&self, row: f64) -> f32 {
        (row * self.ray.climb) as f32
    }

    /// Numbers of a row from a column on, which may be some before the first one.
    fn row<'h>(&self, heights: &'h [f32], row: usize, column: isize) -> Chunks<'h> {
        let start = self.own_row(row) * self.grid.stride + PAD;
        chunks(
            &heights[start.wrapping_add_signed(column)..]
                [..self.grid.columns.next_multiple_of(LANES) + LANES],
        )
    }

    /// Crossings of a row with so many columns before the first one.
    fn crossings<'h>(
        &self,
        heights: &'h [f32],
        row: usize,
        before: isize,
        taps: &[Tap],
        crossings: &mut Vec<Cross<'h>>,
    ) {
        for tap in taps {
            let rows = tap.ends.map(|(ahead, _)| row.checked_sub(ahead));
            if let [Some(a), Some(b)] = rows {
                let [(_, first), (_, second)] = tap.ends;
                crossings.push(Cross {
                    ends: [
                        self.row(heights, a, first - before),
                        self.row(heights, b, second - before),
                    ],
                    part: tap.part,
                    key: self.key(row as f64 - tap.ahead),
                });
            }
        }
    }
}

/// Numbers, many at a time.
type Chunks<'a> = &'a [[f32; LANES]];

fn chunks(numbers: &[f32]) -> Chunks<'_> {
    numbers.as_chunks().0
}

/// A vector of numbers of a row.
type Vector<S> = <S as Width<LANES>>::Lanes;

/// A crossing with an edge for all columns of a row.
struct Cross<'a> {
    ends: [Chunks<'a>; 2],
    part: f32,
    key: f32,
}

/// The highest of crossings.
#[inline(always)]
fn highest<S: Simd + Width<LANES>>(
    simd: S,
    crossings: &[Cross<'_>],
    index: usize,
    found: Vector<S>,
) -> Vector<S> {
    let mut found = found;
    for Cross {
        ends: [a, b],
        part,
        key,
    } in crossings
    {
        let (a, b) = (
            Vector::<S>::load(simd, &a[index]),
            Vector::<S>::load(simd, &b[index]),
        );
        let own = a + Vector::<S>::splat(simd, *part) * (b - a) + Vector::<S>::splat(simd, *key);
        // NaN counts for nothing.
        found = own.max(found);
    }
    found
}

/// Sweep over a raster along a ray.
pub struct Strips<'a> {
    path: Path<'a>,
    /// Highest key in each strip: in this block of rows, and in all before.
    now: Vec<f32>,
    before: Vec<f32>,
    /// Highest key in each strip that no ray of it can pass below.
    sure: Vec<f32>,
    /// `now` and `before` at the end of each block, and the number of the first strip there.
    blocks: Vec<[Vec<f32>; 2]>,
    starts: Vec<usize>,
    /// Keys of the lines of a row, from the one behind column -2 on.
    lines: Vec<f32>,
    /// Keys that may hide cells of a row, of crossings near them.
    near: Vec<f32>,
    /// Columns, and rows from the light, of the cells that are judged, and the strips that they are in.
    part: [Range<usize>; 2],
    strips: Range<usize>,
    /// The first row that may hide them.
    start: usize,
    plane: &'a mut [u64],
}

impl<'a> Strips<'a> {
    pub fn new(
        shadows: &'a Shadows<'a>,
        ray: &'a Ray<'a>,
        ([own, rows], far): (&[Range<usize>; 2], usize),
        plane: &'a mut [u64],
    ) -> Result<Self, Error> {
        let path = Path::new(shadows, ray);
        let judged = match ray.is_down {
            true => path.grid.rows - rows.end..path.grid.rows - rows.start,
            false => rows.clone(),
        };
        let [first, last] = [judged.start, judged.end - 1].map(|row| path.line(row).0);
        let Grid { columns, rows, .. } = *path.grid;
        let strips = columns + (ray.shift.abs() * rows as f64).ceil() as usize + 12 + 2 * LANES;
        let list = |length: usize| memory::filled("strips", length, NONE);
        let padded = columns.next_multiple_of(64) + 2 * LANES;
        Ok(Self {
            path,
            now: list(strips)?,
            before: list(strips)?,
            sure: list(strips)?,
            blocks: Vec::new(),
            starts: Vec::new(),
            lines: list(padded)?,
            near: list(padded)?,
            start: judged.start.saturating_sub(far) / BLOCK * BLOCK,
            part: [own.clone(), judged],
            strips: first.min(last) - 1 + own.start..first.max(last) - 1 + own.end,
            plane,
        })
    }

    /// Takes a row, and what is between it and the one ahead.
    #[inline(always)]
    fn take<S: Simd + Width<LANES>>(&mut self, simd: S, row: usize) {
        let Self { path, lines, .. } = self;
        let grid = path.grid;
        let (line, part) = path.line(row);
        let key = Vector::<S>::splat(simd, path.key(row as f64));
        let none = Vector::<S>::splat(simd, NONE);
        let along = [Tap::along(part)];
        let mut own = Vec::new();
        path.crossings(grid.joined(), row, 2, &along, &mut own);
        let mut more = Vec::new();
        if !grid.joined.is_empty() {
            path.crossings(&grid.heights, row, 2, &along, &mut more);
        }
        for taps in path.taps(part) {
            path.crossings(&grid.heights, row, 2, &taps, &mut more);
        }
        let count = (grid.columns + 4).div_ceil(LANES);
        // The last lane has no line on its right, and is of no strip that counts.
        let Range { start, end } = self.strips;
        let start = (start + 2).saturating_sub(line) / LANES;
        let count = count.min((end + 2).saturating_sub(line) / LANES + 1);
        // Strips from line to line have one cell in each row.
        let middle = path.row(grid.joined(), row, -1);
        for index in start..count {
            highest(simd, &own, index, none).store(chunk(lines, LANES * index));
        }
        // Beside a hole a line on a corner may be one that misses it.
        let is_sure = !path.has_holes || part > 0.0 || path.ray.shift == 0.0;
        for index in start..if is_sure { count } else { 0 } {
            let at = LANES * index;
            let (left, right) = (load::<S>(simd, lines, at), load::<S>(simd, lines, at + 1));
            let height = Vector::<S>::load(simd, &middle[index]) + key;
            let found = left.min(right).min(height);
            let sure = chunk(&mut self.sure, line - 2 + at);
            found.max(Vector::<S>::load(simd, sure)).store(sure);
        }
        for index in start..count {
            let lines = chunk(lines, LANES * index);
            highest(simd, &more, index, Vector::<S>::load(simd, lines)).store(lines);
        }
        let middle = path.row(&grid.heights, row, -1);
        for index in start..count {
            let at = LANES * index;
            let (left, right) = (load::<S>(simd, lines, at), load::<S>(simd, lines, at + 1));
            let height = Vector::<S>::load(simd, &middle[index]) + key;
            let found = height.max(left.max(right));
            let now = chunk(&mut self.now, line - 2 + at);
            found.max(Vector::<S>::load(simd, now)).store(now);
        }
    }

    /// Keeps the block of rows that ends with this one.
    fn end_block(&mut self, row: usize) {
        let columns = self.path.grid.columns;
        let [first, last] = [row + 1 - BLOCK, row].map(|row| self.path.line(row).0);
        let start = self.strips.start.max(first.min(last) - 2);
        let end = self.strips.end.min(first.max(last) + columns);
        let strips = start..end.max(start);
        let (now, before) = (&mut self.now[strips.clone()], &mut self.before[strips]);
        for i in 0..now.len() {
            before[i] = before[i].max(now[i]);
        }
        self.blocks.push([now.to_vec(), before.to_vec()]);
        self.starts.push(start);
        now.fill(NONE);
    }

    /// Decides which cells of a row are lit.
    #[inline(always)]
    fn judge<S: Simd + Width<LANES>>(&mut self, simd: S, row: usize) {
        let Self { path, near, .. } = self;
        let grid = path.grid;
        let all = |heights, taps: &[Tap]| {
            let mut crossings = Vec::new();
            path.crossings(heights, row, 0, taps, &mut crossings);
            crossings
        };
        let [edges, more, corners] = &path.near;
        let joined = match grid.joined.is_empty() {
            true => Vec::new(),
            false => all(&grid.joined, edges),
        };
        let heights = &grid.heights;
        let (edges, more, corners) = (
            all(heights, edges),
            all(heights, more),
            all(heights, corners),
        );
        let (line, _) = path.line(row);
        let key = path.key(row as f64) + path.rise;
        let (none, slack) = (
            Vector::<S>::splat(simd, NONE),
            Vector::<S>::splat(simd, path.slack),
        );
        let heights = path.row(&grid.heights, row, 0);
        let own_row = path.own_row(row);
        let Range { start, end } = self.part[0];
        let words = start / 64..end.div_ceil(64);
        let rows = self.part[1].clone();
        let below = match path.ray.is_down {
            true => rows.end - 1 - row,
            false => row - rows.start,
        };
        let place = below * words.len();
        for word in words.clone() {
            let (mut lit, mut open) = (0, 0);
            for part in 0..64 / LANES {
                let index = 64 / LANES * word + part;
                let at = LANES * index;
                if at >= grid.columns {
                    break;
                }
                let edges = highest(simd, &edges, index, none);
                let (mut near_most, mut near_sure) = (highest(simd, &corners, index, edges), edges);
                if grid.has_gap(own_row, index) {
                    near_most = highest(simd, &more, index, near_most);
                    if !grid.joined.is_empty() {
                        near_sure = highest(simd, &joined, index, none);
                    }
                }
                near_most.store(chunk(near, at));
                let strip = line - 1 + at;
                let far =
                    load::<S>(simd, &self.now, strip).max(load::<S>(simd, &self.before, strip));
                let most = far.max(near_most) + slack;
                let sure = load::<S>(simd, &self.sure, strip).max(near_sure) - slack;
                let own = Vector::<S>::load(simd, &heights[index]) + Vector::<S>::splat(simd, key);
                // NaN is neither lit nor open.
                lit |= u64::from(most.lt(own).bits()) << (LANES * part);
                open |= u64::from(own.le(most).bits() & sure.le(own).bits()) << (LANES * part);
            }
            let before = (1 << start.saturating_sub(64 * word)) - 1;
            let mask = u64::MAX >> (64 * (word + 1)).saturating_sub(end) & !before;
            (lit, open) = (lit & mask, open & mask);
            while open != 0 {
                let bit = open.trailing_zeros() as usize;
                open &= open - 1;
                let column = 64 * word + bit;
                let height = heights[column / LANES][column % LANES];
                let eye = Eye {
                    cell: if path.ray.is_turned {
                        [own_row, column]
                    } else {
                        [column, own_row]
                    },
                    column,
                    row,
                    own: own_row * grid.stride + PAD + column,
                    low: height + path.rise - path.slack,
                    high: height + path.rise + path.slack,
                };
                let is_lit = is_lit(
                    path,
                    [&self.now, &self.before],
                    (&self.blocks, &self.starts),
                    &eye,
                    (height + key, line + column - 1),
                    near[column],
                );
                lit |= u64::from(is_lit) << bit;
            }
            self.plane[place + word - words.start] = lit;
        }
    }
}

/// Numbers of a list from a place on.
#[inline(always)]
fn load<S: Simd + Width<LANES>>(simd: S, list: &[f32], at: usize) -> Vector<S> {
    Vector::<S>::load(simd, list[at..].first_chunk().expect("room behind"))
}

/// The same, to be changed.
#[inline(always)]
fn chunk(list: &mut [f32], at: usize) -> &mut [f32; LANES] {
    list[at..].first_chunk_mut().expect("room behind")
}

impl WithSimd<LANES> for Strips<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd + Width<LANES>>(mut self, simd: S) {
        let rows = self.part[1].clone();
        // Blocks before have nothing.
        let start = self.start;
        self.blocks.resize(start / BLOCK, [Vec::new(), Vec::new()]);
        self.starts.resize(start / BLOCK, 0);
        for row in start..rows.end {
            let taken = row.checked_sub(NEAR).filter(|&taken| taken >= start);
            if let Some(taken) = taken {
                self.take(simd, taken);
            }
            if row >= rows.start {
                self.judge(simd, row);
            }
            if let Some(last) = taken.filter(|taken| (taken + 1).is_multiple_of(BLOCK)) {
                self.end_block(last);
            }
        }
    }
}

/// Whether no edge is in the way of a cell.
fn is_lit(
    path: &Path<'_>,
    [now, before]: [&Vec<f32>; 2],
    (blocks, starts): (&[[Vec<f32>; 2]], &[usize]),
    eye: &Eye,
    (key, strip): (f32, usize),
    near: f32,
) -> bool {
    let row = eye.row;
    let low = key - path.slack;
    if near >= low && path.ray.is_hidden(eye, 0, NEAR) {
        return false;
    }
    let Some(last) = row.checked_sub(NEAR) else {
        return true;
    };
    let hidden =
        |first: usize, last: usize| path.ray.is_hidden(eye, row - last - 1, row - first + 1);
    let first = blocks.len() * BLOCK;
    if now[strip] >= low && first <= last && hidden(first, last) {
        return false;
    }
    if !(before[strip] >= low) {
        return true;
    }
    for (block, ([now, before], start)) in blocks.iter().zip(starts).enumerate().rev() {
        let at = strip.wrapping_sub(*start);
        let (Some(&now), Some(&before)) = (now.get(at), before.get(at)) else {
            return true;
        };
        if before < low {
            return true;
        }
        if now >= low && hidden(block * BLOCK, block * BLOCK + BLOCK - 1) {
            return false;
        }
    }
    true
}
