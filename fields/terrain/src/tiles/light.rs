//! Light of a tile: what hides it, as one window around the tile.
//!
//! A ray of light climbs alike wherever it is, so that no cell has to be walked from to know what may hide it. Rays that pass a
//! strip of the plan have keys, as in [`shadows`](crate::shadows): the height of the eye less what a ray climbs on the way there.
//! A square matters if its peak has a key as high as the lowest one of the eyes behind it in one of its strips.
//!
//! All that matters is read into one window, which has low heights elsewhere. An edge between cells of which none matters is
//! nowhere above a ray, whatever the heights of its ends are as long as they are not higher, and the cells around those that
//! matter were read. So the window gives the answers of the whole raster.

use std::ops::Range;

use super::{Own, Pull, Read, Tile, Tiles, Way, Window, rectangles};
use crate::crossing::floor;
use crate::shadows::STEEP;
use crate::{Error, HeightField, March, Monitor, Peaks, Shadows, memory, monitor::Share};

/// Most cells of a window, which has up to 24 bytes for each, and most for each own cell, since walks from few cells cost less.
const MOST: [usize; 2] = [12 << 20, 256];

/// Rays from the cells of a tile towards a light.
pub(super) struct Beam {
    /// Whether rays pass more columns than rows, and go towards the last ones.
    is_turned: bool,
    is_down: bool,
    /// Columns and height per row, or rows and height per column.
    shift: f64,
    climb: f64,
    /// Rows to the nearest edge, or less.
    nearest: f64,
    lowest: f64,
    /// Number of the first strip.
    first: isize,
    /// Columns and rows of the eyes, across and ahead.
    own: [[f64; 2]; 2],
    /// Rows from the last eye to the last marked square.
    far: f64,
    /// For each strip of a column, the lowest key of its eyes.
    keys: Vec<f64>,
}

impl Beam {
    /// Rays from all cells with data, which are `rise` higher.
    fn new(own: &Own, step: [f64; 2], slope: f64, rise: f64) -> Result<Self, Error> {
        let [columns, rows] = step;
        let is_turned = columns.abs() > rows.abs();
        let [minor, major] = if is_turned { [rows, columns] } else { step };
        let shift = minor / major.abs();
        let mut beam = Self {
            is_turned,
            is_down: major > 0.0,
            shift,
            climb: slope.clamp(-STEEP, STEEP) / major.abs(),
            nearest: (1.0 - 1e-9) / (1.0 + shift.abs()),
            lowest: own.lowest + rise,
            first: 0,
            own: [[0.0; 2]; 2],
            far: 0.0,
            keys: Vec::new(),
        };
        let all = Tile {
            at: [0; 2],
            size: own.tile.size,
        };
        beam.own = beam.ranges(&all, 0);
        let places = beam.places(beam.own);
        beam.first = floor(places[0]) - 1;
        let count = (floor(places[1]) - beam.first + 2) as usize;
        beam.keys = memory::filled("keys", count, f64::INFINITY)?;
        // Either columns or rows lead ahead.
        let [columns, rows] = [0, 1].map(|axis| {
            let places = (0..own.tile.size[axis]).map(|at| {
                let mut at = [[0.0; 2], [0.0; 2], [at as f64; 2]];
                at.swap(axis, 2);
                let [[across, _], [ahead, _]] = beam.turned([at[0], at[1]]);
                let strip = across as isize + floor(-beam.shift * ahead);
                (strip, beam.climb * ahead - rise)
            });
            places.collect::<Vec<_>>()
        });
        let own_rows = own.heights.chunks_exact(columns.len());
        for (heights, (line, high)) in own_rows.zip(rows) {
            let first = line - beam.first;
            for (height, (line, higher)) in heights.iter().zip(&columns) {
                let key = &mut beam.keys[(first + line) as usize];
                let own = height - (high + higher + rise);
                *key = if own < *key { own } else { *key };
            }
        }
        Ok(beam)
    }

    /// Least and most columns and rows, as places across and ahead.
    fn turned(&self, [columns, rows]: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
        let [across, ahead] = if self.is_turned {
            [rows, columns]
        } else {
            [columns, rows]
        };
        match self.is_down {
            true => [across, ahead],
            false => [across, [-ahead[1], -ahead[0]]],
        }
    }

    /// Places of a rectangle, and so many cells more on each side.
    fn ranges(&self, tile: &Tile, more: i64) -> [[f64; 2]; 2] {
        let end = tile.end();
        self.turned(
            [0, 1].map(|axis| [(tile.at[axis] - more) as f64, (end[axis] - 1 + more) as f64]),
        )
    }

