//! A progress bar on the terminal, and the way by which Ctrl-C reaches a rendering.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use antumbra_render::{Monitor, Phase};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::interrupt;

/// Parts that the bar is divided into.
const PARTS: u64 = 1000;

/// Watches one rendering, or a list of work if it was told what to expect. Nothing is drawn unless the standard error
/// output is a terminal.
pub struct Progress {
    bar: ProgressBar,
    title: String,
    list: Option<Mutex<List>>,
}

/// A piece of a list of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    Rendering,
    Replay,
}

/// Work of both kinds: how much is left, how much is done and how long that took.
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
            title: title.into(),
            list: None,
        }
    }

    /// Tells what comes next.
    pub fn retitle(&mut self, title: impl Into<String>) {
        self.title = title.into();
        if self.list.is_some() && !self.bar.is_hidden() {
            self.bar.set_message(self.title.clone());
            self.show(0.0);
        }
    }

    /// From now on the bar is about so many renderings and replays.
    pub fn expect(&mut self, [renderings, replays]: [usize; 2]) {
        let kind = |left| Kind {
            left,
            ..Kind::default()
        };
        self.list = Some(Mutex::new(List {
            kinds: [kind(renderings), kind(replays)],
            since: Instant::now(),
        }));
    }

    /// A piece of the list is done.
    pub fn finished(&self, step: Step) {
        self.take_off(step, true);
    }

    /// A piece of the list was done before.
    pub fn skipped(&self, step: Step) {
        self.take_off(step, false);
    }

    fn take_off(&self, step: Step, worked: bool) {
        if let Some(list) = &self.list {
            let mut list = list.lock().unwrap_or_else(PoisonError::into_inner);
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

    /// Draws how much of the list is done, and how long the rest may take.
    fn show(&self, share: f64) {
        let Some(list) = &self.list else {
            return;
        };
        let list = list.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((spent, left)) = list.times(share) else {
            return;
        };
        let (spent_s, left_s) = (spent.as_secs_f64(), left.as_secs_f64());
        let done = spent_s / (spent_s + left_s).max(1e-9);
        self.bar.set_length(PARTS);
        self.bar.set_position((done * PARTS as f64) as u64);
        self.bar
            .set_prefix(format!(", {} left", HumanDuration(left)));
    }

    /// Takes the bar off the terminal.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
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
        self.bar.set_message(format!("{} {what}", self.title));
        if self.list.is_some() {
            let share = done as f64 / total.max(1) as f64;
            self.show(if phase == Phase::Render { share } else { 0.0 });
        } else {
            self.bar.set_length(total);
            self.bar.set_position(done);
        }
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
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
