//! Queries about points: `rtcPointQuery` with a function that finds the nearest point of a triangle.

use std::ffi::{c_uint, c_void};

use antumbra::shapes::TriangleMesh;

use super::Scene;

/// `RTCPointQuery`.
#[repr(C, align(16))]
pub struct PointQuery {
    position: [f32; 3],
    time: f32,
    radius: f32,
}

/// `RTCPointQueryContext` of scenes without instances: nothing in it is looked at but the height of its stack, which is 0
/// at any place.
#[repr(C, align(16))]
pub struct PointContext([u32; 40]);

/// `RTCPointQueryFunctionArguments`.
#[repr(C, align(16))]
pub struct PointArguments {
    query: *mut PointQuery,
    user: *mut c_void,
    prim_id: c_uint,
    geom_id: c_uint,
    context: *mut PointContext,
    similarity: f32,
}

/// `RTCPointQueryFunction`.
pub type PointFunction = unsafe extern "C" fn(*mut PointArguments) -> bool;

/// A point and what is nearest so far.
struct Nearest<'m> {
    mesh: &'m TriangleMesh<'m>,
    distance2: f32,
}

impl Scene<'_> {
    /// Distance of the nearest triangle for every point, of a scene that is this one mesh.
    pub fn distances(&self, mesh: &TriangleMesh, points: &[[f32; 3]], distances: &mut [f32]) {
        let world = self.world();
        let point_query = world.functions().point_query;
        for (&position, distance) in points.iter().zip(distances) {
            let mut nearest = Nearest {
                mesh,
                distance2: f32::INFINITY,
            };
            let mut query = PointQuery {
                position,
                time: 0.0,
                radius: f32::INFINITY,
            };
            let mut context = PointContext([0; 40]);
            let user: *mut Nearest = &raw mut nearest;
            // SAFETY: the scene is committed and alive. Query and context have their layouts, and the function is told what
            // it expects.
            unsafe {
                point_query(
                    world.handle,
                    &mut query,
                    &mut context,
                    Some(visit),
                    user.cast(),
                );
            }
            *distance = nearest.distance2.sqrt();
        }
    }
}

/// Shrinks the query to the distance of a triangle, if that is nearer.
unsafe extern "C" fn visit(arguments: *mut PointArguments) -> bool {
    // SAFETY: Embree passes a pointer to its arguments, with the query and the user data that it was given.
    let (arguments, query, nearest) = unsafe {
        let arguments = &*arguments;
        (
            arguments,
            &mut *arguments.query,
            &mut *arguments.user.cast::<Nearest>(),
        )
    };
    let mesh = nearest.mesh;
    let triangle = mesh.indices[arguments.prim_id as usize];
    let corners = triangle.map(|index| mesh.positions[index as usize]);
    let distance2 = distance2(query.position, corners);
    if distance2 < nearest.distance2 {
        nearest.distance2 = distance2;
        query.radius = distance2.sqrt();
        return true;
    }
    false
}

/// Square of the distance of a point from a triangle: over the inside, or else over the nearest side.
fn distance2(point: [f32; 3], [a, b, c]: [[f32; 3]; 3]) -> f32 {
    let minus = |p: [f32; 3], q: [f32; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let dot = |p: [f32; 3], q: [f32; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let (ab, ac, ap) = (minus(b, a), minus(c, a), minus(point, a));
    let (bb, cc, bc) = (dot(ab, ab), dot(ac, ac), dot(ab, ac));
    let (pb, pc) = (dot(ap, ab), dot(ap, ac));
    let all = bb * cc - bc * bc;
    let (u, v) = (cc * pb - bc * pc, bb * pc - bc * pb);
    if u >= 0.0 && v >= 0.0 && u + v <= all && all > 0.0 {
        let (u, v) = (u / all, v / all);
        let off = [0, 1, 2].map(|axis| ap[axis] - u * ab[axis] - v * ac[axis]);
        return dot(off, off);
    }
    let side = |from: [f32; 3], to: [f32; 3]| {
        let (along, off) = (minus(to, from), minus(point, from));
        let length2 = dot(along, along);
        let part = if length2 > 0.0 {
            (dot(off, along) / length2).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let off = [0, 1, 2].map(|axis| off[axis] - part * along[axis]);
        dot(off, off)
    };
    side(a, b).min(side(b, c)).min(side(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_are_those_of_the_headers() {
        assert_eq!(
            (size_of::<PointQuery>(), align_of::<PointQuery>()),
            (32, 16)
        );
        assert_eq!(std::mem::offset_of!(PointQuery, radius), 16);
        assert_eq!(std::mem::offset_of!(PointArguments, prim_id), 16);
        assert_eq!(std::mem::offset_of!(PointArguments, context), 24);
        // Two matrices and three numbers.
        assert!(size_of::<PointContext>() >= 2 * 64 + 12);
    }

    #[test]
    fn distances_of_a_triangle() {
        let corners = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        for (point, expected) in [
            ([0.5, 0.5, 3.0], 9.0),
            ([-3.0, -4.0, 0.0], 25.0),
            ([1.0, -2.0, 0.0], 4.0),
            ([2.0, 2.0, 0.0], 2.0),
            ([5.0, 0.0, 4.0], 25.0),
        ] {
            assert_eq!(distance2(point, corners), expected, "{point:?}");
        }
    }
}
