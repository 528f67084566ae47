//! Timing engines against each other.
//!
//! All engines take turns in one process, one repetition each per round, starting with another one every
//! round: what disturbs the machine for a while disturbs all of them, and ratios within a round hold while
//! rates swing.

use std::sync::{Mutex, PoisonError};

use antumbra::Ray;
use rayon::ThreadPool;

use super::engine::{Answers, Engine, Label, Query, Work};
use crate::Error;
use crate::thread_time;
use crate::watch::{self, Watcher};

/// Relative difference of distances that is put down to rounding in other kernels.
pub const TOLERANCE: f32 = 1e-4;

/// Times and mistakes of one engine.
pub struct Outcome {
    pub label: Label,
    /// Time of every round in seconds, of the thread that ran longest.
    pub seconds: Vec<f64>,
    /// Rays answered otherwise than the reference says. Our own engines must give the same bits, others may be
    /// off by rounding.
    pub disagreements: usize,
}

/// Has every engine that knows the query answer `rays`: once to compare the answers and to warm up, then timed
/// `rounds` times. The rays are cut into as many runs as the pool has threads, each on a thread of its own.
pub fn measure(
    engines: &[&dyn Engine],
    query: Query,
    rays: &[Ray],
    reference: &Answers,
    pool: &ThreadPool,
    rounds: usize,
    watcher: &dyn Watcher,
) -> Result<Vec<Outcome>, Error> {
    let engines: Vec<_> = engines.iter().map(|engine| (*engine, reference)).collect();
    measure_each(&engines, query, rays, pool, rounds, watcher)
}

/// [`measure`] for engines that each have right answers of their own.
pub fn measure_each(
    engines: &[(&dyn Engine, &Answers)],
    query: Query,
    rays: &[Ray],
    pool: &ThreadPool,
    rounds: usize,
    watcher: &dyn Watcher,
) -> Result<Vec<Outcome>, Error> {
    let run_length = rays.len().div_ceil(pool.current_num_threads()).max(1);
    let mut outcomes = Vec::new();
    let mut teams = Vec::new();
    for &(engine, reference) in engines {
        let workers: Option<Vec<_>> = rays
            .chunks(run_length)
            .map(|run| Some(Mutex::new(engine.work(query, run)?)))
            .collect();
        let Some(mut team) = workers.map(Team) else {
            continue;
        };
        watch::check(watcher)?;
        team.time(pool);
        let label = engine.label();
        let tolerance = if label.tree.is_some() { 0.0 } else { TOLERANCE };
        outcomes.push(Outcome {
            disagreements: team.answers(query).differing_from(reference, tolerance),
            label,
            seconds: Vec::with_capacity(rounds),
        });
        teams.push(team);
    }
    for round in 0..rounds {
        for turn in 0..teams.len() {
            watch::check(watcher)?;
            let index = (round + turn) % teams.len();
            let seconds = teams[index].time(pool);
            outcomes[index].seconds.push(seconds);
        }
    }
    Ok(outcomes)
}

/// The work of one engine, thread by thread.
struct Team<'a>(Vec<Mutex<Box<dyn Work + 'a>>>);

impl Team<'_> {
    /// Seconds of one repetition on all threads: of the thread that ran longest. Time in which a thread waits for a
    /// CPU does not count, so that other work on the machine disturbs little.
    fn time(&mut self, pool: &ThreadPool) -> f64 {
        let work = &self.0;
        let each = |what: fn(&mut dyn Work)| {
            let times = pool.broadcast(|thread| {
                let Some(work) = work.get(thread.index()) else {
                    return 0.0;
                };
                let mut work = work.lock().unwrap_or_else(PoisonError::into_inner);
                let start = thread_time::seconds();
                what(&mut **work);
                thread_time::seconds() - start
            });
            times.into_iter().fold(0.0, f64::max)
        };
        each(|work| work.reset());
        each(|work| work.run())
    }

    fn answers(&mut self, query: Query) -> Answers {
        let mut all = match query {
            Query::Occluded => Answers::Occluded(Vec::new()),
            Query::Intersect => Answers::Distances(Vec::new()),
        };
        for work in &mut self.0 {
            let work = work.get_mut().unwrap_or_else(PoisonError::into_inner);
            all.append(work.answers());
        }
        all
    }
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
    median(ours.iter().zip(other).map(|(ours, other)| other / ours))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_ratios() {
        assert!(median([]).is_nan());
        assert_eq!(median([3.0]), 3.0);
        assert_eq!(median([4.0, 1.0]), 2.5);
        assert_eq!(median([9.0, 1.0, 2.0]), 2.0);
        // The machine was slow in the second round.
        assert_eq!(median_ratio(&[1.0, 10.0, 1.0], &[2.0, 20.0, 2.0]), 2.0);
    }

    /// Remembers who ran, by thread.
    struct Counting {
        label: &'static str,
        log: Mutex<Vec<String>>,
    }

    struct Count<'a> {
        of: &'a Counting,
        rays: usize,
        ready: bool,
    }

    impl Engine for Counting {
        fn label(&self) -> Label {
            Label {
                engine: self.label,
                api: "single",
                tree: None,
            }
        }

        fn work<'a>(&'a self, query: Query, rays: &'a [Ray]) -> Option<Box<dyn Work + 'a>> {
            (query == Query::Occluded).then(|| {
                let (rays, ready) = (rays.len(), false);
                Box::new(Count {
                    of: self,
                    rays,
                    ready,
                }) as Box<dyn Work>
            })
        }
    }

    impl Work for Count<'_> {
        fn reset(&mut self) {
            self.ready = true;
        }

        fn run(&mut self) {
            assert!(std::mem::take(&mut self.ready), "not reset before a run");
            let mut log = self.of.log.lock().expect("no panic");
            log.push(format!("{} {}", self.of.label, self.rays));
        }

        fn answers(&self) -> Answers {
            Answers::Occluded(vec![true; self.rays])
        }
    }

    #[test]
    fn every_thread_runs_its_part_once_per_round() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
        let pool = pool.expect("threads");
        let rays = vec![Ray::new([0.0; 3], [1.0; 3]); 10];
        let mut expected = vec![true; 10];
        expected[7] = false;
        let engines = ["a", "b"].map(|label| Counting {
            label,
            log: Mutex::default(),
        });
        let list: Vec<&dyn Engine> = engines.iter().map(|engine| engine as &dyn Engine).collect();
        let reference = Answers::Occluded(expected);
        let outcomes = measure(&list, Query::Occluded, &rays, &reference, &pool, 4, &());
        let outcomes = outcomes.expect("not interrupted");
        for (outcome, engine) in outcomes.iter().zip(&engines) {
            assert_eq!(outcome.seconds.len(), 4);
            assert_eq!(outcome.disagreements, 1);
            let log = engine.log.lock().expect("no panic");
            let runs = |rays: usize| {
                let name = format!("{} {rays}", engine.label);
                log.iter().filter(|entry| **entry == name).count()
            };
            // Once to warm up, four times timed, on runs of 4, 4 and 2 rays.
            assert_eq!([runs(4), runs(2)], [10, 5]);
        }
        let reference = Answers::Distances(vec![]);
        let none = measure(&list, Query::Intersect, &[], &reference, &pool, 1, &());
        // Nobody has rays to refuse the query for, and nobody disagrees.
        assert!(
            none.expect("not interrupted")
                .iter()
                .all(|o| o.disagreements == 0)
        );
    }
}