    /// Where the outermost rays of a rectangle begin.
    fn places(&self, [across, ahead]: [[f64; 2]; 2]) -> [f64; 2] {
        let moved = ahead.map(|ahead| -self.shift * ahead);
        [
            across[0] + moved[0].min(moved[1]),
            across[1] + moved[0].max(moved[1]),
        ]
    }

    /// Whether a rectangle with this peak, seen from the first eye, may hide the light of an eye.
    fn matters(&self, tile: &Tile, peak: f64) -> bool {
        let climb = self.climb;
        if climb > 0.0 && peak < self.lowest + climb * self.nearest {
            return false;
        }
        // Edges have ends beside the rectangle.
        let all = self.ranges(tile, 1);
        let places = self.places(all);
        let index = |place: f64| floor(place).saturating_sub(self.first);
        let first = (index(places[0]) - 1).max(0) as usize;
        let end = ((index(places[1]) + 2).max(0) as usize).min(self.keys.len());
        (first..end).any(|strip| {
            let place = (self.first + strip as isize) as f64;
            // The first eye is behind the last edge.
            let [start, _] = self.ways(self.own, place);
            let [near, far] = self.ways(all, place);
            let near = near.max(start + self.nearest);
            let own = peak - climb * if climb > 0.0 { near } else { far };
            let key = self.keys[strip];
            // Much more than is rounded.
            near <= far && own >= key - 1e-9 * (key.abs() + peak.abs())
        })
    }

    /// How far ahead rays of a strip are in a rectangle.
    fn ways(&self, [across, ahead]: [[f64; 2]; 2], place: f64) -> [f64; 2] {
        let sides = [across[0] - place - 1.0 - 1e-6, across[1] - place + 1e-6];
        let sides = sides.map(|side| side / self.shift);
        match self.shift {
            0.0 => ahead,
            shift if shift > 0.0 => [ahead[0].max(sides[0]), ahead[1].min(sides[1])],
            _ => [ahead[0].max(sides[1]), ahead[1].min(sides[0])],
        }
    }
}

/// Marks the squares of a level that matter to a beam: of a tile, seen from the first eye, some of its columns and rows.
fn mark(
    beam: &mut Beam,
    tile: &Tile,
    (levels, marks): (&[Peaks], &mut [bool]),
    [columns, rows]: [Range<usize>; 2],
) {
    let [finer @ .., level] = levels else {
        return;
    };
    let [own, most] = [level.side(), level.size()[0]];
    for row in rows {
        for column in columns.clone() {
            let cell = [column, row].map(|at| (at * own) as i64);
            let square = Tile {
                at: [0, 1].map(|axis| tile.at[axis] + cell[axis]),
                size: [own; 2],
            };
            let peak = level.around(cell.map(|at| at as isize));
            let peak = peak.map_or(f64::NEG_INFINITY, |(_, peak)| peak);
            if !beam.matters(&square.within(tile), peak) {
                continue;
            }
            match finer.last() {
                None => {
                    marks[row * most + column] = true;
                    let [_, [_, ahead]] = beam.ranges(&square, 1);
                    beam.far = beam.far.max(ahead - beam.own[1][1]);
                }
                Some(next) => {
                    let count = own / next.side();
                    let parts = |at: usize, size: usize| at * count..((at + 1) * count).min(size);
                    let [width, height] = next.size();
                    let parts = [parts(column, width), parts(row, height)];
                    mark(beam, tile, (finer, marks), parts);
                }
            }
        }
    }
}

