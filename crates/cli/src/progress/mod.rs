//! How far the work is, and the way by which Ctrl-C reaches it.
//!
//! - `line.rs`: one line about work under way
//! - `ticker.rs`: the thread that says it

pub mod line;
mod ticker;

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use antumbra_lab::{Step, Table, Watcher};
use antumbra_render::{Monitor, Phase};

use crate::exit::{say, tell};
use crate::interrupt;
use crate::json::Destination;
use crate::table::draw_all;
use line::Line;
use ticker::Ticker;

/// Says what is being done, until the result is dropped.
pub fn doing(title: &str, doing: &str) -> impl Drop + use<> {
    let line = Line {
        title: title.to_owned(),
        doing: doing.to_owned(),
        ..Line::default()
    };
    let since = Instant::now();
    Ticker::start(move || Line {
        elapsed: since.elapsed(),
        ..line.clone()
    })
}

/// Watches one rendering, or an experiment: what is said goes to the standard error output. Tables go to the standard
/// output, unless a document does.
pub struct Progress {
    state: Arc<State>,
    ticker: Mutex<Ticker>,
    json: Option<Destination>,
    /// File of finished work, if it is kept.
    journal: Option<PathBuf>,
}

/// What the line is made of.
struct State {
    work: Mutex<Work>,
    /// Samples and rays since the picture was begun.
    samples: AtomicU64,
    rays: AtomicU64,
    /// Samples of a whole picture; 0 if unknown.
    all: u64,
}

struct Work {
    title: String,
    doing: &'static str,
    phase: Option<Phase>,
    share: Option<f64>,
    /// Share that was done before.
    base: f64,
    /// When the phase, or the work if it is of one kind, was begun.
    since: Instant,
    /// When the whole was begun.
    begun: Instant,
    list: Option<List>,
}

impl State {
    fn line(&self) -> Line {
        let work = lock(&self.work);
        let mut line = Line {
            title: work.title.clone(),
            doing: work.doing.to_owned(),
            share: work.share,
            elapsed: work.begun.elapsed(),
            ..Line::default()
        };
        let seconds = work.since.elapsed().as_secs_f64();
        if work.phase == Some(Phase::Render) {
            let (samples, rays) = (&self.samples, &self.rays);
            let [samples, rays] = [samples, rays].map(|n| n.load(Ordering::Relaxed) as f64);
            if self.all > 0 {
                // Finer than tiles.
                let fine = work.base + samples / self.all as f64;
                line.share = Some(fine.max(work.share.unwrap_or(0.0)).min(1.0));
            }
            // A study has its own figures, and long titles.
            if seconds > 0.2 && samples > 0.0 && work.list.is_none() {
                line.samples = Some(samples / seconds);
                line.rays = Some(rays / seconds);
            }
        }
        if let Some(list) = &work.list {
            let inside = match work.phase {
                Some(Phase::Render) => line.share.unwrap_or(0.0),
                _ => 0.0,
            };
            line.share = None;
            if let Some((spent, left)) = list.times(inside) {
                let (spent_s, left_s) = (spent.as_secs_f64(), left.as_secs_f64());
                line.share = Some(spent_s / (spent_s + left_s).max(1e-9));
                line.left = Some(left);
            }
        } else if let Some(share) = line.share
            && share - work.base > 0.005
            && seconds > 0.5
        {
            let left = seconds * (1.0 - share) / (share - work.base);
            line.left = Some(Duration::from_secs_f64(left.min(1e9)));
        }
        line
    }
}

/// Renderings and replays: how many are left, how many are done and how long that took.
struct List {
    kinds: [Kind; 2],
    since: Instant,
}

#[derive(Clone, Copy, Default)]
struct Kind {
    left: usize,
    done: u32,
    spent: Duration,
}

impl Kind {
    /// About how long one takes, if one is done.
    fn mean(&self) -> Option<Duration> {
        (self.done > 0).then(|| self.spent / self.done)
    }
}

impl List {
    /// A replay takes about so many renderings until one is done.
    const REPLAY: f64 = 0.03;

    /// Time spent and time left, if anything is known about it. `share` of the piece under way is done, of which
    /// nobody knows what it is, but renderings come first.
    fn times(&self, share: f64) -> Option<(Duration, Duration)> {
        let [rendering, replay] = self.kinds.map(|kind| kind.mean());
        let under_way = self.since.elapsed();
        let guess = (share > 0.05).then(|| under_way.div_f64(share));
        let rendering = rendering.or(guess.filter(|_| self.kinds[0].left > 0));
        let replay = replay.or(rendering.map(|time| time.mul_f64(Self::REPLAY)));
        let mut left = Duration::ZERO;
        for (kind, mean) in self.kinds.iter().zip([rendering, replay]) {
            if kind.left > 0 {
                left += mean? * kind.left as u32;
            }
        }
        let spent = self.kinds.iter().map(|kind| kind.spent).sum::<Duration>() + under_way;
        Some((spent, left.saturating_sub(under_way)))
    }
}

impl Progress {
    /// Progress of one piece of work.
    pub fn new(title: impl Into<String>) -> Self {
        Self::of_picture(title, 0)
    }

