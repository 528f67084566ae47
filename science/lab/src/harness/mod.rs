//! The harness of all measurements: works on the same questions that take turns, and their answers.
//!
//! All works take turns in one process, one run each per round, starting with another one every round: what disturbs the
//! machine for a while disturbs all of them, and ratios within a round hold while rates swing. Times are those for which
//! threads have run. The first round warms up, and its answers are kept to be compared.

mod case;
mod mesh;

use std::sync::{Mutex, PoisonError};

use antumbra::{ClosestPoint, Hit, PrimId, Surface};
use rayon::ThreadPool;

use crate::Error;
use crate::embree::{Packet, RayHit, SingleRay};
use crate::thread_time;
use crate::watch::{self, Watcher};

pub use case::{Bench, Case, Row};
pub use mesh::{Mesh, cross, dot, less, model, unit};

/// Relative difference of distances that is put down to rounding in other kernels.
pub const TOLERANCE: f32 = 1e-4;

/// Answers to a list of questions.
#[derive(Clone, Debug, PartialEq)]
pub enum Answers {
    /// Whether each ray is occluded.
    Occluded(Vec<bool>),
    /// A number for each question, such as the distance of a closest hit, infinite for none. Which primitive was hit is not
    /// compared: where two touch, kernels may differ.
    Distances(Vec<f32>),
}

impl Answers {
    /// How many questions were answered otherwise. Distances differ by more than the `tolerance` relative to the
    /// other one; at tolerance 0 by anything.
    ///
    /// # Panics
    /// If they answer different kinds or numbers of questions.
    pub fn differing_from(&self, other: &Self, tolerance: f32) -> usize {
        self.differing_by(other, [tolerance, 0.0])
    }

    /// The same, with a tolerance relative to the other distance and an absolute one on top of it.
    ///
    /// # Panics
    /// As [`Self::differing_from`].
    pub fn differing_by(&self, other: &Self, [relative, absolute]: [f32; 2]) -> usize {
        assert_eq!(self.len(), other.len(), "answers to the same questions");
        match (self, other) {
            (Self::Occluded(a), Self::Occluded(b)) => {
                a.iter().zip(b).filter(|(a, b)| a != b).count()
            }
            (Self::Distances(a), Self::Distances(b)) => {
                let tolerance = |b: f32| relative * b.abs() + absolute;
                // Any distance is near infinity by that measure.
                let near = |a: f32, b: f32| b.is_finite() && (a - b).abs() <= tolerance(b);
                let differs = |(a, b): &(&f32, &f32)| *a != *b && !near(**a, **b);
                a.iter().zip(b).filter(differs).count()
            }
            _ => panic!("answers to different questions"),
        }
    }

    /// Number of answers.
    pub fn len(&self) -> usize {
        match self {
            Self::Occluded(all) => all.len(),
            Self::Distances(all) => all.len(),
        }
    }

    /// Whether there is no answer.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Appends the answers to further questions.
    fn append(&mut self, more: Self) {
        match (self, more) {
            (Self::Occluded(all), Self::Occluded(more)) => all.extend(more),
            (Self::Distances(all), Self::Distances(more)) => all.extend(more),
            _ => panic!("answers to different questions"),
        }
    }

    /// Share of the questions that found something; 0 for none.
    pub fn occluded_share(&self) -> f64 {
        let found = match self {
            Self::Occluded(answers) => answers.iter().filter(|hit| **hit).count(),
            Self::Distances(answers) => answers.iter().filter(|t| t.is_finite()).count(),
        };
        found as f64 / self.len().max(1) as f64
    }
}

/// What a work leaves as an answer.
pub trait Answer: Clone + Send {
    /// All of them.
    fn all(all: &[Self]) -> Answers;
}

macro_rules! answer {
    ($($type:ty, $kind:ident, $answer:expr;)*) => {
        $(impl Answer for $type {
            fn all(all: &[Self]) -> Answers {
                let answer: fn(&Self) -> _ = $answer;
                Answers::$kind(all.iter().map(answer).collect())
            }
        })*
    };
}

