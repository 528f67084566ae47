//! WebAssembly module behind `npm/antumbra.js`: triangles and rays go in, answers come out.
//!
//! The script writes numbers into memory that a function has reserved, calls a second function, and reads answers where that
//! function says. The module owns all memory, so nothing here is `unsafe` but the names. It has no imports.
//!
//! - `module`: reserved memory, scenes, the text of the last error
//! - `names`: functions that the script calls

mod module;
pub mod names;

pub use module::{Hits, Module};
