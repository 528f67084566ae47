//! Height rasters, and scenes, of many files that are larger than memory.
//!
//! An [`Index`] says which files a raster has, where their cells are, and how high the surface is at most in each square of 512 cells.
//! An [`Indexed`] raster reads parts of it, and gives tiles to [`Pull`](antumbra_terrain::Pull). A [`City`] is the index of mesh files.
//!
//! ```
//! use antumbra_raster::{Grid, Quantity, write};
//! use antumbra_terrain::{Pull, Tile, degrees};
//! use antumbra_tiles::{Index, Indexed};
//!
//! // A plain, and a wall in the tile east of it.
//! let folder = tempfile::tempdir()?;
//! let height = Quantity { name: "height", unit: "m" };
//! let mut files = Vec::new();
//! for (name, corner, heights) in [("west.tif", 0.0, [0.0; 16]), ("east.tif", 4.0, [0.0, 0.0, 0.0, 2.0].repeat(4).try_into().unwrap())] {
//!     let grid = Grid::north_up([4, 4], [600_000.0 + corner, 5_340_000.0], 1.0);
//!     let path = folder.path().join(name);
//!     std::fs::write(&path, write(&path, &grid, &heights, &[height])?)?;
//!     files.push(path);
//! }
//! let path = folder.path().join("plain.index");
//! let index = Index::make(&files, &path, &())?;
//! assert_eq!((index.columns, index.rows, index.cells), (8, 4, 32));
//!
//! let plain = Indexed::open(&path, 1 << 20)?;
//! let west = Tile { at: [0, 0], size: [4, 4] };
//! let east = Pull { tiles: &plain, rise: 0.0 }.horizons(&west, &[90.0], 0.0, &())?;
//! assert_eq!(degrees(east.values[0][3]), degrees(2.0 / 4.0));
//! assert_eq!(plain.used_files(), [0, 1]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - `index`: the index and its text;  `survey`: how it is made;  `peaks`: the file beside it;  `city`: the index of mesh files
//! - `indexed`: a raster that an index describes;  `store`: parts of its files
#![forbid(unsafe_code)]

mod city;
mod index;
mod indexed;
mod peaks;
mod store;
mod survey;

use std::io;
use std::path::{Path, PathBuf};

pub use city::{Box3, City, Piece, boxes_around};
pub use index::{Index, Listed};
pub use indexed::Indexed;
pub use store::checksum;

/// Why a raster cannot be indexed or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file cannot be read or written.
    #[error("error: {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file is no index, or does not go together with others.
    #[error("{}: error: {reason}", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what helps.
        reason: String,
    },
    /// A raster cannot be read.
    #[error(transparent)]
    Raster(#[from] antumbra_raster::Error),
    /// Something was not computed.
    #[error(transparent)]
    Terrain(#[from] antumbra_terrain::Error),
}

impl Error {
    fn io(path: &Path, source: io::Error) -> Self {
        let path = path.to_path_buf();
        Self::Io { path, source }
    }

    fn broken(path: &Path, reason: impl Into<String>) -> Self {
        let (path, reason) = (path.to_path_buf(), reason.into());
        Self::Broken { path, reason }
    }
}
