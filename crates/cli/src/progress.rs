//! A progress bar on the terminal, and the way by which Ctrl-C reaches a rendering.

use antumbra_render::{Monitor, Phase};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::interrupt;

/// Watches one rendering. Nothing is drawn unless the standard error output is a terminal.
pub struct Progress {
    bar: ProgressBar,
    title: String,
}

impl Progress {
    /// A bar with a title before it.
    pub fn new(title: impl Into<String>) -> Self {
        // The bar is drawn without colour, so NO_COLOR has nothing to turn off.
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:40}] {percent:>3}%") {
            bar.set_style(style.progress_chars("=> "));
        }
        Self {
            bar,
            title: title.into(),
        }
    }

    /// Tells what comes next.
    pub fn retitle(&mut self, title: impl Into<String>) {
        self.title = title.into();
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
        self.bar.set_length(total);
        self.bar.set_position(done);
    }

    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}
