//! How much memory a scene may take: a few lines of text can ask for any amount, by including the same shapes
//! again and again.

use crate::report::Report;
use crate::source::Span;

/// What is left of the memory that the caller allows.
pub(crate) struct Budget {
    limit: u64,
    taken: u64,
}

impl Budget {
    /// All of it is left; `None` is no limit.
    pub fn new(limit: Option<u64>) -> Self {
        Self {
            limit: limit.unwrap_or(u64::MAX),
            taken: 0,
        }
    }

    /// Takes some for what is at a place of a file. False: there is not so much, which is reported, once.
    pub fn take(&mut self, bytes: u64, at: Span, report: &mut Report) -> bool {
        let was_exceeded = self.taken > self.limit;
        self.taken = self.taken.saturating_add(bytes);
        if self.taken <= self.limit {
            return true;
        }
        if !was_exceeded {
            let (taken, limit) = (self.taken, self.limit);
            report.error_help(
                at,
                format!(
                    "from here on the scene needs more memory than is allowed: {taken} bytes of {limit}"
                ),
                "allow more memory, or leave something out",
            );
        }
        false
    }
}