answer! {
    bool, Occluded, |found| *found;
    Option<PrimId>, Occluded, Option::is_some;
    SingleRay, Occluded, SingleRay::is_occluded;
    f32, Distances, |number| *number;
    Option<Hit>, Distances, |hit| hit.map_or(f32::INFINITY, |hit| hit.t);
    Option<Surface>, Distances, |found| found.map_or(f32::INFINITY, |found| found.hit.t);
    Option<ClosestPoint>, Distances, |near| near.map_or(f32::INFINITY, |near| near.distance);
    RayHit, Distances, |ray| ray.found().0;
}

impl Answer for Packet<16> {
    fn all(all: &[Self]) -> Answers {
        Answers::Occluded(all.iter().flat_map(Self::occluded).collect())
    }
}

/// Questions that one thread answers, as often as wanted.
pub trait Work: Send {
    /// Makes everything as before the first run. Not timed.
    fn reset(&mut self);
    /// Answers every question. Timed.
    fn run(&mut self);
    /// The answers of the last run.
    fn answers(&self) -> Answers;
}

/// A work that answers into a list, which begins as `fresh` each time.
pub fn work<'a, A: Answer + 'a>(
    fresh: Vec<A>,
    run: impl FnMut(&mut [A]) + Send + 'a,
) -> Box<dyn Work + 'a> {
    let used = fresh.clone();
    Box::new(Filling { fresh, used, run })
}

struct Filling<A, R> {
    fresh: Vec<A>,
    used: Vec<A>,
    run: R,
}

impl<A: Answer, R: FnMut(&mut [A]) + Send> Work for Filling<A, R> {
    fn reset(&mut self) {
        self.used.clone_from_slice(&self.fresh);
    }

    fn run(&mut self) {
        (self.run)(&mut self.used);
    }

    fn answers(&self) -> Answers {
        A::all(&self.used)
    }
}

/// Answers questions one by one.
pub fn each<Q, A>(questions: &[Q], answers: &mut [A], mut answer: impl FnMut(&Q) -> A) {
    for (question, found) in questions.iter().zip(answers) {
        *found = answer(question);
    }
}

/// Times and answers of one work.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Time of every round in seconds, of the thread that ran longest.
    pub seconds: Vec<f64>,
    /// The answers.
    pub answers: Answers,
}

/// A work of each thread.
pub type Team<'a> = Vec<Box<dyn Work + 'a>>;

/// Has every team run: once to warm up and for the answers, then timed `rounds` times. Each work of a team runs on a thread of
/// its own. Time in which a thread waits for a CPU does not count, so that other work on the machine disturbs little.
///
/// # Errors
/// [`Error::Interrupted`].
pub fn measure(
    teams: Vec<Team<'_>>,
    pool: &ThreadPool,
    rounds: usize,
    watcher: &dyn Watcher,
) -> Result<Vec<Measured>, Error> {
    let teams: Vec<Vec<_>> = teams
        .into_iter()
        .map(|team| team.into_iter().map(Mutex::new).collect())
        .collect();
    let each = |which: usize, what: fn(&mut dyn Work)| {
        let times = pool.broadcast(|thread| {
            let Some(work) = teams[which].get(thread.index()) else {
                return 0.0;
            };
            let mut work = work.lock().unwrap_or_else(PoisonError::into_inner);
            let start = thread_time::seconds();
            what(&mut **work);
            thread_time::seconds() - start
        });
        times.into_iter().fold(0.0, f64::max)
    };
    let mut answers: Vec<Option<Answers>> = vec![None; teams.len()];
    let seconds = interleave(rounds, teams.len(), |which| {
        watch::check(watcher)?;
        each(which, |work| work.reset());
        let seconds = each(which, |work| work.run());
        if answers[which].is_none() {
            let parts = teams[which].iter().map(|work| {
                let work = work.lock().unwrap_or_else(PoisonError::into_inner);
                work.answers()
            });
            let whole = parts.reduce(|mut all, part| {
                all.append(part);
                all
            });
            answers[which] = Some(whole.unwrap_or(Answers::Occluded(Vec::new())));
        }
        Ok::<_, Error>(seconds)
    })?;
    let measured = seconds.into_iter().zip(answers.into_iter().flatten());
    let measured = measured.map(|(seconds, answers)| Measured { seconds, answers });
    Ok(measured.collect())
}

