//! The sweep of a viewshed: a sector of the plan, line by line, from near to far.
//!
//! A [horizon](super::envelope) has all edges that the sweep has passed. A cell of a line is seen if the line of sight to it ends above
//! the horizon. So each edge is projected once, and the work grows with the number of cells.
//!
//! # Blocks that are left out
//!
//! A line is divided into blocks of cells. If the highest cell in and around a block is below the lowest horizon before it, then no cell
//! of the block is seen, and no edge of it raises the horizon. Such blocks are left out, which changes no answer.
//!
//! Edges of a block end in the block, beside it, or in the line before. Cells `y` to the side and `x` ahead are seen at `y / x`, and
//! `|y| <= x` but for the width beyond the sector. So the near ends of edges are seen within [`BESIDE`] cells of the block.

use std::ops::Range;

use super::Limits;
use super::envelope::{Edge, Horizon, Point};
use super::view::{Side, Turned, View};
use crate::Observer;

/// Sectors of a side. They are the same for any number of threads, and so are all bits.
pub const SECTORS: usize = 4;

/// Width by which horizons reach beyond their sectors: a cell on the edge of a sector may have all its edges on the other side.
const BEYOND: f64 = 1.0 / 256.0;

/// A target is seen if it is no lower than this below the horizon, as a slope: the surface may touch the line of sight.
const GRAZING: f64 = 1e-12;

/// Cells on both sides of a block in which its edges are seen, from [`FAR`] lines on.
const BESIDE: f64 = 3.0;

/// Lines from the eye from which on blocks may be left out.
const FAR: f64 = 8.0;

/// What a sweep notes of the cells of its sector.
pub trait Note {
    /// Whether cells of blocks that are left out are noted too.
    const ALL: bool;

    /// Notes a cell that is in range, at a place of a line. Its target lacks so much to be seen, as a slope: 0 or less if it is seen,
    /// NaN without data.
    fn cell(&mut self, sector: &Sector<'_>, line: usize, at: usize, lacks: f64);
}

/// Cells of a line.
pub type Run = (u32, Range<u32>);

/// Runs of cells that are seen.
impl Note for Vec<Run> {
    const ALL: bool = false;

    #[inline(always)]
    fn cell(&mut self, _: &Sector<'_>, line: usize, at: usize, lacks: f64) {
        if lacks <= 0.0 {
            let (line, at) = (line as u32, at as u32);
            match self.last_mut() {
                Some((before, run)) if *before == line && run.end == at => run.end += 1,
                _ => self.push((line, at..at + 1)),
            }
        }
    }
}

/// A part of the plan that is swept.
pub struct Sector<'a> {
    pub view: View<'a>,
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
    /// Lines from the eye from which on blocks may be left out.
    far: f64,
}

/// A line of cells, of which some blocks are projected.
#[derive(Default)]
struct Cells {
    line: usize,
    first: usize,
    points: Vec<Point>,
    /// Whether the blocks from the block of the first cell on are projected.
    is_projected: Vec<bool>,
    has_holes: bool,
}

impl Cells {
    /// Points of a range of cells, as far as they are in reach.
    fn within(&self, range: &Range<usize>) -> (usize, &[Point]) {
        let end = self.first + self.points.len();
        let from = range.start.clamp(self.first, end);
        let to = range.end.clamp(from, end);
        (from, &self.points[from - self.first..to - self.first])
    }
}

impl<'a> Sector<'a> {
    pub fn new(
        turned: &'a Turned<'_>,
        observer: &Observer,
        limits: &Limits,
        side: Side,
        index: usize,
    ) -> Self {
        let end = |index: usize| 2.0 * index as f64 / SECTORS as f64 - 1.0;
        Self {
            view: turned.view(side, observer.place),
            height: observer.height,
            scale: 1.0 / turned.field().unit(),
            target: limits.target / turned.field().unit(),
            drop: limits.drop,
            range: limits.range,
            ends: [end(index), end(index + 1)],
            has_diagonals: matches!(side, Side::East | Side::West),
            far: FAR,
        }
    }

