//! Two programs for one job, in turns.

use std::cell::RefCell;
use std::fmt;

use antumbra::Bvh;

use crate::input::Mesh;
use crate::rtc::Rtc;
use crate::turns::{Work, medians, seconds};

/// Turns of each program.
const ROUNDS: usize = 3;

/// Part of a job that decides which calls of Embree are fastest: one in so many.
const TRIAL: usize = 8;

/// Ways to call Embree, by name.
pub type Ways<W> = [(&'static str, W)];

/// Results of both programs.
pub struct Compared<T> {
    pub ours: T,
    pub embree: T,
    seconds: [f64; 2],
    builds: [f64; 2],
    calls: &'static str,
}

/// Line of the table.
pub struct Row {
    rays: u64,
    seconds: [f64; 2],
    builds: [f64; 2],
    answers: usize,
    differ: usize,
    calls: &'static str,
}

/// Runs both programs, builds included, ours with default trees. `embree` does one part in so many of the job.
pub fn compare<T, W: Copy>(
    rtc: &Rtc,
    mesh: &Mesh,
    ours: impl Fn(&Bvh) -> T,
    ways: &Ways<W>,
    embree: impl Fn(W, usize) -> T,
) -> Compared<T> {
    compare_with(rtc, mesh, || crate::build(mesh), ours, ways, embree)
}

/// [`compare`], where ours builds something else than a tree.
pub fn compare_with<B, T, W: Copy>(
    rtc: &Rtc,
    mesh: &Mesh,
    build: impl Fn() -> B,
    ours: impl Fn(&B) -> T,
    ways: &Ways<W>,
    embree: impl Fn(W, usize) -> T,
) -> Compared<T> {
    rtc.build(mesh);
    let trial = |way: W| {
        let once = || {
            let start = seconds();
            embree(way, TRIAL);
            seconds() - start
        };
        once().min(once())
    };
    let mut trials: Vec<(f64, usize)> = (0..)
        .zip(ways)
        .map(|(index, (_, way))| (trial(*way), index))
        .collect();
    trials.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (calls, way) = ways[trials[0].1];
    for (time, index) in &trials {
        eprintln!("    trial: {:24} {:.3} s", ways[*index].0, time);
    }
    let results = [RefCell::new(None), RefCell::new(None)];
    let builds = [RefCell::new(Vec::new()), RefCell::new(Vec::new())];
    let mut works: Vec<Work<'_>> = vec![
        (
            "ours".into(),
            Box::new(|| {
                let start = seconds();
                let built = build();
                builds[0].borrow_mut().push(seconds() - start);
                *results[0].borrow_mut() = Some(ours(&built));
            }),
        ),
        (
            "Embree".into(),
            Box::new(|| {
                let start = seconds();
                rtc.build(mesh);
                builds[1].borrow_mut().push(seconds() - start);
                *results[1].borrow_mut() = Some(embree(way, 1));
            }),
        ),
    ];
    let times = medians(ROUNDS, &mut works);
    drop(works);
    let [ours, embree] = results.map(|result| result.into_inner().expect("a turn"));
    let builds = builds.map(|times| {
        let mut times = times.into_inner().split_off(1);
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    });
    Compared {
        ours,
        embree,
        seconds: [times[0], times[1]],
        builds,
        calls,
    }
}

impl<T> Compared<T> {
    /// The line of a job of so many rays, of whose answers some differ.
    pub fn row(&self, rays: u64, answers: usize, differ: usize) -> Row {
        Row {
            rays,
            seconds: self.seconds,
            builds: self.builds,
            answers,
            differ,
            calls: self.calls,
        }
    }
}

pub const HEAD: &str = "job          Mrays or points   ours, s (build)  Embree, s (build)   ratio   differ of answers  Embree's calls";

impl Row {
    /// Embree's time over ours.
    pub fn ratio(&self) -> f64 {
        self.seconds[1] / self.seconds[0]
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [ours, embree] = self.seconds;
        let [our_build, their_build] = self.builds;
        write!(
            f,
            "{:15.2} {ours:9.3} ({our_build:5.3}) {embree:10.3} ({their_build:5.3}) {:7.2} {:8} of {:8}  {}",
            1e-6 * self.rays as f64,
            self.ratio(),
            self.differ,
            self.answers,
            self.calls
        )
    }
}
