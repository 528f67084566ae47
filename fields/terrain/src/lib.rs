//! Exact answers for every cell of a height raster: horizons, and what observers see.
//!
//! No rays, no mesh and no tree: the surface is swept, so that a cell costs a few operations however far it looks.
//!
#![forbid(unsafe_code)]

#[doc(hidden)]
pub mod angles;
mod error;
mod height_field;
mod lattice;
mod march;
#[doc(hidden)]
pub mod memory;
mod monitor;
mod sweep;
mod viewshed;

pub use angles::degrees;
pub use error::Error;
pub use height_field::{HeightField, Observer};
pub use lattice::{Direction, Lattice};
pub use march::March;
pub use monitor::Monitor;
#[doc(hidden)]
pub use monitor::Progress;
pub use sweep::Sweep;
pub use viewshed::{Limits, Viewer};
