//! Functions and data of the client that belong to geometries.

use super::*;

/// Changes a setting of a geometry.
///
/// # Safety
/// A geometry of this library, or null.
unsafe fn set(geometry: *const Geometry, set: impl FnOnce(&mut State)) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.change(|state| {
                set(state);
                Ok(())
            })
        })
    }
}

/// Changes a setting that only user geometry has.
///
/// # Safety
/// A geometry of this library, or null.
unsafe fn set_of_user(geometry: *const Geometry, set: impl FnOnce(&mut State)) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.must_be(&[Kind::User], "user geometries")?;
            geometry.change(|state| {
                set(state);
                Ok(())
            })
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryIntersectFilterFunction(
    geometry: *const Geometry,
    filter: Option<FilterFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe { set(geometry, |state| state.intersect_filter = filter) }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryOccludedFilterFunction(
    geometry: *const Geometry,
    filter: Option<FilterFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe { set(geometry, |state| state.occluded_filter = filter) }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryEnableFilterFunctionFromArguments(
    geometry: *const Geometry,
    is_enabled: bool,
) {
    // SAFETY: the caller's handle.
    unsafe { set(geometry, |state| state.takes_argument_filter = is_enabled) }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryUserData(geometry: *const Geometry, user: *mut c_void) {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, (), |geometry| {
            geometry.user.store(user, Ordering::Release);
            Ok(())
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryUserData(geometry: *const Geometry) -> *mut c_void {
    // SAFETY: the caller's handle.
    unsafe {
        with(geometry, std::ptr::null_mut(), |geometry| {
            Ok(geometry.user())
        })
    }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryPointQueryFunction(
    geometry: *const Geometry,
    function: Option<PointFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe { set(geometry, |state| state.point = function) }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryUserPrimitiveCount(geometry: *const Geometry, count: u32) {
    // SAFETY: the caller's handle.
    unsafe { set_of_user(geometry, |state| state.user_count = count) }
}

/// The function receives the user data of the geometry, as with Embree; `_user` is not used there either.
///
/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryBoundsFunction(
    geometry: *const Geometry,
    bounds: Option<BoundsFunction>,
    _user: *mut c_void,
) {
    // SAFETY: the caller's handle.
    unsafe { set_of_user(geometry, |state| state.bounds = bounds) }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryIntersectFunction(
    geometry: *const Geometry,
    intersect: Option<IntersectFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe { set_of_user(geometry, |state| state.intersect = intersect) }
}

/// # Safety
/// A geometry of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetGeometryOccludedFunction(
    geometry: *const Geometry,
    occluded: Option<IntersectFunction>,
) {
    // SAFETY: the caller's handle.
    unsafe { set_of_user(geometry, |state| state.occluded = occluded) }
}
