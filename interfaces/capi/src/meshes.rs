//! Meshes of triangles and quads in scenes: corners, vertices in single and double precision.

use crate::arrays::{Items, MaybeSlot, Plain};
use crate::interface::functions;
use crate::scene::{Part, Scene};
use crate::status::{Failure, Outcome, Status};

/// Corners of the primitives of a mesh: those given, or all vertices in their order.
///
/// # Safety
/// As [`Items::new`].
unsafe fn corners<const N: usize>(
    vertices: usize,
    (indices, count, stride): (*const u32, usize, usize),
) -> Outcome<Vec<[u32; N]>>
where
    [u32; N]: Plain,
{
    if !indices.is_null() {
        // SAFETY: the caller's promise.
        return Ok(unsafe { Items::new(indices.cast(), count, stride, "indices") }?.to_vec());
    }
    if count.checked_mul(N) != Some(vertices) {
        return Err(Failure::argument(format_args!(
            "without `indices`, {count} primitives of {N} corners need {N} times as many vertices, not {vertices}"
        )));
    }
    if u32::try_from(vertices).is_err() {
        return Err(Failure::new(Status::TooMany, "more than 2^32 vertices"));
    }
    let first = (0..vertices as u32).step_by(N);
    Ok(first
        .map(|first| std::array::from_fn(|corner| first + corner as u32))
        .collect())
}

/// Number of which points are made.
trait Coordinate: Sized {
    fn positions(scene: &Scene, points: &Items<'_, [Self; 3]>) -> Vec<[f32; 3]>;
}

impl Coordinate for f32 {
    fn positions(_: &Scene, points: &Items<'_, [f32; 3]>) -> Vec<[f32; 3]> {
        points.to_vec()
    }
}

impl Coordinate for f64 {
    fn positions(scene: &Scene, points: &Items<'_, [f64; 3]>) -> Vec<[f32; 3]> {
        scene.local(points)
    }
}

/// Points around the origin of a scene, of an address, a count and a stride.
///
/// # Safety
/// As of [`Items::new`].
unsafe fn points<T: Coordinate>(
    scene: &Scene,
    (points, count, stride): (*const T, usize, usize),
) -> Outcome<Vec<[f32; 3]>>
where
    [T; 3]: Plain,
{
    // SAFETY: the caller's promise.
    let points = unsafe { Items::new(points.cast(), count, stride, "positions") }?;
    Ok(T::positions(scene, &points))
}

/// Points, and primitives of `N` corners.
type Mesh<const N: usize> = (Vec<[f32; 3]>, Vec<[u32; N]>);

/// Points and corners of a mesh.
///
/// # Safety
/// As of [`Items::new`].
unsafe fn mesh<T: Coordinate, const N: usize>(
    scene: &Scene,
    positions: (*const T, usize, usize),
    indices: (*const u32, usize, usize),
) -> Outcome<Mesh<N>>
where
    [T; 3]: Plain,
    [u32; N]: Plain,
{
    // SAFETY: the caller's promise.
    unsafe { Ok((points(scene, positions)?, corners(positions.1, indices)?)) }
}

functions! {
    /// Adds a triangle mesh.
    ///
    /// `positions` has `position_count` points of 3 floats, `indices` has `triangle_count` times 3 indices of points. Without
    /// indices (NULL) every 3 points are a triangle, and triangle_count must be position_count / 3. `geom_id` may be NULL. Indices
    /// are checked at build.
    ///
    /// Errors: INVALID_ARGUMENT, TOO_MANY.
    fn antumbra_scene_add_triangles(
        scene: &mut Scene,
        positions: *const f32,
        position_count: usize,
        position_stride: usize,
        indices: *const u32,
        triangle_count: usize,
        index_stride: usize,
        geom_id: MaybeSlot<u32>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (positions, indices) = unsafe {
            let positions = (positions, position_count, position_stride);
            mesh(scene, positions, (indices, triangle_count, index_stride))
        }?;
        scene.add(Part::triangles(positions, indices), &geom_id)
    }

    /// antumbra_scene_add_triangles() with points of 3 doubles, from which the origin of the scene is subtracted.
    fn antumbra_scene_add_triangles_f64(
        scene: &mut Scene,
        positions: *const f64,
        position_count: usize,
        position_stride: usize,
        indices: *const u32,
        triangle_count: usize,
        index_stride: usize,
        geom_id: MaybeSlot<u32>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (positions, indices) = unsafe {
            let positions = (positions, position_count, position_stride);
            mesh(scene, positions, (indices, triangle_count, index_stride))
        }?;
        scene.add(Part::triangles(positions, indices), &geom_id)
    }

    /// Adds a mesh of quads: as antumbra_scene_add_triangles() with 4 indices each.
    ///
    /// A quad with the corners 0, 1, 2, 3 is the two triangles (0, 1, 3) and (2, 3, 1), which have one prim_id and fit without a
    /// gap. The corners need not be in one plane. If the third index equals the fourth, only the first triangle is there.
    fn antumbra_scene_add_quads(
        scene: &mut Scene,
        positions: *const f32,
        position_count: usize,
        position_stride: usize,
        indices: *const u32,
        quad_count: usize,
        index_stride: usize,
        geom_id: MaybeSlot<u32>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (positions, indices) = unsafe {
            let positions = (positions, position_count, position_stride);
            mesh(scene, positions, (indices, quad_count, index_stride))
        }?;
        scene.add(Part::Quads { positions, indices }, &geom_id)
    }

    /// antumbra_scene_add_quads() with points of 3 doubles, from which the origin of the scene is subtracted.
    fn antumbra_scene_add_quads_f64(
        scene: &mut Scene,
        positions: *const f64,
        position_count: usize,
        position_stride: usize,
        indices: *const u32,
        quad_count: usize,
        index_stride: usize,
        geom_id: MaybeSlot<u32>,
    ) {
        // SAFETY: the header says what is at these addresses.
        let (positions, indices) = unsafe {
            let positions = (positions, position_count, position_stride);
            mesh(scene, positions, (indices, quad_count, index_stride))
        }?;
        scene.add(Part::Quads { positions, indices }, &geom_id)
    }

    /// Replaces the positions of a mesh of triangles or quads by as many others, for a refit.
    ///
    /// Errors: INVALID_ARGUMENT if there are more or fewer; UNSUPPORTED if the geometry has no vertices.
    fn antumbra_scene_set_positions(
        scene: &mut Scene,
        geom_id: u32,
        positions: *const f32,
        position_count: usize,
        position_stride: usize,
    ) {
        let given = (positions, position_count, position_stride);
        // SAFETY: the header says what is at these addresses.
        let positions = unsafe { points(scene, given) }?;
        scene.set_positions(geom_id, positions)
    }

    /// antumbra_scene_set_positions() with points of 3 doubles, from which the origin of the scene is subtracted.
    fn antumbra_scene_set_positions_f64(
        scene: &mut Scene,
        geom_id: u32,
        positions: *const f64,
        position_count: usize,
        position_stride: usize,
    ) {
        let given = (positions, position_count, position_stride);
        // SAFETY: the header says what is at these addresses.
        let positions = unsafe { points(scene, given) }?;
        scene.set_positions(geom_id, positions)
    }
}
