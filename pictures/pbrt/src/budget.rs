//! Memory limit of a scene. A few lines of text can demand any amount by including shapes repeatedly.

use crate::report::Report;
use crate::source::Span;

/// Memory that a scene may still take.
pub(crate) struct Budget {
    limit: u64,
    taken: u64,
}

impl Budget {
    /// Makes a full budget; `None` means no limit.
    pub fn new(limit: Option<u64>) -> Self {
        Self {
            limit: limit.unwrap_or(u64::MAX),
            taken: 0,
        }
    }

    /// Memory that is left beside the texts of the scene, in bytes.
    pub fn left(&self, report: &Report) -> u64 {
        let taken = self.taken.saturating_add(report.sources.bytes());
        self.limit.saturating_sub(taken)
    }

    /// Takes memory for an item at a place of a file. Returns false if the budget is exceeded, which is reported once and
    /// ends the reading.
    ///
    /// The texts of the scene count, too.
    pub fn take(&mut self, bytes: u64, at: Span, report: &mut Report) -> bool {
        self.taken = self.taken.saturating_add(bytes);
        let taken = self.taken.saturating_add(report.sources.bytes());
        if taken <= self.limit {
            return true;
        }
        if !report.is_over() {
            let limit = self.limit;
            let message = format!(
                "from here on the scene needs more memory than is allowed: {taken} bytes of {limit}"
            );
            report.error_help(at, message, "allow more memory, or leave something out");
            report.end();
        }
        false
    }
}
