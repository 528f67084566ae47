//! The one writer and the one opener of files, for the program and all libraries.
//!
//! ```
//! use std::io::Read;
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("answers.csv");
//! antumbra_files::write_file(&path, |file| file.write_all(b"x,hours\n"))?;
//! let mut text = String::new();
//! antumbra_files::open(&path)?.read_to_string(&mut text)?;
//! assert_eq!(text, "x,hours\n");
//! // A folder is no file, and neither is a device or a pipe.
//! assert!(antumbra_files::open(folder.path()).is_err());
//! # Ok::<(), std::io::Error>(())
//! ```
//!
//! - `write.rs`: [`write_file`], which replaces a file as a whole or not at all, and [`Target`]
//! - `read.rs`: [`open`], which waits for nothing
#![forbid(unsafe_code)]

mod read;
mod write;

pub use read::open;
pub use write::{Output, Target, probe, remove_leftovers, write_file, write_file_seeking};
