//! How far the work is, and the way by which Ctrl-C reaches it.
//!
//! - `line.rs`: one line about work under way
//! - `list.rs`: the work of an experiment: what is done, and how long the rest may take
//! - `ticker.rs`: the thread that says it

pub mod line;
mod list;
mod ticker;

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use antumbra_lab::{Step, Table, Watcher, Work as Pieces};
use antumbra_render::{Monitor, Phase};

use crate::exit::{say, tell};
use crate::interrupt;
use crate::json::Destination;
use crate::table::draw_all;
use line::Line;
use list::List;
use ticker::Ticker;

/// Share of the time of a comparison of trees that goes into learning them, about.
const LEARNING: f64 = 0.4;

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

/// State from which the line is written.
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
                Some(Phase::Sort) if list.is_together() => LEARNING * work.share.unwrap_or(0.0),
                Some(Phase::Render) if list.is_together() => {
                    LEARNING + (1.0 - LEARNING) * line.share.unwrap_or(0.0)
                }
                Some(Phase::Render) => line.share.unwrap_or(0.0),
                _ => 0.0,
            };
            line.piece = list.piece();
            let estimate = list.estimate(inside);
            line.share = Some(estimate.share);
            line.left = estimate.left;
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
        // Steps of building are too few to tell how far it is, and one tree is learned in one step. Calls may arrive out of order.
        if matches!(phase, Phase::Log | Phase::Sort | Phase::Render) {
            work.share = Some(work.share.map_or(share, |known| known.max(share)));
        }
    }
}

/// What a mutex holds, even after a thread has panicked with it.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
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
    fn expect(&self, left: &[Pieces]) {
        let mut work = lock(&self.state.work);
        work.list.get_or_insert_with(List::new).expect(left);
    }

    fn begin(&self, title: &str) {
        let mut work = lock(&self.state.work);
        title.clone_into(&mut work.title);
        work.phase = None;
        work.doing = "";
        if let Some(list) = &mut work.list {
            list.begin();
        }
    }

    fn together(&self, pieces: usize) {
        if let Some(list) = &mut lock(&self.state.work).list {
            list.together(pieces);
        }
    }

    fn finished(&self, step: Step, worked: bool) {
        self.keeps();
        if let Some(list) = lock(&self.state.work).list.as_mut() {
            list.finished(step, worked);
        }
    }

    fn note(&self, text: &str) {
        tell(format_args!("{text}"));
    }

    fn continued(&self, found: usize) {
        self.keeps();
        tell(format_args!(
            "{found} pieces of work were finished before; --restart would do them again"
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