    /// Sweeps the sector, and notes its cells.
    pub fn sweep<N: Note>(&self, mut note: N) -> N {
        let mut horizon = Horizon::new(self.ends[0] - BEYOND, self.ends[1] + BEYOND);
        let (mut before, mut now) = (Cells::default(), Cells::default());
        let mut spans = Vec::new();
        let first = (self.view.eye[0].floor() + 1.0).max(0.0);
        let last = self.view.eye[0] + self.view.most_lines(self.range);
        let [first, end] = [first, last + 2.0].map(|at| at.min(self.view.lines as f64) as usize);
        for line in first..end {
            self.begin(line, &mut now);
            self.choose(&horizon, &now, line > first, &mut spans);
            for span in &spans {
                self.project(span, &mut now);
                if line > first {
                    self.project(span, &mut before);
                }
            }
            match line {
                _ if line > first => self.raise_strip(&mut horizon, &spans, &before, &now),
                0 => {}
                _ => self.raise_around_eye(&mut horizon, line),
            }
            let reach = now.first..now.first + now.points.len();
            let looked = match N::ALL {
                true => std::slice::from_ref(&reach),
                false => &spans,
            };
            if N::ALL {
                self.project(&reach, &mut now);
            }
            self.look(&horizon, looked, &now, &mut note);
            horizon.raise(spans.iter().flat_map(|span| {
                let (first, points) = now.within(span);
                let pairs = (first..).zip(points.windows(2));
                pairs.filter_map(|(at, pair)| {
                    let is_joined = self.view.is_joined([line, at], [line, at + 1]);
                    is_joined.then(|| Edge::new(pair[0], pair[1]))
                })
            }));
            std::mem::swap(&mut before, &mut now);
        }
        note
    }

    /// A cell as the eye sees it: distances ahead, to the side and up, in sides of cells.
    fn rise(&self, line: usize, at: usize) -> (f64, f64, f64) {
        let x = line as f64 - self.view.eye[0];
        let y = at as f64 - self.view.eye[1];
        let drop = self.drop * self.view.squared(x, y);
        let rise = self.view.height(line, at) - self.height - drop;
        (x, y, rise * self.scale)
    }

    /// Begins a line: the cells that edges of the sector may end at.
    fn begin(&self, line: usize, cells: &mut Cells) {
        let [x, y] = self.view.eye;
        let ahead = line as f64 - x;
        let low = (y + (self.ends[0] - BEYOND) * ahead).floor() - 2.0;
        let high = (y + (self.ends[1] + BEYOND) * ahead).ceil() + 3.0;
        let [low, high] = [low, high].map(|at| at.clamp(0.0, self.view.length as f64) as usize);
        let nothing = Point {
            m: f64::NAN,
            q: f64::NAN,
        };
        (cells.line, cells.first, cells.has_holes) = (line, low, false);
        cells.points.resize(high - low, nothing);
        cells.is_projected.clear();
        if low < high {
            let blocks = self.view.block(high - 1) + 1 - self.view.block(low);
            cells.is_projected.resize(blocks, false);
        }
    }

    /// Cells of a line that may be seen, or raise the horizon with their edges.
    fn choose(
        &self,
        horizon: &Horizon,
        cells: &Cells,
        has_before: bool,
        spans: &mut Vec<Range<usize>>,
    ) {
        spans.clear();
        let reach = cells.first..cells.first + cells.points.len();
        if reach.is_empty() {
            return;
        }
        let x = cells.line as f64 - self.view.eye[0];
        if !has_before || x <= self.far {
            spans.push(reach);
            return;
        }
        let drop = self.drop * self.view.least_squared(x - 1.0);
        let mut lows = horizon.lows();
        for block in self.view.block(reach.start)..=self.view.block(reach.end - 1) {
            let top = self
                .view
                .top(cells.line, block)
                .max(self.view.top(cells.line - 1, block));
            let rise = (top - self.height - drop) * self.scale + self.target;
            // Whichever is larger: the near line has the larger slopes up, and the far line the smaller ones down.
            let most = (rise / x).max(rise / (x - 1.0));
            let range = self.view.cells(block);
            let at = |at: f64| (at - self.view.eye[1]) / x;
            let low = lows.at(
                at(range.start as f64 - BESIDE),
                at(range.end as f64 + BESIDE),
            );
            if most < low - 2.0 * GRAZING {
                continue;
            }
            let range = range.start.max(reach.start)..range.end.min(reach.end);
            match spans.last_mut() {
                Some(last) if last.end == range.start => last.end = range.end,
                _ => spans.push(range),
            }
        }
    }

