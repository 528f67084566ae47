//! Filter functions, called by Embree for every hit on a mesh with an alpha mask: our kernel's test of opacity.

use std::ffi::{c_int, c_uint, c_void};
use std::sync::Arc;

use antumbra::cutout::{Candidate, Opacity, QueryKind};
use antumbra::{INVALID_ID, PrimId};

/// Opacity of the mesh that a filter function is called for.
pub type Filter = Arc<dyn Opacity>;

/// `RTCFilterFunctionNArguments`.
#[repr(C)]
pub struct FilterArguments {
    /// -1 for every lane with a hit; 0 afterwards rejects it.
    valid: *mut c_int,
    user: *mut c_void,
    context: *const c_void,
    ray: *mut c_void,
    /// `RTCHitN`: property by property, `lanes` values each.
    hit: *const u32,
    lanes: c_uint,
}

/// `RTCFilterFunctionN`.
pub type FilterFunction = unsafe extern "C" fn(*const FilterArguments);

/// Properties of `RTCHitN`, by position.
const U: usize = 3;
const V: usize = 4;
const PRIM_ID: usize = 5;
const GEOM_ID: usize = 6;

/// For `rtcSetGeometryOccludedFilterFunction`.
pub unsafe extern "C" fn occluded(arguments: *const FilterArguments) {
    // SAFETY: the caller's duty is the same.
    unsafe { reject_holes(arguments, QueryKind::Occluded) }
}

/// For `rtcSetGeometryIntersectFilterFunction`.
pub unsafe extern "C" fn intersect(arguments: *const FilterArguments) {
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
    let (arguments, filter) = unsafe {
        let arguments = &*arguments;
        (arguments, &*arguments.user.cast::<Filter>())
    };
    let lanes = arguments.lanes as usize;
    for lane in 0..lanes {
        // SAFETY: there is a mask, and a value of every property of a hit, for each of the lanes.
        let (valid, [u, v, prim_id, geom_id]) = unsafe {
            let value = |property: usize| *arguments.hit.add(property * lanes + lane);
            let valid = &mut *arguments.valid.add(lane);
            (valid, [value(U), value(V), value(PRIM_ID), value(GEOM_ID)])
        };
        if *valid == 0 {
            continue;
        }
        let triangle = PrimId {
            inst_id: INVALID_ID,
            geom_id,
            prim_id,
        };
        let opacity = filter.opacity(&Candidate::new([u, v].map(f32::from_bits), triangle, query));
        if !(opacity > 0.0) {
            *valid = 0;
        }
    }
}
