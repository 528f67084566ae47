//! Pictures: the image type, its file formats, comparison and heat maps.
//!
//! - `image.rs`: [`Image`], linear RGB `f32`, and its data [`Window`]
//! - `rgb8.rs`: [`Rgb8Image`], finished 8-bit pixels and the sRGB curve
//! - `format.rs`: the one table of file name extensions
//! - `raster.rs`: [`Raster`], pixels as files store them, and the formats that others decode
//! - `exr.rs`, `png.rs`, `pfm.rs`: one file format each, bytes to pixels and back
//! - `atomic.rs`: [`atomic_write`], how every file of this project is written
//! - `compare.rs`: error measures and the statistical test against a reference
//! - `heatmap.rs`, `turbo.rs`, `digits.rs`: scalar fields as coloured pictures with a legend
//! - `error.rs`: [`Error`]
#![forbid(unsafe_code)]

mod atomic;
pub mod compare;
mod digits;
mod error;
mod exr;
mod exr_chunks;
mod foreign;
mod format;
pub mod heatmap;
mod image;
mod pfm;
mod png;
mod raster;
mod rgb8;
mod turbo;

pub use atomic::atomic_write;
pub use error::Error;
pub use format::{raster_extensions, readable_extensions, writable_extensions};
pub use image::{Image, Window};
pub use raster::{Raster, Samples};
pub use rgb8::{Rgb8Image, srgb8};
