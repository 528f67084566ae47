//! Why there is no map.

/// Reason why nothing was drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A list has another length than its grid.
    #[error("{what}: found {found}, wanted {wanted}")]
    Length {
        /// Name of the list.
        what: &'static str,
        /// Length found.
        found: usize,
        /// Length wanted.
        wanted: usize,
    },
    /// The grid has no cells, or cells without a size.
    #[error("a grid of {width} x {height} cells of size {cell:?} cannot be drawn")]
    Grid {
        /// Number of columns.
        width: usize,
        /// Number of rows.
        height: usize,
        /// Edges of a cell.
        cell: [f64; 2],
    },
    /// A picture is too small for its text, or too large.
    #[error(
        "a map of {width} x {height} pixels: wanted at least {least} x {least}, and {most} pixels at most"
    )]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Least width and height.
        least: u32,
        /// Largest product of both.
        most: u64,
    },
    /// The ends of the legend are not two rising numbers.
    #[error("a legend from {0} to {1}: wanted two finite numbers, the larger one last")]
    Range(f64, f64),
    /// The font lacks a character.
    #[error("the font of maps has no character {0:?}")]
    Character(char),
    /// A picture inside of the map cannot be encoded.
    #[error(transparent)]
    Image(#[from] antumbra_image::Error),
    /// Pictures cannot be encoded as GIF.
    #[error("GIF: {0}")]
    Gif(String),
    /// The font cannot be embedded.
    #[error("the font cannot be embedded: {0}")]
    Font(String),
}
