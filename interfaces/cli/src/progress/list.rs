//! The work of an experiment: what is done, and how long the rest may take.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use antumbra_lab::{Step, Work};

/// Share of the current piece from which its whole time is estimated.
const TELLING: f64 = 0.05;

/// Pieces of work by kind, with what they weigh: about how long each takes beside the others.
pub struct List {
    kinds: [Kind; 3],
    /// When the piece under way was begun.
    since: Instant,
    /// Pieces under way that are finished together.
    together: usize,
    done: usize,
    spent: Duration,
}

#[derive(Default)]
struct Kind {
    /// Number and weight of the pieces that are left, scene by scene.
    left: VecDeque<(usize, f64)>,
    /// Weight of what was worked on, and how long that took.
    weight: f64,
    spent: Duration,
}

/// How far the work is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Part that is done, in 0..=1.
    pub share: f64,
    /// Time that the rest may take, if anything is known about it.
    pub left: Option<Duration>,
}

impl Kind {
    /// Seconds per weight, if any piece is done.
    fn pace(&self) -> Option<f64> {
        (self.weight > 0.0).then(|| self.spent.as_secs_f64() / self.weight)
    }

    fn weight_left(&self) -> f64 {
        self.left
            .iter()
            .map(|(count, weight)| *count as f64 * weight)
            .sum()
    }

    /// Takes one piece from the list. Returns its weight.
    fn take(&mut self) -> Option<f64> {
        while self.left.front().is_some_and(|(count, _)| *count == 0) {
            self.left.pop_front();
        }
        let (count, weight) = self.left.front_mut()?;
        *count -= 1;
        Some(*weight)
    }
}

impl List {
    /// A list of nothing.
    pub fn new() -> Self {
        Self {
            kinds: Default::default(),
            since: Instant::now(),
            together: 1,
            done: 0,
            spent: Duration::ZERO,
        }
    }

    /// All pieces that are left, in place of those known so far.
    pub fn expect(&mut self, left: &[Work]) {
        for kind in &mut self.kinds {
            kind.left.clear();
        }
        for work in left {
            let kind = &mut self.kinds[work.step as usize];
            kind.left.push_back((work.count, work.weight));
        }
    }

    /// A piece is begun. The time since the last one belongs to it: a scene was lowered.
    pub fn begin(&mut self) {
        self.together = 1;
    }

    /// The piece that was begun is several.
    pub fn together(&mut self, pieces: usize) {
        self.together = pieces;
    }

    /// Whether several pieces are under way, as trees that are compared on one picture.
    pub fn is_together(&self) -> bool {
        self.together > 1
    }

    /// A piece is finished: now, or before if it was not worked on.
    pub fn finished(&mut self, step: Step, worked: bool) {
        let kind = &mut self.kinds[step as usize];
        let weight = kind.take();
        self.done += 1;
        if worked {
            let spent = self.since.elapsed();
            kind.weight += weight.unwrap_or(0.0);
            kind.spent += spent;
            self.spent += spent;
            self.since = Instant::now();
        }
    }

    /// Number of the piece under way and of all.
    pub fn piece(&self) -> Option<[usize; 2]> {
        let left = self.kinds.iter().flat_map(|kind| &kind.left);
        let left: usize = left.map(|(count, _)| count).sum();
        (left > 0).then(|| [self.done + 1, self.done + left])
    }