impl<T: Tiles> Pull<'_, T> {
    /// Light of a tile from directions. Adds the parts of tiles that were read.
    pub(super) fn light(
        &self,
        own: &Own,
        directions: &[[f64; 2]],
        read: &mut Read,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<u64>>, T::Error> {
        let halves = |read: &mut Read| {
            let (first, second) = directions.split_at(directions.len() / 2);
            let mut planes = self.light(own, first, read, &Share(monitor, [0, 2]))?;
            planes.extend(self.light(own, second, read, &Share(monitor, [1, 2]))?);
            Ok(planes)
        };
        let is_low = |[_, slope]: &[f64; 2]| *slope < 0.0;
        match directions {
            [direction] if is_low(direction) => return self.walk(own, *direction, read, monitor),
            _ if directions.iter().any(is_low) => return halves(read),
            _ => {}
        }
        let field = own.field(self.tiles)?;
        let mut tiles: Vec<Option<([Peaks; 3], Vec<bool>)>> = Vec::new();
        tiles.resize_with(own.order.len(), || None);
        let mut rows = memory::room("rows", directions.len())?;
        for &[azimuth, slope] in directions {
            if monitor.cancelled() {
                return Err(Error::Cancelled.into());
            }
            let mut beam = Beam::new(own, field.step(azimuth), slope, self.rise)?;
            for (&tile, squares) in own.order.iter().zip(&mut tiles) {
                let place = own.place(&self.tiles.tiles()[tile]);
                if !beam.matters(&place, self.tiles.peak(tile)) {
                    continue;
                }
                if squares.is_none() {
                    let levels = self.peaks_of(tile)?.levels()?;
                    let [columns, rows] = levels[0].size();
                    let marks = memory::filled("marks", columns * rows, false)?;
                    *squares = Some((levels, marks));
                }
                if let Some((levels, marks)) = squares {
                    let all = levels[2].size().map(|size| 0..size);
                    mark(&mut beam, &place, (&levels[..], &mut marks[..]), all);
                }
            }
            rows.push(beam.far as usize);
        }
        let mut parts = Vec::new();
        for (&tile, squares) in own.order.iter().zip(tiles) {
            if let Some((levels, marks)) = squares {
                let (side, place) = (levels[0].side(), &self.tiles.tiles()[tile]);
                for squares in rectangles(&marks, levels[0].size()[0]) {
                    let at = |axis: usize, at: usize| place.at[axis] + (at * side) as i64;
                    let first = [0, 1].map(|axis| at(axis, squares[axis].start));
                    let end = [0, 1].map(|axis| at(axis, squares[axis].end));
                    let part = Tile::between(first, end).within(place);
                    parts.push((tile, part.with_margin([1; 2], &own.whole)));
                }
            }
        }
        let around = |all: Tile, (_, part): &(usize, Tile)| all.hull(part);
        let all = parts.iter().fold(own.window, around);
        if all.cells() > MOST[0].min(MOST[1] * own.heights.len()) {
            return match directions {
                [direction] => self.walk(own, *direction, read, monitor),
                _ => halves(read),
            };
        }
        // Below all eyes.
        let low = (own.lowest - 1.0).min(own.lowest.next_down());
        let low = if low.is_finite() { low } else { 0.0 };
        let mut window = Window::new(all, low)?;
        window.put(&own.window, &own.around);
        for (tile, part) in &parts {
            read.tiles.insert(*tile);
            window.put(part, &self.read(part, read)?);
        }
        let field = HeightField::new(all.size, &window.heights, self.tiles.transform())?;
        let shadows = Shadows::new(&field, self.rise)?;
        let part = [0, 1].map(|axis| {
            let first = (own.tile.at[axis] - all.at[axis]) as usize;
            first..first + own.tile.size[axis]
        });
        Ok(shadows.all_lit_in(directions, &part, &rows, monitor)?)
    }

    /// The same for a single direction, by walks from all cells to one part after the other.
    fn walk(
        &self,
        own: &Own,
        [azimuth, slope]: [f64; 2],
        read: &mut Read,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Vec<u64>>, T::Error> {
        // A horizon just below the light; nothing comes from straight below, and none is above infinity.
        let start = match slope == f64::NEG_INFINITY {
            true => f64::INFINITY,
            false => slope.clamp(-STEEP, STEEP).next_down(),
        };
        let mut slopes = memory::filled("slopes", own.heights.len(), start)?;
        let field = own.field(self.tiles)?;
        let march = March::new(&field, self.rise, 0.0)?;
        march.raise(&own.eyes(&own.window), azimuth, &mut slopes, monitor)?;
        let mut ways = [Way::new(azimuth, field.step(azimuth), slopes)];
        self.raise(own, &mut ways, 0.0, read, monitor)?;
        let [width, height] = own.tile.size;
        let words = width.div_ceil(64);
        let mut plane = memory::filled("words", words * height, 0)?;
        let cells = own.heights.iter().zip(&ways[0].slopes).enumerate();
        for (cell, (height, &own)) in cells {
            let [column, row] = [cell % width, cell / width];
            let is_lit = own == start && own < f64::INFINITY && !height.is_nan();
            plane[row * words + column / 64] |= u64::from(is_lit) << (column % 64);
        }
        Ok(vec![plane])
    }
}
