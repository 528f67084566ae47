//! Tests of pictures and their files through the public interface.
//!
//! - `files`: written pictures come back, bit by bit
//! - `rasters`: images read as their files store them
//! - `atomic`: a file is complete or absent
//! - `compare`: error measures and the statistical test
//! - `heatmap`: range, colours and legend
//! - `references`: the shared reference pictures, where they are present
//! - `support`: random numbers and pictures

mod atomic;
mod compare;
mod files;
mod heatmap;
mod rasters;
mod references;
mod support;
