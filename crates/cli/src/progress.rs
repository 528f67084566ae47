//! A progress bar on the terminal, and the way by which Ctrl-C reaches a rendering or an experiment.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use antumbra_lab::{Step, Table, Watcher};
use antumbra_render::{Monitor, Phase};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::exit::say;
use crate::interrupt;
use crate::json::Destination;
use crate::table::draw_all;

/// Parts that the bar is divided into.
const PARTS: u64 = 1000;

/// Watches one rendering, or an experiment: what is said goes to the standard error output, and so does the bar if
/// that is a terminal. Tables go to the standard output, unless a document does.
pub struct Progress {
    bar: ProgressBar,
    title: Mutex<String>,
    list: Mutex<Option<List>>,
    json: Option<Destination>,
    /// File of finished work, if it is kept.
    journal: Option<PathBuf>,
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
    /// A bar with a title before it.
    pub fn new(title: impl Into<String>) -> Self {
        // The bar is drawn without colour, so NO_COLOR has nothing to turn off.
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:40}] {percent:>3}%{prefix}") {
            bar.set_style(style.progress_chars("=> "));
        }
        Self {
            bar,
            title: Mutex::new(title.into()),
            list: Mutex::default(),
            json: None,
            journal: None,
        }
    }

    /// A bar for an experiment whose document goes there.
    pub fn of_experiment(json: Option<&Destination>) -> Self {
        let mut progress = Self::new("");
        progress.json = json.cloned();
        progress
    }

    /// The bar of an experiment whose finished work is kept in this file.
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

    /// Draws how much of the list is done, and how long the rest may take. False if there is no list.
    fn show_list(&self, share: f64) -> bool {
        let list = lock(&self.list);
        let Some(list) = list.as_ref() else {
            return false;
        };
        if let Some((spent, left)) = list.times(share) {
            let (spent_s, left_s) = (spent.as_secs_f64(), left.as_secs_f64());
            let done = spent_s / (spent_s + left_s).max(1e-9);
            self.bar.set_length(PARTS);
            self.bar.set_position((done * PARTS as f64) as u64);
            self.bar
                .set_prefix(format!(", {} left", HumanDuration(left)));
        }
        true
    }

    /// Takes the bar off the terminal.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}

impl Monitor for Progress {
    fn progress(&self, phase: Phase, done: u64, total: u64) {
        if self.bar.is_hidden() {
            return;
        }
        let what = match phase {
            Phase::Build => "collapsing",
            Phase::Log => "logging",
            Phase::Sort => "sorting",
            Phase::Render => "rendering",
        };
        let title = lock(&self.title).clone();
        self.bar.set_message(format!("{title} {what}"));
        let share = done as f64 / total.max(1) as f64;
        if !self.show_list(if phase == Phase::Render { share } else { 0.0 }) {
            self.bar.set_length(total);
            self.bar.set_position(done);
        }
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}

impl antumbra_bake::Monitor for Progress {
    fn progress(&self, done: usize, total: usize) {
        if !self.bar.is_hidden() {
            self.bar
                .set_message(format!("{} baking", lock(&self.title)));
            self.bar.set_length(total as u64);
            self.bar.set_position(done as u64);
        }
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
        *lock(&self.list) = Some(List {
            kinds: [kind(renderings), kind(replays)],
            since: Instant::now(),
        });
    }

    fn begin(&self, title: &str) {
        title.clone_into(&mut lock(&self.title));
        if !self.bar.is_hidden() {
            self.bar.set_message(title.to_owned());
            self.show_list(0.0);
        }
    }

    fn finished(&self, step: Step, worked: bool) {
        self.keeps();
        if let Some(list) = lock(&self.list).as_mut() {
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
        say(format_args!("{text}"));
    }

    fn continued(&self, found: usize) {
        self.keeps();
        say(format_args!(
            "{found} renderings and replays were finished before; --restart would do them again"
        ));
    }

    fn show(&self, tables: &[Table]) -> io::Result<()> {
        let text = draw_all(tables);
        if self.json == Some(Destination::Stdout) {
            say(format_args!("{}", text.trim_end()));
            Ok(())
        } else {
            write!(io::stdout().lock(), "{text}")
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
