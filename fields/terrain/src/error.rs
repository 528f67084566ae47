//! Why there is no result.

/// Reason why nothing was computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Lists that go together differ in length.
    #[error("{what}: found {found}, wanted {wanted}")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Length found.
        found: usize,
        /// Length wanted.
        wanted: usize,
    },
    /// A number lies outside its range.
    #[error("{what}: found {found}, wanted {wanted}")]
    Range {
        /// Name of the number.
        what: &'static str,
        /// Number found.
        found: f64,
        /// Range wanted, in words.
        wanted: &'static str,
    },
    /// There is no memory for a list.
    #[error("{items} {what} take {bytes} bytes: not enough memory")]
    NoMemory {
        /// What the items of the list are.
        what: &'static str,
        /// Items of the list.
        items: usize,
        /// Bytes of all items.
        bytes: u128,
    },
    /// A [`Border`](crate::Border) is damaged, or of another sweep.
    #[error("border of a tile: wanted {wanted}")]
    Border {
        /// What should be there.
        wanted: &'static str,
    },
    /// The [monitor](crate::Monitor) cancelled the work.
    #[error("cancelled")]
    Cancelled,
}

impl Error {
    /// Refuses a list of another length than wanted.
    #[doc(hidden)]
    pub fn check_length(what: &'static str, found: usize, wanted: usize) -> Result<(), Self> {
        let error = Self::Length {
            what,
            found,
            wanted,
        };
        (found == wanted).then_some(()).ok_or(error)
    }

    /// Refuses a number that is not in its range.
    #[doc(hidden)]
    pub fn check_range(
        what: &'static str,
        found: f64,
        is_in: bool,
        wanted: &'static str,
    ) -> Result<(), Self> {
        let error = Self::Range {
            what,
            found,
            wanted,
        };
        is_in.then_some(()).ok_or(error)
    }
}
