//! Horizons: the upper envelope of straight edges as an eye sees them.
//!
//! # Projection
//!
//! The eye is the origin, and looks along x. A point `(x, y, z)` with `x > 0` is seen at `m = y / x` and `q = z / x`. This is a
//! perspective projection, so straight edges stay straight, and of two points at the same `m` the one with the larger `q` is above
//! the line of sight to the other one. A target is hidden if an edge before it is above it. Over a triangle, `q` along a line of
//! sight is largest at one of both edges that the line crosses. So edges are all that counts.
//!
//! # Precision
//!
//! All is computed in double precision. Edges that are above the horizon by less than [`TOUCH`] do not change it, since neighbours
//! share their ends, which are rounded differently. So a horizon is right to [`TOUCH`] and some units in the last place.

/// Slopes that differ by less count as equal.
pub const TOUCH: f64 = 1e-13;

/// A point as an eye sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// To the side, in multiples of the distance ahead.
    pub m: f64,
    /// Up, in multiples of the distance ahead. NaN if there is nothing.
    pub q: f64,
}

impl Point {
    /// Projection of a point.
    pub fn new(x: f64, y: f64, z: f64) -> Self {
        Self { m: y / x, q: z / x }
    }
}

/// A straight edge between two points.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    near: Point,
    far: Point,
}

impl Edge {
    /// An edge; `far` is not nearer to the eye than `near`. Edges with NaN, or of which the eye sees the end only, are left out.
    pub fn new(near: Point, far: Point) -> Self {
        Self { near, far }
    }

    /// Ends in the order of `m`.
    fn ends(&self) -> [Point; 2] {
        match self.near.m <= self.far.m {
            true => [self.near, self.far],
            false => [self.far, self.near],
        }
    }

    fn is_seen(&self) -> bool {
        let [first, second] = self.ends();
        first.m < second.m && !self.near.q.is_nan() && !self.far.q.is_nan()
    }

    fn line(&self) -> Line {
        let Self { near, far } = self;
        // The far end has the smaller numbers, and the smaller errors.
        Line {
            point: *far,
            slope: (near.q - far.q) / (near.m - far.m),
        }
    }
}

/// A line through a point.
#[derive(Clone, Copy, Debug)]
struct Line {
    point: Point,
    slope: f64,
}

impl Line {
    #[inline]
    fn at(&self, m: f64) -> f64 {
        self.point.q + self.slope * (m - self.point.m)
    }
}

/// A part of the horizon, up to where the next one begins.
#[derive(Clone, Copy, Debug)]
struct Piece {
    from: f64,
    line: Line,
}

/// A part of an edge that is above the horizon.
#[derive(Clone, Copy, Debug)]
struct Raised {
    from: f64,
    to: f64,
    line: Line,
}

/// Upper envelope of edges between two values of `m`.
pub struct Horizon {
    pieces: Vec<Piece>,
    end: f64,
    raised: Vec<Raised>,
    /// Room for the next envelope.
    next: Vec<Piece>,
}

impl Horizon {
    /// A horizon without any edge from `start` to `end`.
    pub fn new(start: f64, end: f64) -> Self {
        let point = Point {
            m: start,
            q: f64::NEG_INFINITY,
        };
        let line = Line { point, slope: 0.0 };
        Self {
            pieces: vec![Piece { from: start, line }],
            end,
            raised: Vec::new(),
            next: Vec::new(),
        }
    }

    /// End of a piece.
    #[inline]
    fn end_of(&self, piece: usize) -> f64 {
        self.pieces
            .get(piece + 1)
            .map_or(self.end, |next| next.from)
    }

