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
    /// No ray per point was asked for.
    #[error("samples: found 0, wanted at least 1")]
    NoSamples,
    /// The distance up to which surfaces occlude is not positive.
    #[error("distance: found {0}, wanted a number above 0, or infinity")]
    Distance(f32),
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
    /// There is no memory for a matrix.
    #[error("a matrix of {rows} rows and {columns} columns: not enough memory")]
    TooLarge {
        /// Rows of the matrix.
        rows: usize,
        /// Columns of the matrix.
        columns: usize,
    },
    /// The [monitor](crate::Monitor) cancelled the work.
    #[error("cancelled")]
    Cancelled,
}
