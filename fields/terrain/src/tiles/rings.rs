//! Horizons of a tile: which squares raise them.
//!
//! Squares of eight cells are judged by their peaks, in rounds. In each, eyes mark the squares that they may see highest. What is
//! read there mostly hides the others, so that hardly more is read than what is above a horizon in the end: a square that may be
//! highest of all must be read in any case. Eyes without marks have their horizon. Others take ever more squares in a round.
//!
//! All that is read in a round is put into few fields, which have NaN elsewhere: it is never larger than a slope, so that walks
//! pass over it. Two neighbours with data, or two on a main diagonal, are in one square with a third cell that was read, and so
//! have an edge in the whole. Where the raster has holes this is not enough: then each part that was read is a field.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use super::{Own, Pull, Read, Tile, Tiles, Way, Window, rectangles};
use crate::march;
use crate::peaks::SIDES;
use crate::{Error, HeightField, March, Monitor, Peaks, memory, monitor::Share};

/// Cells on a side of squares.
const SIDE: i64 = SIDES[0] as i64;

/// Cells between the tile and the end of the first ring; each other one ends twice as far away.
const FIRST: i64 = 4096;

/// Most cells on a side of the parts of a ring.
const PANEL: i64 = 16384;

/// Squares of a field that is not divided, most squares of a field, and most for each square with a mark.
const FIELD: [usize; 3] = [4096, 131072, 32];

