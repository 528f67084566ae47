//! Which primitives can be kept. Geometry is checked with the same tests when a tree is built and when vertices move.

use crate::error::Error;
use crate::geometry::Geometry;
use crate::geometry::primitives::dropped::DropReason;

/// Corners by their indices. A corner is NaN, and so not sound, if its index is out of range.
#[inline(always)]
pub(crate) fn corners<const K: usize>(positions: &[[f32; 3]], indices: &[u32; K]) -> [[f32; 3]; K] {
    indices.map(|index| *positions.get(index as usize).unwrap_or(&[f32::NAN; 3]))
}

/// Whether all coordinates are finite and all corners different.
#[inline(always)]
pub(crate) fn is_sound(corners: &[[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners;
    is_finite(a) && is_finite(b) && is_finite(c) && a != b && b != c && c != a
}

#[inline(always)]
pub(crate) fn is_finite([x, y, z]: &[f32; 3]) -> bool {
    x.is_finite() && y.is_finite() && z.is_finite()
}

/// Why a triangle cannot be kept.
pub(crate) fn check_triangle(corners: &[[f32; 3]; 3]) -> Result<(), DropReason> {
    if is_sound(corners) {
        Ok(())
    } else if corners.iter().all(is_finite) {
        Err(DropReason::CornersCoincide)
    } else {
        Err(DropReason::NotFinite)
    }
}

/// Fails at the first index out of range. Without unsound primitives there is none.
pub(crate) fn check_indices(geometries: &[Geometry<'_>]) -> Result<(), Error> {
    for (geometry, geom_id) in geometries.iter().zip(0u32..) {
        match geometry {
            Geometry::Triangles(mesh) => {
                let vertices = mesh.positions.len();
                if let Some((prim_id, index)) = out_of_range(&mesh.indices, vertices) {
                    return Err(Error::IndexOutOfRange {
                        geom_id,
                        prim_id,
                        index,
                        vertices,
                    });
                }
            }
            Geometry::Quads(mesh) => {
                let vertices = mesh.positions.len();
                if let Some((prim_id, index)) = out_of_range(&mesh.indices, vertices) {
                    return Err(Error::QuadIndexOutOfRange {
                        geom_id,
                        prim_id,
                        index,
                        vertices,
                    });
                }
            }
            Geometry::Curves(curves) => {
                let vertices = curves.points.len();
                let segments = curves.segments.iter().zip(0u32..);
                let second = |first: u32| first.saturating_add(1);
                let beyond = |(first, _): &(&u32, u32)| second(**first) as usize >= vertices;
                if let Some((&first, prim_id)) = segments.into_iter().find(beyond) {
                    return Err(Error::IndexOutOfRange {
                        geom_id,
                        prim_id,
                        index: second(first),
                        vertices,
                    });
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// The first index beyond the vertices, and its primitive.
fn out_of_range<const K: usize>(indices: &[[u32; K]], vertices: usize) -> Option<(u32, u32)> {
    indices.iter().zip(0u32..).find_map(|(corners, prim_id)| {
        let beyond = corners.iter().find(|index| **index as usize >= vertices);
        beyond.map(|index| (prim_id, *index))
    })
}