    /// Adds edges that do not overlap, in ascending order of `m`. Parts beyond the ends of the horizon are left out.
    pub fn raise(&mut self, edges: impl Iterator<Item = Edge>) {
        self.raised.clear();
        let mut last = self.pieces[0].from;
        let mut piece = 0;
        for edge in edges {
            let [first, second] = edge.ends();
            let (from, to) = (first.m.max(last), second.m.min(self.end));
            if !(from < to && edge.is_seen()) {
                continue;
            }
            last = to;
            while self.end_of(piece) <= from {
                piece += 1;
            }
            // Most edges are below one piece.
            let line = self.pieces[piece].line;
            let is_below = |end: Point| end.q <= line.at(end.m);
            if first.m == from
                && second.m <= self.end_of(piece)
                && is_below(first)
                && is_below(second)
            {
                continue;
            }
            self.compare(edge.line(), [from, to], piece);
        }
        if !self.raised.is_empty() {
            self.rebuild();
        }
    }

    /// Notes the parts of a line that are above the pieces from `piece` on.
    fn compare(&mut self, line: Line, [mut from, to]: [f64; 2], mut piece: usize) {
        let begun = self.raised.len();
        loop {
            let until = self.end_of(piece).min(to);
            let other = self.pieces[piece].line;
            let [left, right] = [from, until].map(|m| line.at(m) - other.at(m));
            let crossing = || from + (until - from) * (left / (left - right));
            let part = match (left > TOUCH, right > TOUCH) {
                (false, false) => None,
                (true, false) if right < -TOUCH => Some((from, crossing())),
                (false, true) if left < -TOUCH => Some((crossing(), until)),
                _ => Some((from, until)),
            };
            if let Some((from, to)) = part.filter(|(from, to)| from < to) {
                match self.raised[begun..].last_mut() {
                    Some(last) if last.to == from => last.to = to,
                    _ => self.raised.push(Raised { from, to, line }),
                }
            }
            if until >= to {
                break;
            }
            from = until;
            piece += 1;
        }
    }

    /// Replaces what is below raised parts.
    fn rebuild(&mut self) {
        self.next.clear();
        let mut piece = 0;
        for raised in &self.raised {
            let before = self.pieces[piece..]
                .iter()
                .take_while(|piece| piece.from < raised.from)
                .count();
            self.next
                .extend_from_slice(&self.pieces[piece..piece + before]);
            piece += before;
            // A piece that begins where this part begins has no length left.
            if self
                .next
                .last()
                .is_some_and(|last| last.from >= raised.from)
            {
                self.next.pop();
            }
            self.next.push(Piece {
                from: raised.from,
                line: raised.line,
            });
            while self
                .pieces
                .get(piece)
                .is_some_and(|piece| piece.from <= raised.to)
            {
                piece += 1;
            }
            // The first raised part begins at the first piece or behind it, so there is a piece before.
            if raised.to < self.end_of(piece - 1) {
                self.next.push(Piece {
                    from: raised.to,
                    line: self.pieces[piece - 1].line,
                });
            }
        }
        self.next.extend_from_slice(&self.pieces[piece..]);
        std::mem::swap(&mut self.pieces, &mut self.next);
    }

    /// Lowest heights of the horizon, for ranges that begin at ascending values of `m`.
    pub fn lows(&self) -> Lows<'_> {
        Lows {
            horizon: self,
            piece: 0,
        }
    }

    /// Height of the horizon for ascending values of `m`, which are between its ends.
    pub fn heights(&self) -> Heights<'_> {
        Heights {
            horizon: self,
            piece: 0,
        }
    }
}

/// Heights of a horizon from one end to the other.
pub struct Heights<'a> {
    horizon: &'a Horizon,
    piece: usize,
}

impl Heights<'_> {
    /// Height at `m`, which is not smaller than the one before.
    #[inline]
    pub fn at(&mut self, m: f64) -> f64 {
        while self.piece + 1 < self.horizon.pieces.len() && self.horizon.end_of(self.piece) <= m {
            self.piece += 1;
        }
        let pieces = &self.horizon.pieces;
        let height = pieces[self.piece].line.at(m);
        // Both pieces end where one becomes the other.
        match self.piece.checked_sub(1) {
            Some(before) if pieces[self.piece].from == m => height.max(pieces[before].line.at(m)),
            _ => height,
        }
    }
}

