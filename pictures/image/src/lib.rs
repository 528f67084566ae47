//! Images: linear RGB pictures, their file formats, comparison with a reference, and heat maps.
//!
//! # Example
//!
//! ```
//! use antumbra_image::compare::{self, StandardErrors, compare};
//! use antumbra_image::{Image, Window};
//!
//! # fn main() -> Result<(), antumbra_image::Error> {
//! let window = Window::full(2, 1);
//! let image = Image::new(2, 1, window, vec![[0.5; 3], [1.0; 3]])?;
//! let reference = Image::new(2, 1, window, vec![[0.5; 3], [0.8; 3]])?;
//!
//! let found = compare(&image, &reference, StandardErrors::default(), &compare::Options::default())?;
//! assert!((found.mse - 0.02).abs() < 1e-7);
//! let display = image.to_srgb8(); // or: image.write("picture.exr")?
//! assert_eq!(display.pixels()[1], [255; 3]);
//! # Ok(())
//! # }
//! ```
//!
//! # Files
//!
//! - `window.rs`, `image.rs`: [`Window`] of pixels, and [`Image`], linear RGB `f32`
//! - `rgb8.rs`: [`Rgb8Image`], 8-bit pixels for displays, and the sRGB curve
//! - `format.rs`: the table of formats by file name extension
//! - `files.rs`: methods of pictures that read and write files
//! - `raster.rs`: [`Raster`], pixels as files store them
//! - `exr.rs` (with `exr_chunks.rs`), `png.rs`, `jpeg.rs`, `hdr.rs`, `pfm.rs`: one file format each
//! - `decode.rs`: TGA, Radiance HDR and JPEG by another crate
//! - `channels.rs`: [`Channel`], layers beside the colours of an EXR file, and [`Notes`] in it
//! - `display.rs`: [`Display`], exposure and tone curves
//! - `foreign.rs`: protection against panics in decoders of other crates
//! - `memory.rs`: [`Allowance`], memory that pictures may take
//! - `atomic.rs`: [`atomic_write`] and [`atomic_write_seeking`], which replace a file as a whole or not at all
//! - `signature.rs`: the mark of this program in its pictures
//! - `compare.rs`: error measures and the statistical test against a reference
//! - `palette.rs`: [`palette`], the colours of all maps
//! - `heatmap.rs`, `digits.rs`: scalar fields as coloured pictures with a legend
//! - `error.rs`: [`Error`]
#![forbid(unsafe_code)]

mod atomic;
mod channels;
pub mod compare;
mod decode;
mod digits;
mod display;
mod error;
mod exr;
mod exr_chunks;
mod files;
mod foreign;
mod format;
mod hdr;
pub mod heatmap;
mod image;
mod jpeg;
mod memory;
pub mod palette;
mod pfm;
mod png;
mod raster;
mod rgb8;
mod signature;

mod window;

pub use antumbra_files::{Target, probe, remove_leftovers};
pub use atomic::{atomic_write, atomic_write_seeking};
pub use channels::{Channel, Notes};
pub use display::{Display, Tonemap};
pub use error::Error;
pub use format::{raster_extensions, readable_extensions, writable_extensions};
pub use image::Image;
pub use memory::Allowance;
pub use raster::{Raster, Samples};
pub use rgb8::{Rgb8Image, srgb8};
pub use signature::is_our_picture;
pub use window::Window;
