//! Functions of Embree that are not here: each reports `RTC_ERROR_INVALID_OPERATION`, and returns 0.

use std::ffi::c_void;

use crate::device::{Device, Failure, Handle, report};
use crate::geometry::Geometry;
use crate::scene::{Scene, report_to_running};

fn unsupported(name: &str) -> Failure {
    Failure::operation(format!("{name} is not supported"))
}

/// # Safety
/// A handle of this library, or null.
unsafe fn refuse<T: Handle>(name: &str, handle: *const T) -> *const c_void {
    // SAFETY: the caller's handle.
    report(
        unsafe { handle.as_ref() }.map(Handle::device),
        &unsupported(name),
    );
    std::ptr::null()
}

macro_rules! missing {
    ($($handle:ty: $($name:ident)*;)*) => {$($(
        /// # Safety
        /// The first argument is a handle of this library, or null.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(handle: *const $handle) -> *const c_void {
            // SAFETY: the caller's handle.
            unsafe { refuse(stringify!($name), handle) }
        }
    )*)*};
    // Functions that a user geometry's function calls, with arguments of its own: the failure belongs to its device.
    (forwards: $($name:ident)*) => {$(
        #[unsafe(no_mangle)]
        pub extern "C" fn $name() -> *const c_void {
            report_to_running(&unsupported(stringify!($name)));
            std::ptr::null()
        }
    )*};
    // Functions whose first argument is no handle: the failure belongs to the thread.
    ($($name:ident)*) => {$(
        #[unsafe(no_mangle)]
        pub extern "C" fn $name() -> *const c_void {
            // SAFETY: null is no handle.
            unsafe { refuse(stringify!($name), std::ptr::null::<Device>()) }
        }
    )*};
}

missing! {
    Device: rtcNewBVH;
    Scene: rtcGetSceneLinearBounds;
    Geometry:
        rtcGetGeometryFace rtcGetGeometryFirstHalfEdge rtcGetGeometryNextHalfEdge rtcGetGeometryOppositeHalfEdge
        rtcGetGeometryPreviousHalfEdge rtcSetGeometryDisplacementFunction rtcSetGeometryMaxRadiusScale
        rtcSetGeometrySubdivisionMode rtcSetGeometryTimeRange
        rtcSetGeometryTopologyCount rtcSetGeometryVertexAttributeTopology;
}

missing! {
    rtcBuildBVH rtcCollide rtcMakeStaticBVH rtcReleaseBVH rtcRetainBVH rtcThreadLocalAlloc
}

missing! {
    forwards:
    rtcForwardIntersect1 rtcForwardIntersect1Ex rtcForwardIntersect4 rtcForwardIntersect4Ex rtcForwardIntersect8
    rtcForwardIntersect8Ex rtcForwardIntersect16 rtcForwardIntersect16Ex rtcForwardOccluded1 rtcForwardOccluded1Ex
    rtcForwardOccluded4 rtcForwardOccluded4Ex rtcForwardOccluded8 rtcForwardOccluded8Ex rtcForwardOccluded16
    rtcForwardOccluded16Ex rtcTraversableForwardIntersect1 rtcTraversableForwardIntersect1Ex
    rtcTraversableForwardIntersect4 rtcTraversableForwardIntersect4Ex rtcTraversableForwardIntersect8
    rtcTraversableForwardIntersect8Ex rtcTraversableForwardIntersect16 rtcTraversableForwardIntersect16Ex
    rtcTraversableForwardOccluded1 rtcTraversableForwardOccluded1Ex rtcTraversableForwardOccluded4
    rtcTraversableForwardOccluded4Ex rtcTraversableForwardOccluded8 rtcTraversableForwardOccluded8Ex
    rtcTraversableForwardOccluded16 rtcTraversableForwardOccluded16Ex
}
