//! Exact answers for every cell of a height raster: horizons, and what observers see.
//!
//! No rays, no mesh and no tree: the surface is swept, so that a cell costs a few operations however far it looks.
//!
//! | question | call | answer |
//! |---|---|---|
//! | how high is the horizon of each cell along a step between cells | [`Sweep::horizons`] | a number for each cell |
//! | the same for a tile of a larger raster, whose hulls go on to others | [`TileSweep::horizons`] | a number for each cell, a [`Border`] |
//! | the same in any other azimuth | [`March::horizons`] | a number for each cell |
//! | which azimuths have such steps, and how much of the circle is each | [`Lattice`] | steps, degrees, weights |
//! | how much of the sky does each cell see | [`FieldSky`] | a number for each cell |
//! | which cells get light from a direction | [`Shadows::lit`] | a bit for each cell |
//! | horizons and light in tiles of a raster that is too large for memory | [`Pull`] | as of the whole raster |
//! | is a light hidden at any place above the surface | [`Skyline::hides`] | yes or no |
//! | which cells does an observer see | [`Viewer::sees`] | a bit for each cell |
//! | from which height above ground does an observer see them | [`Viewer::target_heights`] | a number for each cell |
//! | how steep is the line of sight | [`Viewer::elevation`] | degrees of one cell |
//!
//! The share of the sky that level ground receives light from, with 16 azimuths, is the mean of the squared cosines of horizons:
//!
//! ```
//! use antumbra_terrain::{HeightField, Lattice, Sweep};
//!
//! // A court of 5 x 5 cells, 1 m wide, inside walls of 2 m.
//! let heights: Vec<f64> = (0..49).map(|i| if [0, 6].contains(&(i % 7)) || [0, 6].contains(&(i / 7)) { 2.0 } else { 0.0 }).collect();
//! let field = HeightField::new([7, 7], &heights, [0.0, 1.0, 0.0, 0.0, 0.0, -1.0])?;
//! let lattice = Lattice::new(&field, 16)?;
//! let mut sky = vec![0.0; 49];
//! for (&step, weight) in lattice.steps.iter().zip(lattice.weights()) {
//!     let sweep = Sweep { field: &field, rise: 0.0, drop: 0.0 };
//!     // The squared cosine of an elevation whose tangent is the slope.
//!     let open = sweep.horizons(step, |slope| (1.0 / (1.0 + slope.max(0.0).powi(2))) as f32, &())?;
//!     sky.iter_mut().zip(open).for_each(|(sky, open)| *sky += weight * f64::from(open));
//! }
//! assert_eq!(sky[0], 1.0, "on the wall");
//! assert!(sky[8] < sky[24], "a corner of the court sees less than its middle");
//! # Ok::<(), antumbra_terrain::Error>(())
//! ```
//!
//! - `height_field`: heights as a surface of triangles;  `lattice`: steps and their azimuths
//! - `sweep`, `march`: horizons;  `sky`: sums over them;  `shadows`, `skyline`: light from far away;  `viewshed`: viewsheds
//! - `tiles`: parts of larger rasters
//! - `crossing`: crossings of lines of sight with edges;  `peaks`: largest heights of squares
//! - `angles`: degrees;  `monitor`: progress and cancellation;  `memory`: lists that may not fit;  `error`: why there is no result
#![forbid(unsafe_code)]

#[doc(hidden)]
pub mod angles;
mod crossing;
mod error;
mod height_field;
mod lattice;
mod march;
#[doc(hidden)]
pub mod memory;
mod monitor;
mod peaks;
mod shadows;
mod sky;
mod skyline;
mod sweep;
mod tiles;
mod viewshed;

pub use angles::degrees;
pub use error::Error;
pub use height_field::{HeightField, Observer};
pub use lattice::{Direction, Lattice, weights};
pub use march::{Eyes, March};
pub use monitor::Monitor;
#[doc(hidden)]
pub use monitor::{Progress, Share};
pub use peaks::Peaks;
pub use shadows::{Shadows, per_cell};
pub use sky::{FieldSky, SkyMeasure, SkyValues};
pub use skyline::{Light, Skyline};
pub use sweep::{Border, Sweep, TileSweep};
pub use tiles::{Pull, Pulled, Tile, Tiles};
pub use viewshed::{Limits, Viewer};
