//! Callbacks of user geometry for Embree: the functions that our kernel calls, too.

use std::ffi::{c_int, c_uint, c_void};
use std::sync::Arc;

use antumbra::shapes::UserGeometry;

use super::{RayHit, SingleRay};

/// User data of the geometry that a function is called for.
pub type Shapes = Arc<dyn UserGeometry>;

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

/// `RTCIntersectFunctionNArguments`.
#[repr(C)]
pub struct IntersectArguments {
    /// -1 for every lane with a ray.
    valid: *const c_int,
    user: *mut c_void,
    prim_id: c_uint,
    context: *const c_void,
    /// `RTCRayHitN`: of one lane it has the layout of `RTCRayHit`.
    ray_hit: *mut RayHit,
    lanes: c_uint,
    geom_id: c_uint,
}

/// `RTCOccludedFunctionNArguments`.
#[repr(C)]
pub struct OccludedArguments {
    valid: *const c_int,
    user: *mut c_void,
    prim_id: c_uint,
    context: *const c_void,
    /// `RTCRayN`: of one lane it has the layout of `RTCRay`.
    ray: *mut SingleRay,
    lanes: c_uint,
    geom_id: c_uint,
}

/// For `rtcSetGeometryBoundsFunction`.
pub unsafe extern "C" fn bounds(arguments: *const BoundsArguments) {
    // SAFETY: Embree passes a pointer to its arguments, with the user data that was set: a list that outlives the scene.
    let (arguments, shapes) = unsafe {
        let arguments = &*arguments;
        (arguments, &*arguments.user.cast::<Shapes>())
    };
    let bounds = shapes.bounds(arguments.prim_id);
    let padded = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
    // SAFETY: there is room for an `RTCBounds`.
    unsafe {
        *arguments.bounds = Bounds {
            lower: padded(bounds.min),
            upper: padded(bounds.max),
        };
    }
}

/// For `rtcSetGeometryIntersectFunction`, of scenes that are queried by single rays.
pub unsafe extern "C" fn intersect(arguments: *const IntersectArguments) {
    // SAFETY: as above.
    let (arguments, shapes) = unsafe {
        let arguments = &*arguments;
        (arguments, &*arguments.user.cast::<Shapes>())
    };
    // SAFETY: single rays are asked about, so there is one lane, and its mask.
    let (ray_hit, valid) = unsafe { (&mut *arguments.ray_hit, *arguments.valid) };
    if arguments.lanes != 1 || valid == 0 {
        return;
    }
    let prim_id = arguments.prim_id;
    if let Some(hit) = shapes.intersect(prim_id, &ray_hit.to_kernel()) {
        ray_hit.meet(hit, [prim_id, arguments.geom_id]);
    }
}

/// For `rtcSetGeometryOccludedFunction`, of scenes that are queried by single rays.
pub unsafe extern "C" fn occluded(arguments: *const OccludedArguments) {
    // SAFETY: as above.
    let (arguments, shapes) = unsafe {
        let arguments = &*arguments;
        (arguments, &*arguments.user.cast::<Shapes>())
    };
    // SAFETY: single rays are asked about, so there is one lane, and its mask.
    let (ray, valid) = unsafe { (&mut *arguments.ray, *arguments.valid) };
    if arguments.lanes == 1 && valid != 0 && shapes.occluded(arguments.prim_id, &ray.to_kernel()) {
        ray.stop();
    }
}
