//! Points of surfaces: from a hit of the kernel to position, normals and frames.
//!
//! - `point.rs`: a point of a surface, and the rays that leave it
//! - `block.rs`: points of many hits at once
//! - `origin_offset.rs`: how far rays start from their surface
//! - `triangle.rs`: points and normals of triangles, with error bounds
//! - `curve.rs`: points of curves
//! - `shapes.rs`: shapes and placements of the scene, found by a hit
//! - `frame.rs`: orthonormal frames, reflection, refraction

mod block;
mod curve;
mod frame;
mod origin_offset;
mod point;
mod shapes;
mod triangle;

pub use block::{SurfaceBlock, Surfaces};
pub use curve::{CurvePart, CurvePoint, segments};
pub use frame::{Frame, reflect, refract, same_hemisphere};
pub use origin_offset::{Room, SEGMENT_SHARE, offset, offset_distance, segment};
pub use point::Surface;
pub use shapes::{Placement, Shapes, Times, affine};
pub use triangle::{
    DEFAULT_UV, Plane, Vertices, corners, interpolate, triangle_normals, vertex_color,
};

#[cfg(test)]
mod tests;
