//! How a caller watches an experiment and stops it.

use std::io;

use antumbra_render::Monitor;

use crate::{Error, Table};

/// A piece of a study's work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Step {
    /// A tree that is compared with others on a picture. The trees of one picture are finished together.
    Comparison,
    /// A whole picture, for its time.
    Rendering,
    /// A list of rays that one tree answers.
    Replay,
}

/// Pieces of work of one kind in one scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// Their kind.
    pub step: Step,
    /// How many there are.
    pub count: usize,
    /// About how many seconds one takes on one thread, if only relative to the others.
    pub weight: f64,
}

/// Watches a study or a benchmark. Renderings within report to the [`Monitor`], and
/// [`Monitor::cancelled`] stops everything.
pub trait Watcher: Monitor {
    /// Announces all work that is left, of all scenes. Pieces of one kind are finished in this order. Called again when
    /// more is known about a scene.
    fn expect(&self, left: &[Work]) {
        let _ = left;
    }

    /// Names the piece of work that begins.
    fn begin(&self, title: &str) {
        let _ = title;
    }

    /// The work that was just named is so many pieces, which are finished together.
    fn together(&self, pieces: usize) {
        let _ = pieces;
    }

    /// A piece of work is finished: now, or by the study that is continued if `worked` is false.
    fn finished(&self, step: Step, worked: bool) {
        let _ = (step, worked);
    }

    /// Something worth knowing, in one sentence.
    fn note(&self, text: &str) {
        let _ = text;
    }

    /// A study in this directory is continued: so many pieces of work were finished before.
    fn continued(&self, found: usize) {
        let _ = found;
    }

    /// Results so far, as soon as a scene is finished.
    ///
    /// # Errors
    /// If the results cannot be shown, the experiment stops.
    fn show(&self, tables: &[Table]) -> io::Result<()> {
        let _ = tables;
        Ok(())
    }
}

/// Watches nothing and never stops.
impl Watcher for () {}

/// Fails if the watcher wants to stop.
pub(crate) fn check(watcher: &dyn Watcher) -> Result<(), Error> {
    if watcher.cancelled() {
        Err(Error::Interrupted)
    } else {
        Ok(())
    }
}
