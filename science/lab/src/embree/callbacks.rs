//! Functions that Embree calls: opacity and user geometry of our kernel, visits of all hits, and nearest triangles.

use std::ffi::{c_int, c_uint, c_void};
use std::sync::Arc;

use antumbra::cutout::{Candidate, Opacity, QueryKind};
use antumbra::shapes::{TriangleMesh, UserGeometry};
use antumbra::{INVALID_ID, PrimId};

use glam::Vec3;

use super::{RayHit, SingleRay};

/// Opacity of the mesh that a filter function is called for: its user data.
pub type Filter = Arc<dyn Opacity>;

/// User data of the geometry that a function is called for.
pub type Shapes = Arc<dyn UserGeometry>;

/// `RTCFilterFunctionNArguments`.
#[repr(C)]
pub struct FilterArguments {
    /// -1 for every lane with a hit; 0 afterwards rejects it.
    valid: *mut c_int,
    user: *mut c_void,
    context: *mut c_void,
    /// `RTCRayN`: property by property, `lanes` values each.
    ray: *const u32,
    /// `RTCHitN`, likewise.
    hit: *const u32,
    lanes: c_uint,
}

/// `RTCFilterFunctionN`.
pub type FilterFunction = unsafe extern "C" fn(*const FilterArguments);

/// Properties of `RTCRayN` and `RTCHitN`, by position.
const RAY_ID: usize = 10;
const U: usize = 3;
const V: usize = 4;
const PRIM_ID: usize = 5;
const GEOM_ID: usize = 6;

/// Rejects the hits of which `rejects` says so, given the number of the ray and u, v, primitive and geometry of the hit.
///
/// # Safety
/// To be called with arguments that Embree passes.
#[inline]
unsafe fn filter(arguments: &FilterArguments, mut rejects: impl FnMut(u32, [u32; 4]) -> bool) {
    let lanes = arguments.lanes as usize;
    for lane in 0..lanes {
        // SAFETY: there is a mask, and a value of every property of a ray and a hit, for each of the lanes.
        let (valid, ray, hit) = unsafe {
            let value = |of: *const u32, property: usize| *of.add(property * lanes + lane);
            let hit = [U, V, PRIM_ID, GEOM_ID].map(|property| value(arguments.hit, property));
            (
                &mut *arguments.valid.add(lane),
                value(arguments.ray, RAY_ID),
                hit,
            )
        };
        if *valid != 0 && rejects(ray, hit) {
            *valid = 0;
        }
    }
}

/// For `rtcSetGeometryOccludedFilterFunction`.
pub unsafe extern "C" fn holes_occluded(arguments: *const FilterArguments) {
    // SAFETY: the caller's duty is the same.
    unsafe { reject_holes(arguments, QueryKind::Occluded) }
}

/// For `rtcSetGeometryIntersectFilterFunction`.
pub unsafe extern "C" fn holes_intersect(arguments: *const FilterArguments) {
    // SAFETY: the caller's duty is the same.
    unsafe { reject_holes(arguments, QueryKind::Intersect) }
}

/// Rejects hits where the opacity is 0. Anything more counts as opaque: Embree knows no hash of ours, and the masks of
/// scene files are one or the other.
///
/// # Safety
/// To be called by Embree, for a geometry whose user data is a [`Filter`] that outlives its scene.
#[inline]
unsafe fn reject_holes(arguments: *const FilterArguments, query: QueryKind) {
    // SAFETY: Embree passes a pointer to its arguments, and the user data that was set, see above.
    unsafe {
        let arguments = &*arguments;
        let opacity = &*arguments.user.cast::<Filter>();
        filter(arguments, |_, [u, v, prim_id, geom_id]| {
            let triangle = PrimId {
                inst_id: INVALID_ID,
                geom_id,
                prim_id,
            };
            let uv = [u, v].map(f32::from_bits);
            !(opacity.opacity(&Candidate::new(uv, triangle, query)) > 0.0)
        });
    }
}

/// `RTCRayQueryContext`, with what [`visit_hits`] needs behind it.
#[repr(C)]
pub struct Visiting<T, F> {
    instances: [c_uint; 2],
    values: *mut T,
    visit: *const F,
}

