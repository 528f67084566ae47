//! Point queries: functions of the client are called about primitives near a point, the nearest first.

use std::collections::HashSet;
use std::ffi::{c_int, c_void};

use antumbra::ClosestPoint;

use super::curves::own_prim;
use crate::abi::{PointArguments, PointContext, PointFunction, PointQuery};
use crate::device::{Failure, Outcome, look_mut, with};
use crate::geometry::transform;
use crate::scene::{Committed, Scene, Traits};

/// Calls functions about every primitive in the radius, which they may shrink. Returns whether one of them did.
///
/// # Safety
/// A query and a context of the client.
unsafe fn visit(
    committed: &Committed,
    query: *mut PointQuery,
    context: *mut PointContext,
    function: Option<PointFunction>,
    user: *mut c_void,
) -> Outcome<bool> {
    // SAFETY: the caller vouches for both. Functions of the client use them as well, so no reference is kept.
    let (point, mut radius) = unsafe {
        look_mut(context)?;
        let query = look_mut(query)?;
        (query.point, query.radius)
    };
    let mut has_changed = false;
    let mut call = |near: &ClosestPoint, radius: &mut f32| {
        // SAFETY: as above.
        has_changed |= unsafe { call(committed, near, query, context, function, user) };
        // SAFETY: as above.
        *radius = radius.min(unsafe { (*query).radius });
    };
    // The nearest one shrinks most radii so far that few others are left.
    let Some(nearest) = committed.bvh().closest(point, radius) else {
        return Ok(false);
    };
    call(&nearest, &mut radius);
    // A curve has several primitives of the kernel.
    let id = |near: &ClosestPoint| {
        let site = committed.find(near.inst_id, near.geom_id);
        (near.inst_id, near.geom_id, own_prim(site, near.prim_id))
    };
    let mut called = HashSet::from([id(&nearest)]);
    for near in committed.bvh().within(point, radius) {
        let is_new = match committed.traits.has(Traits::CURVES) {
            true => called.insert(id(&near)),
            false => !called.contains(&id(&near)),
        };
        if near.distance <= radius && is_new {
            call(&near, &mut radius);
        }
    }
    Ok(has_changed)
}

/// Calls the functions about one primitive.
///
/// # Safety
/// As [`visit`].
unsafe fn call(
    committed: &Committed,
    near: &ClosestPoint,
    query: *mut PointQuery,
    context: *mut PointContext,
    function: Option<PointFunction>,
    user: *mut c_void,
) -> bool {
    let site = committed.find(near.inst_id, near.geom_id);
    // SAFETY: as the caller vouches.
    let before = unsafe { *context };
    let mut similarity = 1.0;
    if let Some(instance) = site.instance {
        similarity = transform::similarity(&instance.to_world);
        // Embree's scale is that from the world to the object.
        similarity = if similarity > 0.0 {
            1.0 / similarity
        } else {
            0.0
        };
        // SAFETY: as the caller vouches.
        unsafe {
            *context = PointContext {
                world_to_instance: instance
                    .from_world
                    .as_ref()
                    .map_or([0.0; 16], transform::columns),
                instance_to_world: transform::columns(&instance.to_world),
                inst_id: instance.geom_id,
                inst_prim_id: instance.prim_id,
                size: 1,
            };
        }
    }
    let mut has_changed = false;
    for function in [function, site.state().point].into_iter().flatten() {
        let mut arguments = PointArguments {
            query,
            user,
            prim_id: own_prim(site, near.prim_id),
            geom_id: site.placed.geom_id,
            context,
            similarity,
        };
        // SAFETY: the client's function, with arguments as documented.
        has_changed |= unsafe { function(&raw mut arguments) };
    }
    // SAFETY: as the caller vouches.
    unsafe { *context = before };
    has_changed
}

exports! {
    fn rtcPointQuery | rtcTraversablePointQuery(
        scene: Scene,
        query: *mut PointQuery,
        context: *mut PointContext,
        function: Option<PointFunction>,
        user: *mut c_void,
    ) -> bool {
        visit(scene.committed()?, query, context, function, user)
    }
}

/// Point queries of a packet: x, y, z, time and radius in arrays.
///
/// # Safety
/// A scene of this library, and `N` flags, queries and pointers.
unsafe fn packet<const N: usize>(
    valid: *const c_int,
    scene: *const Scene,
    queries: *mut f32,
    context: *mut PointContext,
    function: Option<PointFunction>,
    users: *const *mut c_void,
) -> bool {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(scene, |scene| {
            let committed = scene.committed()?;
            if valid.is_null() || queries.is_null() {
                return Err(Failure::argument("a pointer is null"));
            }
            let mut has_changed = false;
            for lane in (0..N).filter(|lane| *valid.add(*lane) == -1) {
                let field = |field: usize| queries.add(field * N + lane);
                let mut query = PointQuery {
                    point: [*field(0), *field(1), *field(2)],
                    time: *field(3),
                    radius: *field(4),
                };
                let user = if users.is_null() {
                    std::ptr::null_mut()
                } else {
                    *users.add(lane)
                };
                has_changed |= visit(committed, &raw mut query, context, function, user)?;
                *field(4) = query.radius;
            }
            Ok(has_changed)
        })
    }
}

macro_rules! packets {
    ($($size:literal: $($name:ident)*;)*) => {$($(
        /// # Safety
        /// A scene of this library, flags, queries, a context and pointers, or null ones.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            valid: *const c_int,
            scene: *const Scene,
            queries: *mut f32,
            context: *mut PointContext,
            function: Option<PointFunction>,
            users: *const *mut c_void,
        ) -> bool {
            // SAFETY: the caller's handle and memory.
            unsafe { packet::<$size>(valid, scene, queries, context, function, users) }
        }
    )*)*};
}

packets! {
    4: rtcPointQuery4 rtcTraversablePointQuery4;
    8: rtcPointQuery8 rtcTraversablePointQuery8;
    16: rtcPointQuery16 rtcTraversablePointQuery16;
}
