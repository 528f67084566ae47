//! Errors of this crate.

use std::io;
use std::path::PathBuf;

use crate::Window;

/// Reason why an image could not be made, read, written, compared or drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file could not be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file could not be written. An older file at the path is untouched.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The contents of the file are damaged or not supported.
    #[error("cannot read {} as {format}: {reason}", path.display())]
    Decode {
        /// Path of the file.
        path: PathBuf,
        /// Format, named by its extension.
        format: &'static str,
        /// Defect of the contents.
        reason: String,
    },
    /// The image has no representation in the format.
    #[error("cannot write {} as {format}: {reason}", path.display())]
    Encode {
        /// Path of the file.
        path: PathBuf,
        /// Format, named by its extension.
        format: &'static str,
        /// Property of the image that the format cannot hold.
        reason: String,
    },
    /// The file name has no extension, or an extension of no known format.
    #[error("{}: unknown image format \"{extension}\"; known: {known}", path.display())]
    UnknownFormat {
        /// Path of the file.
        path: PathBuf,
        /// Extension of the file name, without the dot; empty if there is none.
        extension: String,
        /// Known extensions, separated by commas.
        known: String,
    },
    /// The format is known, but does not support the action.
    #[error("{}: {format} images cannot be {action}; try: {able}", path.display())]
    Unsupported {
        /// Path of the file.
        path: PathBuf,
        /// Format, named by its extension.
        format: &'static str,
        /// Requested action as a participle, such as "read".
        action: &'static str,
        /// Extensions of the formats that support the action, separated by commas.
        able: String,
    },
    /// Width or height is 0 or above `i32::MAX`.
    #[error(
        "an image cannot have {width} x {height} pixels; width and height must be 1 to {}",
        i32::MAX
    )]
    BadSize {
        /// Requested width in pixels.
        width: usize,
        /// Requested height in pixels.
        height: usize,
    },
    /// The data window contains no pixel.
    #[error("the data window {window} is empty; it must contain at least one pixel")]
    EmptyWindow {
        /// Requested window.
        window: Window,
    },
    /// The number of values is not the number of pixels.
    #[error(
        "{found} values were given, but there are {expected} pixels; each pixel needs one value"
    )]
    WrongCount {
        /// Number of pixels.
        expected: usize,
        /// Number of values given.
        found: usize,
    },
    /// Two images must cover the same pixels, but do not.
    #[error("{first} has {first_size} pixels, but {second} has {second_size}; both must be equal")]
    SizeMismatch {
        /// Role of the first image, such as "the image".
        first: &'static str,
        /// Size of the first image, with its data window if that is not the whole picture.
        first_size: String,
        /// Role of the second image, such as "the reference".
        second: &'static str,
        /// Size of the second image, in the same form.
        second_size: String,
    },
    /// An end of a range is not finite, or its minimum is not below its maximum.
    #[error(
        "the range {min} to {max} is invalid; both ends must be finite and the first below the second"
    )]
    BadRange {
        /// Requested lower end.
        min: f32,
        /// Requested upper end.
        max: f32,
    },
    /// A number is outside its valid range.
    #[error("{name} is {value}; it must be {valid}")]
    BadOption {
        /// Name of the option.
        name: &'static str,
        /// Requested value.
        value: f64,
        /// Valid values, in words.
        valid: &'static str,
    },
}

/// Why a picture was not written. `format.rs` adds the path.
pub(crate) enum Unwritten {
    /// The format cannot hold the picture.
    Refused(String),
    /// An error of the operating system.
    Io(io::Error),
}
