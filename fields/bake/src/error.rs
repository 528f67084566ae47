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
    /// The number of rays per point is 0.
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
    /// A grid has too many cells.
    #[error("{columns:.0} x {rows:.0} cells; 100 million are the most")]
    Cells {
        /// Columns of the grid.
        columns: f64,
        /// Rows of the grid.
        rows: f64,
    },
    /// No cell of a grid has a surface.
    #[error("no surface is seen from above")]
    NothingBelow,
    /// No surface is below a point without a height.
    #[error("no surface is above or below point {}", index + 1)]
    OffSurface {
        /// Number of the point, from 0.
        index: usize,
    },
    /// No sensor is on the surfaces or lines that were chosen.
    #[error("no surface or line that was chosen has a place for a sensor; a smaller spacing may")]
    NoSurface,
    /// A texture is made of no triangle.
    #[error("no triangle has texture coordinates")]
    NoTextureCoordinates,
    /// No triangle covers the middle of a texel.
    #[error("no texel is covered; texture coordinates must run from 0 to 1")]
    NoTexels,
    /// A period of time ends before it begins.
    #[error("the end must lie behind the beginning")]
    NoTime,
    /// A period of time has too many steps.
    #[error("{0:.0} steps are more than ten million")]
    Steps(f64),
    /// A file is no [`Part`](crate::Part).
    #[error("it is no file of antumbra's bakes")]
    NoPart,
    /// A [`Part`](crate::Part) cannot be read.
    #[error("it is damaged")]
    DamagedPart,
    /// A [`Part`](crate::Part) belongs to another job, or to another share of it.
    #[error("it is a part of something else")]
    OtherJob,
    /// A [`Part`](crate::Part) has lost its end.
    #[error("it is cut short")]
    CutShort,
    /// Answers of a chunk are missing.
    #[error("chunk {chunk} is missing")]
    Missing {
        /// Number of the chunk.
        chunk: usize,
    },
    /// The number of answers differs from the number of items of the job.
    #[error("the chunks of an earlier run do not fit")]
    Answers,
    /// The [monitor](crate::Monitor) cancelled the work.
    #[error("cancelled")]
    Cancelled,
}

impl From<antumbra_terrain::Error> for Error {
    fn from(error: antumbra_terrain::Error) -> Self {
        use antumbra_terrain::Error;
        match error {
            Error::Length {
                what,
                found,
                wanted,
            } => Self::Length {
                what,
                found,
                wanted,
            },
            Error::Range {
                what,
                found,
                wanted,
            } => Self::Range {
                what,
                found,
                wanted,
            },
            Error::NoMemory { what, items, bytes } => Self::NoMemory { what, items, bytes },
            _ => Self::Cancelled,
        }
    }
}

impl Error {
    /// Refuses a list of another length than wanted.
    pub(crate) fn check_length(
        what: &'static str,
        found: usize,
        wanted: usize,
    ) -> Result<(), Self> {
        Ok(antumbra_terrain::Error::check_length(what, found, wanted)?)
    }

    /// Refuses a number that is not in its range.
    pub(crate) fn check_range(
        what: &'static str,
        found: f64,
        is_in: bool,
        wanted: &'static str,
    ) -> Result<(), Self> {
        let checked = antumbra_terrain::Error::check_range(what, found, is_in, wanted);
        Ok(checked?)
    }
}
