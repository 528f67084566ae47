//! Meshes of triangles and quads in scenes: corners, vertices in single and double precision.

use crate::arrays::{Items, Plain, Slot, exclusive};
use crate::scene::{Part, Scene};
use crate::status::{Failure, Outcome, Status, guarded};

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

/// A mesh of the caller becomes a part of a scene.
macro_rules! add_mesh {
    ($name:ident, $doc:literal, $Float:ty, $corners:literal, $variant:ident { $($more:tt)* }) => {
        #[doc = $doc]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            scene: *mut Scene,
            positions: *const $Float,
            position_count: usize,
            position_stride: usize,
            indices: *const u32,
            count: usize,
            index_stride: usize,
            geom_id: *mut u32,
        ) -> Status {
            guarded(|| {
                // SAFETY: the header says what is at these addresses.
                let (scene, positions, geom_id) = unsafe {
                    let positions =
                        Items::<[$Float; 3]>::new(positions.cast(), position_count, position_stride, "positions")?;
                    (exclusive(scene, "scene")?, positions, Slot::optional(geom_id, "geom_id")?)
                };
                let indices = (indices, count, index_stride);
                // SAFETY: as above.
                let indices = unsafe { corners::<$corners>(position_count, indices) }?;
                let positions = <$Float as Coordinate>::positions(scene, &positions);
                scene.add(Part::$variant { positions, indices, $($more)* }, geom_id)
            })
        }
    };
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

add_mesh!(
    antumbra_scene_add_triangles,
    "Adds a triangle mesh.",
    f32,
    3,
    Triangles { opacity: None }
);
add_mesh!(
    antumbra_scene_add_triangles_f64,
    "Adds a triangle mesh in double precision.",
    f64,
    3,
    Triangles { opacity: None }
);
add_mesh!(
    antumbra_scene_add_quads,
    "Adds a mesh of quads.",
    f32,
    4,
    Quads {}
);
add_mesh!(
    antumbra_scene_add_quads_f64,
    "Adds a mesh of quads in double precision.",
    f64,
    4,
    Quads {}
);

/// Replaces the vertices of a mesh.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_set_positions(
    scene: *mut Scene,
    geom_id: u32,
    positions: *const f32,
    position_count: usize,
    position_stride: usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (scene, positions) = unsafe {
            let positions = Items::<[f32; 3]>::new(
                positions.cast(),
                position_count,
                position_stride,
                "positions",
            )?;
            (exclusive(scene, "scene")?, positions)
        };
        scene.set_positions(geom_id, positions.to_vec())
    })
}

/// Replaces the vertices of a mesh by others in double precision.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_scene_set_positions_f64(
    scene: *mut Scene,
    geom_id: u32,
    positions: *const f64,
    position_count: usize,
    position_stride: usize,
) -> Status {
    guarded(|| {
        // SAFETY: the header says what is at these addresses.
        let (scene, positions) = unsafe {
            let positions = Items::<[f64; 3]>::new(
                positions.cast(),
                position_count,
                position_stride,
                "positions",
            )?;
            (exclusive(scene, "scene")?, positions)
        };
        let moved = scene.local(&positions);
        scene.set_positions(geom_id, moved)
    })
}
