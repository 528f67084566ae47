//! Functions, data and numbers of the client that belong to geometries.

use std::ffi::c_void;
use std::sync::atomic::Ordering;

use super::kind::unsupported;
use super::{Geometry, Kind};
use crate::abi::{BoundsFunction, FilterFunction, IntersectFunction, PointFunction};
use crate::device::Failure;

/// Declares functions that set one field of a geometry.
macro_rules! setters {
    ($($name:ident: $field:ident, $type:ty;)*) => {
        exports! {
            $(fn $name(geometry: Geometry, value: $type) {
                geometry.set(|state| state.$field = value)
            })*
        }
    };
}

setters! {
    rtcSetGeometryIntersectFilterFunction: intersect_filter, Option<FilterFunction>;
    rtcSetGeometryOccludedFilterFunction: occluded_filter, Option<FilterFunction>;
    rtcSetGeometryEnableFilterFunctionFromArguments: takes_argument_filter, bool;
    rtcSetGeometryPointQueryFunction: point, Option<PointFunction>;
    rtcSetGeometryMask: mask, u32;
}

exports! {
    fn rtcSetGeometryUserPrimitiveCount(geometry: Geometry, count: u32) {
        geometry.set_of_user(|state| state.user_count = count)
    }

    // The function receives the user data of the geometry, as with Embree; `_user` is not used there either.
    fn rtcSetGeometryBoundsFunction(geometry: Geometry, bounds: Option<BoundsFunction>, _user: *mut c_void) {
        geometry.set_of_user(|state| state.bounds = bounds)
    }

    fn rtcSetGeometryIntersectFunction(geometry: Geometry, intersect: Option<IntersectFunction>) {
        geometry.set_of_user(|state| state.intersect = intersect)
    }

    fn rtcSetGeometryOccludedFunction(geometry: Geometry, occluded: Option<IntersectFunction>) {
        geometry.set_of_user(|state| state.occluded = occluded)
    }

    fn rtcSetGeometryUserData(geometry: Geometry, user: *mut c_void) {
        geometry.user.store(user, Ordering::Release);
        Ok(())
    }

    fn rtcGetGeometryUserData(geometry: Geometry) -> *mut c_void {
        Ok(geometry.user())
    }

    fn rtcSetGeometryTimeStepCount(_geometry: Geometry, count: u32) {
        match count {
            1 => Ok(()),
            0 | 130.. => Err(Failure::argument("number of time steps is out of range")),
            _ => Err(unsupported("several time steps")),
        }
    }

    fn rtcSetGeometryVertexAttributeCount(geometry: Geometry, count: u32) {
        if !geometry.kind.has_corners() || count > 1 << 16 {
            return Err(Failure::operation("no so many attributes for this geometry"));
        }
        geometry.set(|state| state.attributes.resize(count as usize, None))
    }

    // Checks the quality, which has no effect: the build quality of the scene decides how trees are built.
    fn rtcSetGeometryBuildQuality(_geometry: Geometry, quality: u32) {
        match quality {
            0..=3 => Ok(()),
            _ => Err(Failure::argument("invalid build quality")),
        }
    }

    // Number of quads of each cubic curve. A linear curve has none.
    fn rtcSetGeometryTessellationRate(geometry: Geometry, rate: f32) {
        if !matches!(geometry.kind, Kind::Curves(_)) {
            return Err(Failure::operation("operation only allowed for curves"));
        }
        geometry.set(|state| state.tessellation = (rate as u32).clamp(1, 16))
    }
}