    /// Progress of a picture of so many samples.
    pub fn of_picture(title: impl Into<String>, samples: u64) -> Self {
        let state = Arc::new(State {
            work: Mutex::new(Work {
                title: title.into(),
                doing: "",
                phase: None,
                share: None,
                base: 0.0,
                since: Instant::now(),
                begun: Instant::now(),
                list: None,
            }),
            samples: AtomicU64::new(0),
            rays: AtomicU64::new(0),
            all: samples,
        });
        let shown = Arc::clone(&state);
        Self {
            state,
            ticker: Mutex::new(Ticker::start(move || shown.line())),
            json: None,
            journal: None,
        }
    }

    /// Progress of an experiment whose document goes there.
    pub fn of_experiment(json: Option<&Destination>) -> Self {
        let mut progress = Self::new("");
        progress.json = json.cloned();
        progress
    }

    /// Progress of an experiment whose finished work is kept in this file.
    pub fn with_journal(mut self, journal: Option<PathBuf>) -> Self {
        self.journal = journal;
        self
    }

    /// Notes that there is finished work.
    fn keeps(&self) {
        if let Some(path) = &self.journal {
            interrupt::goes_on_from(path);
        }
    }

    /// Takes the line off the terminal.
    pub fn finish(&self) {
        lock(&self.ticker).stop();
    }

    /// Notes how far a phase is.
    fn note(&self, doing: &'static str, phase: Phase, done: u64, total: u64) {
        let share = done as f64 / total.max(1) as f64;
        let mut work = lock(&self.state.work);
        if work.phase != Some(phase) {
            work.phase = Some(phase);
            work.doing = doing;
            work.since = Instant::now();
            work.base = share;
            work.share = None;
            self.state.samples.store(0, Ordering::Relaxed);
            self.state.rays.store(0, Ordering::Relaxed);
        }
        // Steps of building are too few to tell how far it is. Calls may arrive out of order.
        if matches!(phase, Phase::Log | Phase::Render) {
            work.share = Some(work.share.map_or(share, |known| known.max(share)));
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Monitor for Progress {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        let doing = match phase {
            Phase::Build => "preparing the tree",
            Phase::Log => "tracing training rays",
            Phase::Sort => "learning the tree",
            Phase::Render => "rendering",
        };
        self.note(doing, phase, done, total);
    }

    fn traced(&self, samples: u64, rays: u64) {
        self.state.samples.fetch_add(samples, Ordering::Relaxed);
        self.state.rays.fetch_add(rays, Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}

impl antumbra_bake::Monitor for Progress {
    fn progress(&self, done: usize, total: usize) {
        self.note("baking", Phase::Render, done as u64, total as u64);
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}

impl Watcher for Progress {
    fn expect(&self, renderings: usize, replays: usize) {
        let kind = |left| Kind {
            left,
            ..Kind::default()
        };
        lock(&self.state.work).list = Some(List {
            kinds: [kind(renderings), kind(replays)],
            since: Instant::now(),
        });
    }

    fn begin(&self, title: &str) {
        let mut work = lock(&self.state.work);
        title.clone_into(&mut work.title);
        work.phase = None;
        work.doing = "";
    }

    fn finished(&self, step: Step, worked: bool) {
        self.keeps();
        if let Some(list) = lock(&self.state.work).list.as_mut() {
            let spent = list.since.elapsed();
            let kind = &mut list.kinds[step as usize];
            kind.left = kind.left.saturating_sub(1);
            if worked {
                kind.done += 1;
                kind.spent += spent;
                list.since = Instant::now();
            }
        }
    }

    fn note(&self, text: &str) {
        tell(format_args!("{text}"));
    }

    fn continued(&self, found: usize) {
        self.keeps();
        tell(format_args!(
            "{found} renderings and replays were finished before; --restart would do them again"
        ));
    }

    fn show(&self, tables: &[Table]) -> io::Result<()> {
        if self.json == Some(Destination::Stdout) {
            say(format_args!("{}", draw_all(tables, false).trim_end()));
            Ok(())
        } else {
            crate::exit::undraw();
            let stdout = io::stdout();
            let text = draw_all(tables, io::IsTerminal::is_terminal(&stdout));
            write!(stdout.lock(), "{text}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_takes_as_long_as_what_is_done_did() {
        let mut list = List {
            kinds: [Kind::default(); 2],
            since: Instant::now(),
        };
        assert!(list.times(0.0).is_some_and(|(_, left)| left.is_zero()));
        list.kinds[0].left = 3;
        assert!(list.times(0.0).is_none());
        list.kinds[0].done = 2;
        list.kinds[0].spent = Duration::from_secs(200);
        list.kinds[1].left = 10;
        let (spent, left) = list.times(0.0).expect("known times");
        assert!(spent >= Duration::from_secs(200) && spent < Duration::from_secs(201));
        // Three renderings, and ten replays that nobody has seen yet.
        assert!(
            (left.as_secs_f64() - (300.0 + 10.0 * 3.0)).abs() < 1.0,
            "{left:?}"
        );
        list.kinds[1].done = 1;
        list.kinds[1].spent = Duration::from_secs(1);
        let (_, left) = list.times(0.0).expect("known times");
        assert!((left.as_secs_f64() - 310.0).abs() < 1.0, "{left:?}");
    }
}