/// Lowest heights of a horizon from one end to the other.
pub struct Lows<'a> {
    horizon: &'a Horizon,
    piece: usize,
}

impl Lows<'_> {
    /// Lowest height in a range, which does not begin before the last one. Infinite if the range is beyond the ends.
    pub fn at(&mut self, from: f64, to: f64) -> f64 {
        let Horizon { pieces, end, .. } = self.horizon;
        let (from, to) = (from.max(pieces[0].from), to.min(*end));
        if !(from <= to) {
            return f64::INFINITY;
        }
        while self.piece + 1 < pieces.len() && self.horizon.end_of(self.piece) <= from {
            self.piece += 1;
        }
        let mut low = f64::INFINITY;
        for (piece, Piece { from: start, line }) in pieces.iter().enumerate().skip(self.piece) {
            if *start > to || low == f64::NEG_INFINITY {
                break;
            }
            low = low
                .min(line.at(start.max(from)))
                .min(line.at(self.horizon.end_of(piece).min(to)));
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudorandom numbers from 0 to 1.
    fn numbers(mut state: u64) -> impl FnMut() -> f64 {
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1 << 24) as f64
        }
    }

    #[test]
    fn horizons_are_the_largest_of_all_edges() {
        for seed in 0..50 {
            let mut random = numbers(seed);
            let mut horizon = Horizon::new(-1.0, 1.0);
            let mut edges = Vec::new();
            for _ in 0..40 {
                let mut ends: Vec<f64> = (0..12).map(|_| 2.4 * random() - 1.2).collect();
                ends.sort_by(f64::total_cmp);
                let mut chain = Vec::new();
                for pair in ends.chunks_exact(2) {
                    let [a, b] = [pair[0], pair[1]].map(|m| Point { m, q: random() });
                    chain.push(if random() < 0.5 {
                        Edge::new(a, b)
                    } else {
                        Edge::new(b, a)
                    });
                }
                horizon.raise(chain.iter().copied());
                edges.extend(chain);
                let mut heights = horizon.heights();
                for step in 0..200 {
                    let m = -1.0 + f64::from(step) * 0.01;
                    let over = edges.iter().filter(|edge| {
                        let [first, second] = edge.ends();
                        first.m <= m && m <= second.m
                    });
                    let most = over
                        .map(|edge| edge.line().at(m))
                        .fold(f64::NEG_INFINITY, f64::max);
                    let found = heights.at(m);
                    assert!(
                        found == most || (found - most).abs() < 1e-12,
                        "{found} at {m}, not {most}"
                    );
                }
            }
            let mut lows = horizon.lows();
            for step in 0..20 {
                let [from, to] = [0.0, 0.3].map(|more| -1.1 + f64::from(step) * 0.1 + more);
                let low = lows.at(from, to);
                let mut heights = horizon.heights();
                for part in 0..=100 {
                    let m = (from + 0.003 * f64::from(part)).clamp(-1.0, 1.0);
                    if (from..=to).contains(&m) {
                        assert!(low <= heights.at(m) + 1e-12, "{low} from {from} to {to}");
                    }
                }
            }
            assert!(horizon.pieces.is_sorted_by(|a, b| a.from < b.from));
        }
    }

    #[test]
    fn edges_without_width_or_value_are_left_out() {
        let mut horizon = Horizon::new(0.0, 1.0);
        let point = |m, q| Point { m, q };
        let edges = [
            Edge::new(point(0.2, 1.0), point(0.2, 9.0)),
            Edge::new(point(0.3, f64::NAN), point(0.4, 9.0)),
            Edge::new(point(2.0, 3.0), point(3.0, 9.0)),
        ];
        horizon.raise(edges.into_iter());
        assert_eq!(horizon.heights().at(0.35), f64::NEG_INFINITY);
        assert_eq!(horizon.pieces.len(), 1);
    }
}
