//! The film: samples become pixels, with the same bits in whatever order tiles are finished.
//!
//! - `tile.rs`: tiles of the picture, and the samples of a tile in batches
//! - `shard.rs`: every n-th tile, for one machine of several
//! - `rules.rs`: the rules by which samples enter pixels
//! - `filter.rs`: reconstruction filters
//! - `counts.rs`: numbers of samples
//! - `sums.rs`: sums over the samples of a rectangle of pixels
//! - `tile_film.rs`: the film of one tile
//! - `picture.rs`: the film of the whole picture, or of a part of it
//!
//! # Order of additions
//!
//! A tile adds the samples of its *own* pixels, in sample order, to a film of its own. With a filter wider than a
//! pixel that film overlaps the tiles around. Tile films are added to the picture strictly in tile order. A tile
//! that is finished early waits. In a shard, which lacks tiles in between, all tiles wait. Sums are in double
//! precision, and are stored and read again as they are.

mod counts;
pub mod filter;
mod picture;
mod rules;
mod shard;
mod sums;
mod tile;
mod tile_film;

pub use picture::Film;
pub use rules::Rules;
pub use shard::{BadShard, Shard};
pub use tile::{BATCH, Sample, Tiles, batch_depth, batches, batches_after};
pub use tile_film::TileFilm;

#[cfg(test)]
mod tests;
