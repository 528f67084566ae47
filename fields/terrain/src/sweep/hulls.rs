//! Upper hulls of what lines have passed, several lines at a time.

use std::ops::Range;

use super::border::Line;

/// Lines that are walked side by side: reading long runs of each row keeps the memory busy.
pub const LINES: usize = 256;

/// A number for each line.
pub type Row = [f64; LINES];

/// Distance of the points below all hulls: before all others.
const BEGIN: f64 = -1e9;

/// Heights at the same distance of all lines: NaN where a line has no surface.
#[derive(Clone, Copy)]
pub struct Points {
    pub at: f64,
    pub heights: Row,
}

/// A hull for each line: points of which each may be the horizon of somebody nearer, the last one nearest. Distances `at` are in
/// parts of a step, and heights are multiplied by their number.
///
/// Below the points of each hull are two more, whose heights are nothing and minus infinity. Nothing removes them, and the slope to the
/// upper one, minus infinity, says that there is no horizon.
///
/// Whether a point is part of a hull is as good as random, and a wrong guess costs the CPU as much as ten points. So nothing branches
/// on it: rounds over lists of lines remove one point of each at a time.
pub struct Hulls {
    /// What a round earth takes: see [`hides`].
    bend: f64,
    /// Distances and heights of the last point of each hull.
    last: [Row; 2],
    /// The same of the point before it.
    before: [Row; 2],
    /// Number of points of each hull, with the two below.
    depths: [usize; LINES],
    /// Distances and heights of all points: the first points of all lines, the second ones, ...
    points: Vec<[f64; 2]>,
    /// The point of each line that was passed last, which is no part of its hull yet, and the one before.
    held: Points,
    prior: Points,
    /// Calls of [`Hulls::reserve`] for which there is room.
    calls: usize,
}

/// Whether an eye sees `far` above `near`, so that nobody behind it has `near` as a horizon. Points are distances from the eye and
/// heights above it.
///
/// It does if `h(near) / d(near) - b d(near) <= h(far) / d(far) - b d(far)`, where `b` is what a round earth takes.
#[inline(always)]
fn hides([short, low]: [f64; 2], [long, high]: [f64; 2], bend: f64) -> bool {
    low * long - high * short <= bend * short * long * (short - long)
}

/// Some of the lines.
type List = [u16; LINES];

impl Hulls {
    pub fn new(bend: f64) -> Self {
        let none = Points {
            at: BEGIN,
            heights: [f64::NAN; LINES],
        };
        let mut hulls = Self {
            bend,
            last: [[0.0; LINES]; 2],
            before: [[0.0; LINES]; 2],
            depths: [0; LINES],
            points: vec![[0.0; 2]; 64 * LINES],
            held: none,
            prior: none,
            calls: 0,
        };
        (0..LINES).for_each(|line| hulls.begin(line));
        hulls
    }

    /// Begins a line.
    pub fn begin(&mut self, line: usize) {
        for (depth, height) in [f64::NAN, f64::NEG_INFINITY].into_iter().enumerate() {
            self.points[depth * LINES + line] = [BEGIN, height];
        }
        self.depths[line] = 2;
        [self.before[0][line], self.before[1][line]] = [BEGIN, f64::NAN];
        [self.last[0][line], self.last[1][line]] = [BEGIN, f64::NEG_INFINITY];
        self.held.heights[line] = f64::NAN;
        self.prior.heights[line] = f64::NAN;
    }

    /// Goes on with a line that came from another tile. The points that all lines passed last are at these distances.
    pub fn enter(&mut self, line: usize, [held, prior]: [f64; 2], from: &Line) {
        self.begin(line);
        (self.held.at, self.held.heights[line]) = (held, from.held);
        (self.prior.at, self.prior.heights[line]) = (prior, from.prior);
        let depth = from.points.len() + 2;
        let room = self.points.len().max(depth * LINES);
        self.points.resize(room, [0.0; 2]);
        for (index, [apart, height]) in from.points.iter().enumerate() {
            self.points[(index + 2) * LINES + line] = [held - apart, *height];
        }
        self.depths[line] = depth;
        let [last, before] = [1, 2].map(|back| self.points[(depth - back) * LINES + line]);
        [self.last[0][line], self.last[1][line]] = last;
        [self.before[0][line], self.before[1][line]] = before;
        // There may be no room for more.
        self.calls = 0;
    }

    /// What a line needs to go on in another tile behind the cell that was passed last.
    pub fn leave(&self, line: usize, place: [i64; 2]) -> Line {
        let points = (2..self.depths[line]).map(|depth| {
            let [at, height] = self.points[depth * LINES + line];
            [self.held.at - at, height]
        });
        Line {
            place,
            held: self.held.heights[line],
            prior: self.prior.heights[line],
            points: points.collect(),
        }
    }