impl<T, F> Visiting<T, F> {
    pub fn new(values: &mut [T], visit: &F) -> Self {
        Self {
            instances: [INVALID_ID; 2],
            values: values.as_mut_ptr(),
            visit,
        }
    }
}

/// A filter of arguments: visits a hit and lets the ray through.
pub unsafe extern "C" fn visit_hits<T, F: Fn(&mut T, u32)>(arguments: *const FilterArguments) {
    // SAFETY: Embree passes its arguments with the context of the call; rays are numbered by their values.
    unsafe {
        let arguments = &*arguments;
        let visiting = &*arguments.context.cast::<Visiting<T, F>>();
        filter(arguments, |ray, [_, _, prim_id, _]| {
            (*visiting.visit)(&mut *visiting.values.add(ray as usize), prim_id);
            true
        });
    }
}

/// `RTCBounds`.
#[repr(C, align(16))]
pub struct Bounds {
    lower: [f32; 4],
    upper: [f32; 4],
}

/// `RTCBoundsFunctionArguments`.
#[repr(C)]
pub struct BoundsArguments {
    user: *mut c_void,
    prim_id: c_uint,
    time_step: c_uint,
    bounds: *mut Bounds,
}

/// `RTCIntersectFunctionNArguments` and `RTCOccludedFunctionNArguments`. Of one lane, rays have the layouts of single ones.
#[repr(C)]
pub struct UserArguments<R> {
    /// -1 for every lane with a ray.
    valid: *const c_int,
    user: *mut c_void,
    prim_id: c_uint,
    context: *const c_void,
    ray: *mut R,
    lanes: c_uint,
    geom_id: c_uint,
}

pub type BoundsFunction = unsafe extern "C" fn(*const BoundsArguments);
pub type IntersectFunction = unsafe extern "C" fn(*const UserArguments<RayHit>);
pub type OccludedFunction = unsafe extern "C" fn(*const UserArguments<SingleRay>);

/// For `rtcSetGeometryBoundsFunction`.
pub unsafe extern "C" fn user_bounds(arguments: *const BoundsArguments) {
    let padded = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
    // SAFETY: Embree passes a pointer to its arguments, with the user data that was set, which outlives the scene, and with room
    // for an `RTCBounds`.
    unsafe {
        let arguments = &*arguments;
        let bounds = (*arguments.user.cast::<Shapes>()).bounds(arguments.prim_id);
        *arguments.bounds = Bounds {
            lower: padded(bounds.min),
            upper: padded(bounds.max),
        };
    }
}

impl<R> UserArguments<R> {
    /// The ray and the shapes, if there is one ray: scenes are queried by single rays.
    ///
    /// # Safety
    /// Embree passes the arguments, with the user data that was set: a list that outlives the scene.
    #[allow(clippy::mut_from_ref, reason = "nobody else has the ray")]
    unsafe fn one(&self) -> Option<(&mut R, &Shapes)> {
        // SAFETY: there is a mask for the first lane, and a ray if it says so.
        unsafe {
            (self.lanes == 1 && *self.valid != 0)
                .then(|| (&mut *self.ray, &*self.user.cast::<Shapes>()))
        }
    }
}

/// For `rtcSetGeometryIntersectFunction`, of scenes that are queried by single rays.
pub unsafe extern "C" fn user_intersect(arguments: *const UserArguments<RayHit>) {
    // SAFETY: as above.
    let (arguments, one) = unsafe { (&*arguments, (*arguments).one()) };
    let prim_id = arguments.prim_id;
    if let Some((ray, shapes)) = one
        && let Some(hit) = shapes.intersect(prim_id, &ray.to_kernel())
    {
        ray.meet(hit, [prim_id, arguments.geom_id]);
    }
}

/// For `rtcSetGeometryOccludedFunction`, of scenes that are queried by single rays.
pub unsafe extern "C" fn user_occluded(arguments: *const UserArguments<SingleRay>) {
    // SAFETY: as above.
    let (arguments, one) = unsafe { (&*arguments, (*arguments).one()) };
    if let Some((ray, shapes)) = one
        && shapes.occluded(arguments.prim_id, &ray.to_kernel())
    {
        ray.stop();
    }
}

/// `RTCPointQuery`.
#[repr(C, align(16))]
pub struct PointQuery {
    position: [f32; 3],
    time: f32,
    radius: f32,
}