impl<T: Tiles> Pull<'_, T> {
    /// Raises slopes to the horizons that tiles around give.
    pub(super) fn raise(
        &self,
        own: &Own,
        ways: &mut [Way],
        drop: f64,
        read: &mut Read,
        monitor: &dyn Monitor,
    ) -> Result<(), T::Error> {
        let (ends, wholes) = (own.tile.end(), own.whole.end());
        let sides = [0, 1].map(|axis| {
            let before = own.tile.at[axis] - own.whole.at[axis];
            before.max(wholes[axis] - ends[axis])
        });
        let (mut near, reach) = (0, sides[0].max(sides[1]) + 1);
        while near < reach {
            let far = (2 * near).max(FIRST);
            let ring = own.tile.with_margin([far; 2], &own.whole);
            let share = Share(monitor, [near as usize, reach as usize]);
            let starts = |axis: usize| (ring.at[axis]..ring.end()[axis]).step_by(PANEL as usize);
            for row in starts(1) {
                for column in starts(0) {
                    let at = [column, row];
                    let panel = Tile::between(at, at.map(|at| at + PANEL)).within(&ring);
                    self.panel(own, (&panel, near..far), (ways, drop), read, &share)?;
                }
            }
            near = far;
        }
        monitor.progress(1, 1);
        Ok(())
    }

    /// The same for the part of a ring that is in a rectangle.
    fn panel(
        &self,
        own: &Own,
        (panel, ring): (&Tile, Range<i64>),
        (ways, drop): (&mut [Way], f64),
        read: &mut Read,
        monitor: &dyn Monitor,
    ) -> Result<(), T::Error> {
        let (all, lowest) = (self.tiles.tiles(), own.lowest + self.rise);
        let transform = self.tiles.transform();
        // Squares of tiles, if these have any.
        let first = [0, 1].map(|axis| {
            let origin = all[0].at[axis];
            origin + (panel.at[axis] - origin).div_euclid(SIDE) * SIDE
        });
        let panel = Tile::between(first, panel.end());
        let [width, height] = panel.size.map(|size| size.div_ceil(SIDE as usize));
        let square = |[column, row]: [usize; 2]| Tile {
            at: [0, 1].map(|axis| panel.at[axis] + SIDE * [column, row][axis] as i64),
            size: [SIDE as usize; 2],
        };
        // Edges have ends beside a tile.
        let cells = |tile: &Tile| {
            let window = tile.with_margin([1; 2], &own.whole);
            let first = [0, 1].map(|axis| (window.at[axis] - tile.at[axis]) as isize);
            (first, window.size)
        };
        let matters = |ways: &[Way], tile: &Tile, peak: f64| -> Vec<usize> {
            let eyes = own.eyes(tile);
            let cells = cells(tile);
            let matter = |way: &Way| eyes.lines(way.step, cells).most(peak - lowest, drop);
            (0..ways.len())
                .filter(|&way| matter(&ways[way]) > ways[way].least)
                .collect()
        };
        let count = width * height;
        let mut peaks = memory::filled("peaks", count, f64::NEG_INFINITY)?;
        let mut found = Vec::new();
        for &tile in &own.order {
            let part = all[tile].within(&panel);
            let gap = own.tile.gap(&all[tile]);
            if part.cells() == 0 || gap >= ring.end {
                continue;
            }
            if matters(ways, &all[tile], self.tiles.peak(tile)).is_empty() {
                continue;
            }
            let own_peaks = self.peaks_of(tile)?;
            let squares = [0, 1].map(|axis| {
                let first = part.at[axis] - panel.at[axis];
                let end = first + part.size[axis] as i64;
                (first / SIDE) as usize..((end + SIDE - 1) / SIDE) as usize
            });
            for row in squares[1].clone() {
                for column in squares[0].clone() {
                    let square = square([column, row]);
                    let part = square.within(&all[tile]);
                    if ring.contains(&own.tile.gap(&square)) && square.within(&own.tile) != square {
                        let cells = [0, 1].map(|axis| {
                            let first = (part.at[axis] - all[tile].at[axis]) as isize;
                            first..first + part.size[axis] as isize
                        });
                        let peak = &mut peaks[row * width + column];
                        *peak = peak.max(own_peaks.most(cells));
                    }
                }
            }
            found.push((tile, squares));
        }
        let most = peaks.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if monitor.cancelled() {
            return Err(Error::Cancelled.into());
        }
        let needed = matters(ways, &panel, most);
        if most == f64::NEG_INFINITY || needed.is_empty() {
            return Ok(());
        }
        let eyes = own.eyes(&panel);
        let seeing = needed.iter().map(|_| eyes.seeing());
        let seeing: Vec<_> = seeing.collect::<Result<_, _>>()?;
        let mut most = 1;
        loop {
            let levels = Peaks::from_values(panel.size, SIDE as usize, &peaks)?.levels()?;
            let marks = march::marks(count, false)?;
            for (&way, seen) in needed.iter().zip(&seeing) {
                let Way { step, slopes, .. } = &mut ways[way];
                let lines = eyes.lines(*step, cells(&panel));
                let goal = (&levels, &marks[..], most);
                eyes.mark(goal, seen, &lines, [self.rise, drop], slopes, monitor)?;
            }
            let marks: Vec<bool> = marks.into_iter().map(AtomicBool::into_inner).collect();
            let mut seeing_all = seeing.iter().flatten();
            if !seeing_all.any(|seen| seen.load(Ordering::Relaxed)) {
                return Ok(());
            }
            for (peak, _) in peaks.iter_mut().zip(&marks).filter(|(_, marked)| **marked) {
                *peak = f64::NEG_INFINITY;
            }
            most *= 3;
            let is_marked = |[columns, rows]: &[Range<usize>; 2]| {
                let mut rows = rows.clone();
                rows.any(|row| marks[row * width..][columns.clone()].contains(&true))
            };
            let tiles = found.iter().filter(|(_, squares)| is_marked(squares));
            read.tiles.extend(tiles.map(|(tile, _)| tile));
            let mut fields = Vec::new();
            split((&marks, width), [0..width, 0..height], &mut fields);
            for [columns, rows] in fields {
                let place = |[columns, rows]: [Range<usize>; 2]| {
                    let first = square([columns.start, rows.start]);
                    let last = square([columns.end - 1, rows.end - 1]);
                    first
                        .hull(&last)
                        .within(&own.whole)
                        .with_margin([1; 2], &own.whole)
                };
                // With squares as these, and room for eight eyes beside what is known.
                let first = square([columns.start, rows.start]);
                let last = square([columns.end - 1, rows.end - 1]);
                let all = first.hull(&last).wider([SIDE; 2]);
                let mut window = Window::new(all, f64::NAN)?;
                let own_marks: Vec<bool> = rows
                    .clone()
                    .flat_map(|row| &marks[row * width..][columns.clone()])
                    .copied()
                    .collect();
                let (mut parts, mut has_holes) = (Vec::new(), false);
                for [c, r] in rectangles(&own_marks, columns.len()) {
                    let moved = |range: Range<usize>, by: usize| range.start + by..range.end + by;
                    let part = place([moved(c, columns.start), moved(r, rows.start)]);
                    let heights = self.read(&part, read)?;
                    has_holes |= HeightField::new(part.size, &heights, transform)?.has_holes();
                    window.put(&part, &heights);
                    parts.push((part, heights));
                }
                let mut raise = |part: &Tile, field: &HeightField<'_>| -> Result<(), Error> {
                    let march = March::new(field, self.rise, drop)?;
                    let heights = field.heights().iter().copied();
                    let matter = matters(ways, part, heights.fold(f64::NEG_INFINITY, f64::max));
                    let seeing = needed.iter().zip(&seeing);
                    for (&way, seen) in seeing.filter(|(way, _)| matter.contains(way)) {
                        let Way {
                            azimuth, slopes, ..
                        } = &mut ways[way];
                        march.raise_of((&own.eyes(part), Some(seen)), *azimuth, slopes, monitor)?;
                    }
                    Ok(())
                };
                if has_holes {
                    for (part, heights) in &parts {
                        raise(part, &HeightField::new(part.size, heights, transform)?)?;
                    }
                } else {
                    let heights = &window.heights;
                    raise(&all, &HeightField::of_parts(all.size, heights, transform))?;
                }
            }
            for &way in &needed {
                ways[way].find_least();
            }
        }
    }
}

/// Divides squares into rectangles of which enough squares have marks.
fn split(
    (marks, width): (&[bool], usize),
    [columns, rows]: [Range<usize>; 2],
    found: &mut Vec<[Range<usize>; 2]>,
) {
    let (mut count, mut ends) = (0, [[usize::MAX, 0]; 2]);
    for row in rows {
        for column in columns.clone().filter(|column| marks[row * width + column]) {
            count += 1;
            for (end, at) in ends.iter_mut().zip([column, row]) {
                *end = [end[0].min(at), end[1].max(at + 1)];
            }
        }
    }
    if count == 0 {
        return;
    }
    let all = ends.map(|[first, end]| first..end);
    let area = all[0].len() * all[1].len();
    if area <= FIELD[0] || area <= FIELD[1].min(FIELD[2] * count) {
        return found.push(all);
    }
    let axis = usize::from(all[1].len() > all[0].len());
    let middle = all[axis].start + all[axis].len() / 2;
    let (mut first, mut second) = (all.clone(), all.clone());
    first[axis].end = middle;
    second[axis].start = middle;
    split((marks, width), first, found);
    split((marks, width), second, found);
}