    /// Passes points, each farther than the ones before as lines are walked from far to near.
    ///
    /// A point below the straight line between its neighbours is nobody's horizon. So a point is added to the hull when the next one
    /// is known, and half of them never are.
    #[inline(always)]
    pub fn pass(&mut self, lines: Range<usize>, new: &Points) {
        let (held, prior) = (&self.held, &self.prior);
        let [short, long] = [new.at - held.at, new.at - prior.at];
        let mut is_kept = [false; LINES];
        for line in lines.clone() {
            let height = held.heights[line];
            let near = [short, height - new.heights[line]];
            let far = [long, prior.heights[line] - new.heights[line]];
            is_kept[line] = !height.is_nan() & !hides(near, far, self.bend);
        }
        let (mut kept, mut count) = ([0; LINES], 0);
        for line in lines {
            kept[count] = line as u16;
            count += usize::from(is_kept[line]);
        }
        let held = self.held;
        let (mut list, mut left) = ([0; LINES], 0);
        for &line in &kept[..count] {
            list[left] = line;
            left += usize::from(self.hides_last(usize::from(line) % LINES, &held));
        }
        self.remove(&mut list, left, &held);
        for &line in &kept[..count] {
            let line = usize::from(line) % LINES;
            let depth = self.depths[line];
            let point = [held.at, held.heights[line]];
            self.points[depth * LINES + line] = point;
            self.depths[line] = depth + 1;
            [self.before[0][line], self.before[1][line]] = [self.last[0][line], self.last[1][line]];
            [self.last[0][line], self.last[1][line]] = point;
        }
        (self.prior, self.held) = (held, *new);
    }

    /// Removes what the points that were passed last hide from all behind them. The last points of the hulls are then their horizons.
    #[inline(always)]
    pub fn look(&mut self, lines: Range<usize>) {
        let held = self.held;
        let mut hidden = [false; LINES];
        for line in lines.clone() {
            hidden[line] = self.hides_last(line, &held);
        }
        let (mut list, mut count) = ([0; LINES], 0);
        for line in lines {
            list[count] = line as u16;
            count += usize::from(hidden[line]);
        }
        self.remove(&mut list, count, &held);
    }

    /// Whether a point hides the last point of its hull from all behind it.
    #[inline(always)]
    fn hides_last(&self, line: usize, new: &Points) -> bool {
        let [near, far] = [&self.last, &self.before].map(|[at, heights]| {
            let apart = heights[line] - new.heights[line];
            [new.at - at[line], apart]
        });
        hides(near, far, self.bend)
    }

    /// Removes the last points of the hulls on a list, and those that new points hide before them.
    #[inline(always)]
    fn remove(&mut self, list: &mut List, mut count: usize, new: &Points) {
        while count > 0 {
            let mut left = 0;
            for index in 0..count {
                let line = usize::from(list[index]) % LINES;
                let depth = self.depths[line] - 1;
                self.depths[line] = depth;
                [self.last[0][line], self.last[1][line]] =
                    [self.before[0][line], self.before[1][line]];
                [self.before[0][line], self.before[1][line]] =
                    self.points[(depth - 2) * LINES + line];
                list[left] = line as u16;
                left += usize::from(self.hides_last(line, new));
            }
            count = left;
        }
    }

    /// Makes room for so many points of each line.
    pub fn reserve(&mut self, more: usize) {
        if self.calls == 0 {
            let deepest = self.depths.iter().copied().max().unwrap_or(0);
            let wanted = (deepest + 32 * more) * LINES;
            if self.points.len() < wanted {
                self.points.resize(wanted, [0.0; 2]);
            }
            self.calls = 32;
        }
        self.calls -= 1;
    }

    /// Slopes per step to the last points, as eyes see them.
    #[inline(always)]
    pub fn slopes(&self, at: f64, eyes: &Row) -> Row {
        let [distance, height] = &self.last;
        std::array::from_fn(|line| self.slope([distance[line], height[line]], at, eyes[line]))
    }

    #[inline(always)]
    fn slope(&self, point: [f64; 2], at: f64, height: f64) -> f64 {
        let distance = at - point[0];
        (point[1] - height) / distance - self.bend * distance
    }

    /// Slope per step of the horizon of any eye: along a hull slopes rise and then fall.
    pub fn horizon(&self, line: usize, at: f64, height: f64) -> f64 {
        let slope = |depth: usize| self.slope(self.points[depth * LINES + line], at, height);
        // The point that is not there is the first.
        let mut best = self.depths[line] - 1;
        // Mostly one of the last; else by halves.
        for _ in 0..4 {
            if best == 1 || slope(best - 1) < slope(best) {
                return slope(best);
            }
            best -= 1;
        }
        let (mut low, mut high) = (1, best);
        while low < high {
            let middle = usize::midpoint(low, high);
            match slope(middle) < slope(middle + 1) {
                true => low = middle + 1,
                false => high = middle,
            }
        }
        slope(low)
    }
}
