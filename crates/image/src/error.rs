//! Everything that can go wrong in this crate.

use std::io;
use std::path::PathBuf;

use crate::Window;

/// Why an image could not be made, read, written, compared or drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The file could not be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file could not be written; what was there before is untouched.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file was read, but its contents are not an image this crate understands.
    #[error("cannot read {} as {format}: {reason}", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// The format, by its extension.
        format: &'static str,
        /// What is wrong with the contents.
        reason: String,
    },
    /// The image has no representation in the format.
    #[error("cannot write {} as {format}: {reason}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// The format, by its extension.
        format: &'static str,
        /// What stands in the way.
        reason: String,
    },
    /// The file name has no extension, or none that names a known format.
    #[error("{}: unknown image format \"{extension}\"; known: {known}", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// The extension as given, without the dot; empty if there is none.
        extension: String,
        /// The known extensions, separated by commas.
        known: String,
    },
    /// The format is known, but cannot do what was asked.
    #[error("{}: {format} images cannot be {action}; try: {able}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The format, by its extension.
        format: &'static str,
        /// What was asked, a participle: "read" or the like.
        action: &'static str,
        /// The extensions that can, separated by commas.
        able: String,
    },
    /// Width and height must be at least 1 and at most `i32::MAX`.
    #[error("an image cannot be {width} x {height} pixels")]
    BadSize {
        /// Width asked for, in pixels.
        width: usize,
        /// Height asked for, in pixels.
        height: usize,
    },
    /// A data window without a single pixel.
    #[error("the data window {window} is empty")]
    EmptyWindow {
        /// The window asked for.
        window: Window,
    },
    /// The number of values is not the number of pixels to be covered.
    #[error("{expected} values are needed, {found} were given")]
    WrongCount {
        /// Pixels to be covered.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// Two images that must cover the same pixels do not.
    #[error("{first} has {first_size} pixels, {second} has {second_size}")]
    SizeMismatch {
        /// What the first image is.
        first: &'static str,
        /// Its size, with the data window if that is not the whole picture.
        first_size: String,
        /// What the second image is.
        second: &'static str,
        /// Its size, in the same form.
        second_size: String,
    },
    /// A range of values must be finite and its minimum below its maximum.
    #[error("the range {min} to {max} is not one")]
    BadRange {
        /// Lower end asked for.
        min: f32,
        /// Upper end asked for.
        max: f32,
    },
    /// A number outside its valid range.
    #[error("{name} is {value}; it must be {valid}")]
    BadOption {
        /// Name of the option.
        name: &'static str,
        /// Value asked for.
        value: f64,
        /// The valid values, in words.
        valid: &'static str,
    },
}