    /// Projects the blocks of a span, as far as that is not done.
    fn project(&self, span: &Range<usize>, cells: &mut Cells) {
        let end = cells.first + cells.points.len();
        let [from, to] = [span.start, span.end].map(|at| at.clamp(cells.first, end));
        if from >= to {
            return;
        }
        let first = self.view.block(cells.first);
        for block in self.view.block(from)..=self.view.block(to - 1) {
            if std::mem::replace(&mut cells.is_projected[block - first], true) {
                continue;
            }
            let range = self.view.cells(block);
            for at in range.start.max(cells.first)..range.end.min(end) {
                let (x, y, z) = self.rise(cells.line, at);
                let point = Point::new(x, y, z);
                cells.has_holes |= point.q.is_nan();
                cells.points[at - cells.first] = point;
            }
        }
    }

    /// Whether a cell has data.
    fn has(&self, line: usize, at: usize) -> bool {
        at < self.view.length && self.view.height(line, at).is_finite()
    }

    /// Adds the edges between two lines.
    fn raise_strip(
        &self,
        horizon: &mut Horizon,
        spans: &[Range<usize>],
        near: &Cells,
        far: &Cells,
    ) {
        let has_holes = near.has_holes || far.has_holes;
        let pairs = |span: &Range<usize>| {
            let (first, _) = near.within(span);
            let (second, _) = far.within(span);
            let from = first.max(second);
            let [near, far] = [near, far].map(|cells| cells.within(&(from..span.end)).1);
            (from, near, far)
        };
        horizon.raise(spans.iter().flat_map(|span| {
            let (from, near_at, far_at) = pairs(span);
            let edges = (from..).zip(near_at.iter().zip(far_at));
            edges.filter_map(move |(at, (&a, &b))| {
                let is_joined = self.view.is_joined([near.line, at], [far.line, at]);
                is_joined.then(|| Edge::new(a, b))
            })
        }));
        // Neighbouring diagonals may overlap.
        for odd in [0, 1] {
            horizon.raise(spans.iter().flat_map(|span| {
                let (from, near_at, far_at) = pairs(span);
                let edges = (from..).zip(near_at.iter().zip(far_at.iter().skip(1)));
                edges
                    .skip(odd)
                    .step_by(2)
                    .filter_map(move |(at, (&a, &b))| {
                        let is_joined = || self.has(near.line, at + 1) || self.has(far.line, at);
                        (!has_holes || is_joined()).then(|| Edge::new(a, b))
                    })
            }));
            if !has_holes {
                continue;
            }
            // The other diagonal is an edge where one end of the first is missing.
            horizon.raise(spans.iter().flat_map(|span| {
                let (from, near_at, far_at) = pairs(span);
                let edges = (from..).zip(near_at.iter().skip(1).zip(far_at));
                edges
                    .skip(odd)
                    .step_by(2)
                    .filter_map(move |(at, (&a, &b))| {
                        let is_edge = self.has(near.line, at) != self.has(far.line, at + 1);
                        is_edge.then(|| Edge::new(a, b))
                    })
            }));
        }
    }