    /// How far the work is, if `inside` is the share of the pieces under way that is done. These are of the first kind
    /// that is left.
    pub fn estimate(&self, inside: f64) -> Estimate {
        let under_way = self.since.elapsed().as_secs_f64();
        let current = self.kinds.iter().find(|kind| kind.weight_left() > 0.0);
        let weight_under_way = current.map_or(0.0, |kind| {
            let (count, weight) = kind
                .left
                .iter()
                .find(|(count, _)| *count > 0)
                .copied()
                .unwrap_or_default();
            weight * self.together.min(count) as f64
        });
        let guess = (inside > TELLING && weight_under_way > 0.0)
            .then(|| under_way / inside / weight_under_way);
        // A kind that nobody has seen goes at the pace of the others.
        let spent: f64 = self.spent.as_secs_f64();
        let weight: f64 = self.kinds.iter().map(|kind| kind.weight).sum();
        let common = (weight > 0.0).then(|| spent / weight).or(guess);
        let left = |pace: f64| {
            let of = |kind: &Kind| kind.pace().unwrap_or(pace) * kind.weight_left();
            let all: f64 = self.kinds.iter().map(of).sum();
            let begun = current.and_then(Kind::pace).unwrap_or(pace) * weight_under_way;
            // A piece that takes longer than expected is about to end.
            all - begun * inside.max((under_way / begun.max(1e-9)).min(1.0))
        };
        let known = common.map(|pace| left(pace).max(0.0));
        // Before anything is known, weights are seconds.
        let rest = known.unwrap_or_else(|| left(1.0).max(0.0));
        let gone = spent + under_way;
        Estimate {
            share: (gone / (gone + rest).max(1e-9)).min(1.0),
            left: known.map(|left| Duration::from_secs_f64(left.min(1e9))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn work(step: Step, count: usize, weight: f64) -> Work {
        Work {
            step,
            count,
            weight,
        }
    }

    /// Finishes a piece as if it had taken this long.
    fn work_for(list: &mut List, step: Step, seconds: u64) {
        list.since -= Duration::from_secs(seconds);
        list.finished(step, true);
    }

    fn seconds_left(list: &List, inside: f64) -> f64 {
        let left = list.estimate(inside).left.expect("known times");
        left.as_secs_f64()
    }

    #[test]
    fn the_rest_takes_as_long_as_what_is_done_did() {
        let mut list = List::new();
        assert_eq!(list.piece(), None);
        // A small scene and one of ten times its weight.
        let all = [
            work(Step::Rendering, 3, 1.0),
            work(Step::Replay, 10, 0.1),
            work(Step::Rendering, 2, 10.0),
        ];
        list.expect(&all);
        assert_eq!(list.piece(), Some([1, 15]));
        assert_eq!(list.estimate(0.0).left, None);
        work_for(&mut list, Step::Rendering, 100);
        assert_eq!(list.piece(), Some([2, 15]));
        // Replays, of which none was seen, go at the pace of renderings.
        assert!((seconds_left(&list, 0.0) - (200.0 + 100.0 + 2000.0)).abs() < 2.0);
        work_for(&mut list, Step::Rendering, 100);
        work_for(&mut list, Step::Rendering, 100);
        work_for(&mut list, Step::Replay, 1);
        assert!((seconds_left(&list, 0.0) - (9.0 + 2000.0)).abs() < 2.0);
        let share = list.estimate(0.0).share;
        assert!((share - 301.0 / 2310.0).abs() < 0.01, "{share}");
        // What was done before takes no time.
        for _ in 0..9 {
            list.finished(Step::Replay, false);
        }
        assert_eq!(list.piece(), Some([14, 15]));
        assert!((seconds_left(&list, 0.0) - 2000.0).abs() < 2.0);
    }

    #[test]
    fn trees_of_one_picture_are_under_way_together() {
        let mut list = List::new();
        list.expect(&[work(Step::Comparison, 20, 1.0)]);
        list.begin();
        list.together(20);
        list.since -= Duration::from_secs(30);
        // A quarter took 30 seconds.
        assert!((seconds_left(&list, 0.25) - 90.0).abs() < 2.0);
        let share = list.estimate(0.25).share;
        assert!((share - 0.25).abs() < 0.02, "{share}");
        for _ in 0..20 {
            list.finished(Step::Comparison, true);
        }
        assert!(seconds_left(&list, 0.0) < 1.0);
    }
}
