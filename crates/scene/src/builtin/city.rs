//! A city.

use crate::Scene;

/// A deterministic procedural city of at least `triangles` triangles.
pub fn city(triangles: usize) -> Scene {
    let _ = triangles;
    unreachable!()
}