/// Does `count` things, interleaved: once to warm up, then `rounds` times. Returns what each gave in each round. The warm-up begins
/// with the first thing, every further round with the next.
///
/// # Errors
/// As a turn.
pub fn interleave<T, E>(
    rounds: usize,
    count: usize,
    mut turn: impl FnMut(usize) -> Result<T, E>,
) -> Result<Vec<Vec<T>>, E> {
    let mut all: Vec<Vec<T>> = (0..count).map(|_| Vec::with_capacity(rounds)).collect();
    for round in 0..=rounds {
        for place in 0..count {
            let which = (round + place) % count;
            let given = turn(which)?;
            if round > 0 {
                all[which].push(given);
            }
        }
    }
    Ok(all)
}

/// The middle value, or the mean of the two in the middle; NaN for none.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    match (values.len() / 2, values.len() % 2) {
        (0, 0) => f64::NAN,
        (half, 0) => 0.5 * (values[half - 1] + values[half]),
        (half, _) => values[half],
    }
}

/// Median over the rounds of how often `ours` is as fast as `other`.
pub fn median_ratio(ours: &[f64], other: &[f64]) -> f64 {
    median(ratios(ours, other))
}

/// Round by round, how often `ours` is as fast as `other`.
pub fn ratios(ours: &[f64], other: &[f64]) -> impl Iterator<Item = f64> {
    ours.iter().zip(other).map(|(ours, other)| other / ours)
}

/// A number, and the least and the most of its rounds.
pub fn spread(values: impl IntoIterator<Item = f64>) -> [f64; 3] {
    let values: Vec<f64> = values.into_iter().collect();
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [median(values), least, most]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_ratios() {
        assert!(median([]).is_nan());
        assert_eq!(median([3.0]), 3.0);
        assert_eq!(median([4.0, 1.0]), 2.5);
        assert_eq!(spread([9.0, 1.0, 2.0]), [2.0, 1.0, 9.0]);
        // The machine was slow in the second round.
        assert_eq!(median_ratio(&[1.0, 10.0, 1.0], &[2.0, 20.0, 2.0]), 2.0);
    }

    #[test]
    fn answers_differ_by_hit_or_distance() {
        const NONE: f32 = f32::INFINITY;
        let exact = Answers::Distances(vec![1.0, 1e6, NONE, 3.0, NONE]);
        let other = Answers::Distances(vec![1.0, 1e6 + 10.0, NONE, NONE, 2.0]);
        assert_eq!(other.differing_from(&exact, 1e-4), 2);
        assert_eq!(other.differing_from(&exact, 0.0), 3);
        assert_eq!(exact.differing_from(&exact, 0.0), 0);
        let nan = Answers::Distances(vec![f32::NAN]);
        assert_eq!(nan.differing_from(&Answers::Distances(vec![1.0]), 1.0), 1);
        assert_eq!(exact.occluded_share(), 0.6);
        let (yes, no) = (
            Answers::Occluded(vec![true]),
            Answers::Occluded(vec![false]),
        );
        assert_eq!(yes.differing_from(&no, 1.0), 1);
        assert_eq!(yes.occluded_share(), 1.0);
    }

    #[test]
    fn every_thread_runs_its_part_once_per_round() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
        let pool = pool.expect("threads");
        let log = Mutex::new(Vec::new());
        let team = |name: &'static str| -> Team {
            let part = |size: usize| {
                let log = &log;
                work(vec![false; size], move |answers: &mut [bool]| {
                    assert!(answers.iter().all(|answer| !answer), "not reset");
                    answers.fill(true);
                    log.lock().expect("no panic").push((name, size));
                })
            };
            vec![part(4), part(4), part(2)]
        };
        let found = measure(vec![team("a"), team("b")], &pool, 4, &()).expect("not interrupted");
        for measured in &found {
            assert_eq!(measured.seconds.len(), 4);
            assert_eq!(measured.answers, Answers::Occluded(vec![true; 10]));
        }
        let log = log.lock().expect("no panic");
        for name in ["a", "b"] {
            let runs = |size| log.iter().filter(|entry| **entry == (name, size)).count();
            // Once to warm up, four times timed.
            assert_eq!([runs(4), runs(2)], [10, 5]);
        }
        assert!(measure(Vec::new(), &pool, 1, &()).is_ok_and(|none| none.is_empty()));
    }
}