    /// Adds the edges between the line behind the eye and the line ahead, as far as they are ahead of the eye.
    fn raise_around_eye(&self, horizon: &mut Horizon, line: usize) {
        let middle = self.view.eye[1];
        let low = (middle.floor() - 3.0).clamp(0.0, self.view.length as f64) as usize;
        let high = (middle.ceil() + 4.0).clamp(0.0, self.view.length as f64) as usize;
        let (near, far) = (line - 1, line);
        let mut raise = |a: usize, b: usize| {
            if self.has(near, a) && self.has(far, b) {
                horizon.raise(self.ahead([near, a], [far, b]).into_iter());
            }
        };
        for at in low..high {
            if self.view.is_joined([near, at], [far, at]) {
                raise(at, at);
            }
            if self.has(near, at + 1) || self.has(far, at) {
                raise(at, at + 1);
            }
            if self.has(near, at) != self.has(far, at + 1) {
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

    /// Notes cells of a line.
    fn look<N: Note>(
        &self,
        horizon: &Horizon,
        spans: &[Range<usize>],
        cells: &Cells,
        note: &mut N,
    ) {
        let [start, end] = self.ends;
        let x = cells.line as f64 - self.view.eye[0];
        let raised = self.target / x;
        let mut heights = horizon.heights();
        for span in spans {
            let (first, points) = cells.within(span);
            for (at, point) in (first..).zip(points) {
                let is_inside = match point.m.abs() == 1.0 {
                    true => self.has_diagonals && (start..=end).contains(&point.m),
                    false => (start..end).contains(&point.m),
                };
                if is_inside && self.is_near(x, at as f64 - self.view.eye[1]) {
                    let lacks = heights.at(point.m) - GRAZING - (point.q + raised);
                    note.cell(self, cells.line, at, lacks);
                }
            }
        }
    }

    fn is_near(&self, x: f64, y: f64) -> bool {
        self.range == f64::INFINITY || self.view.squared(x, y) <= self.range * self.range
    }
}

#[cfg(test)]
mod tests {
    use antumbra_testkit::Rng;

    use super::*;

    #[test]
    fn spans_beyond_the_reach_of_a_line_are_empty() {
        let point = Point { m: 0.0, q: 0.0 };
        let cells = Cells {
            first: 5,
            points: vec![point; 3],
            ..Cells::default()
        };
        for (start, end, from, count) in [
            (0, 2, 5, 0),
            (5, 2, 5, 0),
            (7, 6, 7, 0),
            (9, 12, 8, 0),
            (6, 20, 6, 2),
        ] {
            let (at, points) = cells.within(&(start..end));
            assert_eq!((at, points.len()), (from, count), "{start} to {end}");
        }
    }

    #[test]
    fn blocks_that_are_left_out_change_nothing() {
        for seed in 0..20 {
            let mut rng = Rng::new(seed);
            let mut random = || f64::from(rng.unit());
            let size = [
                20 + (280.0 * random()) as usize,
                20 + (280.0 * random()) as usize,
            ];
            let (rough, holes) = (3.0 * random(), 0.05 * random());
            let heights: Vec<f64> = (0..size[0] * size[1])
                .map(|cell| {
                    let [x, y] = [(cell % size[0]) as f64, (cell / size[0]) as f64];
                    let wave = 9.0 * (x / 17.0).sin() * (y / 23.0).cos();
                    match seed % 3 == 0 && random() < holes {
                        true => f64::NAN,
                        false => wave + rough * random(),
                    }
                })
                .collect();
            let field = crate::HeightField::new(size, &heights, [0.0, 1.0, 0.2, 0.0, 0.0, -1.5]);
            let field = field.expect("a field");
            let turned = Turned::new(&field).expect("memory");
            let limits = Limits {
                target: if seed % 2 == 0 { 0.0 } else { 1.0 },
                drop: 1e-4 * random(),
                range: if seed % 5 == 0 { 90.0 } else { f64::INFINITY },
            };
            for _ in 0..6 {
                let [x, y] = size.map(|size| (1.4 * random() - 0.2) * size as f64);
                let observer = Observer {
                    place: field.place([x + 0.2 * y, -1.5 * y]),
                    height: 12.0 + 10.0 * random(),
                    normal: [0.0; 3],
                };
                for side in Side::ALL {
                    for index in 0..SECTORS {
                        let mut sector = Sector::new(&turned, &observer, &limits, side, index);
                        let found = sector.sweep(Vec::<Run>::new());
                        sector.far = f64::INFINITY;
                        let all = sector.sweep(Vec::<Run>::new());
                        let cells = |runs: &[Run]| {
                            let cells = runs
                                .iter()
                                .flat_map(|(line, run)| run.clone().map(move |at| (*line, at)));
                            cells.collect::<Vec<_>>()
                        };
                        assert_eq!(cells(&found), cells(&all), "seed {seed}, {observer:?}");
                    }
                }
            }
        }
    }
}
