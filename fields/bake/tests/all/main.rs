//! Tests of the bakes through their public interface.
//!
//! - `closed_forms`, `reference`: results that are known on paper, or from other programs
//! - `visibility`: what points see, against brute force
//! - `viewshed`, `height_fields`: terrain, against all triangles in double precision
//! - `field_sun`: sun and sky of terrain, against rays
//! - `sky`: how much of it cells see, against closed forms and sums over elevations
//! - `surroundings`: houses in terrain, against both as one mesh
//! - `pieces`: houses in pieces, against one tree of all
//! - `promises`: equal bits, errors, cancellation

mod closed_forms;
mod field_sun;
mod height_fields;
mod pieces;
mod promises;
mod reference;
mod sky;
mod surroundings;
mod viewshed;
mod visibility;
