//! Points of surfaces: from a hit of the kernel to position, normals and frames.
//!
//! - `point.rs`: a point of a surface, and the rays that leave it
//! - `origin_offset.rs`: how far rays start from their surface
//! - `triangle.rs`: points and normals of triangles, with error bounds
//! - `shapes.rs`: shapes and placements of the scene, found by a hit
//! - `frame.rs`: orthonormal frames, reflection, refraction

mod frame;
mod origin_offset;
mod point;
mod shapes;
mod triangle;

pub use frame::{Frame, reflect, refract, same_hemisphere};
pub use point::Surface;
pub use shapes::{Placement, Shapes};
pub use triangle::{
    DEFAULT_UV, Plane, Vertices, corners, interpolate, triangle_normals, vertex_color,
};

#[cfg(test)]
mod tests;
