//! How a caller watches an experiment and stops it.

use std::io;

use antumbra_render::Monitor;

use crate::{Error, Table};

/// A piece of a study's work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Step {
    /// A picture.
    Rendering,
    /// A list of rays that one tree answers.
    Replay,
}

/// Watches a study or a benchmark. Renderings within report to the [`Monitor`], and
/// [`Monitor::cancelled`] stops everything.
pub trait Watcher: Monitor {
    /// Announces the work: so many renderings and replays.
    fn expect(&self, renderings: usize, replays: usize) {
        let _ = (renderings, replays);
    }

    /// Names the piece of work that begins.
    fn begin(&self, title: &str) {
        let _ = title;
    }

    /// A piece of work is finished: now, or by the study that is continued if `worked` is false.
    fn finished(&self, step: Step, worked: bool) {
        let _ = (step, worked);
    }

    /// Something worth knowing, in one sentence.
    fn note(&self, text: &str) {
        let _ = text;
    }

    /// A study in this directory is continued: so many renderings and replays were finished before.
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
