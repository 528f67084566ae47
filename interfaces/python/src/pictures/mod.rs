//! Pictures: rendered ones, arrays to be saved, and maps.

pub mod map;
pub mod picture;
