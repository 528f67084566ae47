//! Tests of the bakes through their public interface.
//!
//! - `closed_forms`, `reference`: results that are known on paper, or from other programs
//! - `visibility`: what points see, against brute force
//! - `viewshed`, `height_fields`: terrain, against all triangles in double precision
//! - `promises`: equal bits, errors, cancellation

mod closed_forms;
mod height_fields;
mod promises;
mod reference;
mod viewshed;
mod visibility;