impl PointQuery {
    pub fn new(position: [f32; 3], radius: f32) -> Self {
        Self {
            position,
            time: 0.0,
            radius,
        }
    }
}

/// `RTCPointQueryContext` of scenes without instances: nothing in it is looked at but the height of its stack, which is 0
/// at any place.
#[repr(C, align(16))]
pub struct PointContext([u32; 40]);

impl Default for PointContext {
    fn default() -> Self {
        Self([0; 40])
    }
}

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

/// What is nearest to a point so far.
pub struct Nearest<'m> {
    mesh: &'m TriangleMesh<'m>,
    distance2: f32,
}

impl<'m> Nearest<'m> {
    pub fn new(mesh: &'m TriangleMesh<'m>) -> Self {
        Self {
            mesh,
            distance2: f32::INFINITY,
        }
    }

    pub fn distance(&self) -> f32 {
        self.distance2.sqrt()
    }
}

/// Shrinks the query to the distance of a triangle, if that is nearer.
pub unsafe extern "C" fn nearer(arguments: *mut PointArguments) -> bool {
    // SAFETY: Embree passes a pointer to its arguments, with the query and the user data that it was given.
    let (query, nearest, triangle) = unsafe {
        let arguments = &*arguments;
        let nearest = &mut *arguments.user.cast::<Nearest>();
        (&mut *arguments.query, nearest, arguments.prim_id)
    };
    let mesh = nearest.mesh;
    let corners = mesh.indices[triangle as usize].map(|index| mesh.positions[index as usize]);
    let distance2 = distance2(query.position, corners);
    if distance2 < nearest.distance2 {
        nearest.distance2 = distance2;
        query.radius = distance2.sqrt();
        return true;
    }
    false
}

/// Square of the distance of a point from a triangle, by the region of its plane that the point is above (Ericson 2004,
/// "Real-Time Collision Detection", 5.1.5).
fn distance2(point: [f32; 3], [a, b, c]: [[f32; 3]; 3]) -> f32 {
    let [point, a, b, c] = [point, a, b, c].map(Vec3::from);
    let (ab, ac) = (b - a, c - a);
    let to = |s: f32, t: f32| (point - a - s * ab - t * ac).length_squared();
    let along = |corner: Vec3| {
        let off = point - corner;
        (ab.dot(off), ac.dot(off))
    };
    let (b_at_a, c_at_a) = along(a);
    if b_at_a <= 0.0 && c_at_a <= 0.0 {
        return to(0.0, 0.0);
    }
    let (b_at_b, c_at_b) = along(b);
    if b_at_b >= 0.0 && c_at_b <= b_at_b {
        return to(1.0, 0.0);
    }
    let beyond_ab = b_at_a * c_at_b - b_at_b * c_at_a;
    if beyond_ab <= 0.0 && b_at_a >= 0.0 && b_at_b <= 0.0 {
        return to(b_at_a / (b_at_a - b_at_b), 0.0);
    }
    let (b_at_c, c_at_c) = along(c);
    if c_at_c >= 0.0 && b_at_c <= c_at_c {
        return to(0.0, 1.0);
    }
    let beyond_ac = b_at_c * c_at_a - b_at_a * c_at_c;
    if beyond_ac <= 0.0 && c_at_a >= 0.0 && c_at_c <= 0.0 {
        return to(0.0, c_at_a / (c_at_a - c_at_c));
    }
    let beyond_bc = b_at_b * c_at_c - b_at_c * c_at_b;
    let (from_b, from_c) = (c_at_b - b_at_b, b_at_c - c_at_c);
    if beyond_bc <= 0.0 && from_b >= 0.0 && from_c >= 0.0 {
        let part = from_b / (from_b + from_c);
        return to(1.0 - part, part);
    }
    let all = beyond_ab + beyond_ac + beyond_bc;
    to(beyond_ac / all, beyond_ab / all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;

    #[test]
    fn layouts_are_those_of_the_headers() {
        assert_eq!(
            (size_of::<PointQuery>(), align_of::<PointQuery>()),
            (32, 16)
        );
        assert_eq!(offset_of!(PointQuery, radius), 16);
        assert_eq!(offset_of!(PointArguments, prim_id), 16);
        assert_eq!(offset_of!(PointArguments, context), 24);
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
