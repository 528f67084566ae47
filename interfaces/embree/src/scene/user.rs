//! User geometry: functions of the client as shapes of the kernel.
//!
//! Functions of Embree see more of a query than the kernel hands on: mask, ID and time of the ray, context and arguments.
//! Each thread keeps these data of its query while the query runs.

use std::cell::{Cell, RefCell};
use std::ffi::c_void;
use std::fmt;
use std::ptr;
use std::sync::Arc;

use antumbra::shapes::{UserGeometry, UserHit};
use antumbra::{Aabb, Ray};

use super::committed::Placed;
use crate::abi::{
    Bounds, BoundsArguments, Context, FilterArguments, INVALID, IntersectFunction, RtcHit, RtcRay,
    RtcRayHit, UserArguments,
};
use crate::device::{Failure, Handle, report};
use crate::geometry::{Filters, Geometry, Query};

/// A query that is running.
pub struct Current<'a> {
    pub ray: RtcRay,
    pub context: *mut Context,
    /// `intersect` or `occluded` of the arguments.
    pub function: Option<IntersectFunction>,
    pub filters: Filters<'a>,
    /// Hits that functions have reported.
    pub hits: RefCell<Vec<Reported>>,
}

/// A hit on user geometry.
pub struct Reported {
    geometry: *const Geometry,
    t: f32,
    hit: RtcHit,
}

impl Current<'_> {
    /// What the function has said about a hit.
    pub fn reported(&self, geometry: &Geometry, prim_id: u32, t: f32) -> Option<RtcHit> {
        let hits = self.hits.borrow();
        let of_it = hits.iter().filter(|reported| {
            ptr::eq(reported.geometry, geometry) && reported.hit.prim_id == prim_id
        });
        // The kernel may move a distance into the box.
        let nearest = of_it.min_by(|a, b| (a.t - t).abs().total_cmp(&(b.t - t).abs()));
        nearest.map(|reported| reported.hit)
    }
}

thread_local! {
    static CURRENT: Cell<*const c_void> = const { Cell::new(ptr::null()) };
    /// The geometry whose function is running.
    static RUNNING: Cell<*const Geometry> = const { Cell::new(ptr::null()) };
}

/// Reports a failure to the device of the geometry whose function is running on this thread, if there is one.
pub fn report_to_running(failure: &Failure) {
    // SAFETY: `UserShape::call` keeps the geometry alive while its function runs.
    let geometry = unsafe { RUNNING.get().as_ref() };
    report(geometry.map(Geometry::device), failure);
}

/// Runs a query while functions can see it.
pub fn with_current<T>(current: &Current<'_>, query: impl FnOnce() -> T) -> T {
    /// Puts the query back in which this one was started.
    struct Restore(*const c_void);
    impl Drop for Restore {
        fn drop(&mut self) {
            CURRENT.set(self.0);
        }
    }
    let _restore = Restore(CURRENT.replace(ptr::from_ref(current).cast()));
    query()
}

/// A user geometry, whose functions are called.
pub struct UserShape(pub Placed);

impl fmt::Debug for UserShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("UserShape")
            .field("geom_id", &self.0.geom_id)
            .finish_non_exhaustive()
    }
}

/// Arguments of a function, and what filters called from it need.
#[repr(C)]
struct Call<'a> {
    arguments: UserArguments,
    placed: &'a Placed,
    current: &'a Current<'a>,
}

impl UserShape {
    /// Calls a function for a ray in the space of the geometry. Returns the ray as the function leaves it.
    fn call(
        &self,
        function: Option<IntersectFunction>,
        prim_id: u32,
        ray: &Ray,
    ) -> Option<RtcRayHit> {
        let Self(placed) = self;
        // SAFETY: `with_current` keeps the value alive while queries run. Null while a tree is built.
        let current: &Current<'_> = unsafe { CURRENT.get().cast::<Current<'_>>().as_ref()? };
        let function = current.function.or(function)?;
        let mut rayhit = RtcRayHit {
            ray: RtcRay {
                org: ray.org,
                dir: ray.dir,
                ..current.ray
            },
            hit: RtcHit::MISS,
        };
        let mut valid = -1;
        let call = Call {
            arguments: UserArguments {
                valid: &raw mut valid,
                user: placed.geometry.user(),
                prim_id,
                context: current.context,
                ray: (&raw mut rayhit).cast(),
                n: 1,
                geom_id: placed.geom_id,
            },
            placed,
            current,
        };
        let before = RUNNING.replace(Arc::as_ptr(&placed.geometry));
        // SAFETY: the client's function, with arguments as documented; `Call` begins with them.
        unsafe { function((&raw const call).cast()) };
        RUNNING.set(before);
        Some(rayhit)
    }
}

impl UserGeometry for UserShape {
    fn bounds(&self, prim_id: u32) -> Aabb {
        let mut bounds = Bounds::new([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        if let Some(function) = self.0.state.bounds {
            let arguments = BoundsArguments {
                user: self.0.geometry.user(),
                prim_id,
                time_step: 0,
                bounds: &raw mut bounds,
            };
            // SAFETY: the client's function, with arguments as documented.
            unsafe { function(&raw const arguments) };
        }
        Aabb::new(bounds.lower, bounds.upper)
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        // SAFETY: as in `call`.
        let current: &Current<'_> = unsafe { CURRENT.get().cast::<Current<'_>>().as_ref()? };
        if current.filters.query == Query::Occluded {
            // Anywhere: the kernel moves the distance into the box.
            let anywhere = UserHit::new(current.ray.tnear.max(0.0), 0.0, 0.0);
            return self.occluded(prim_id, ray).then_some(anywhere);
        }
        let found = self.call(self.0.state.intersect, prim_id, ray)?;
        if found.hit.geom_id == INVALID {
            return None;
        }
        current.hits.borrow_mut().push(Reported {
            geometry: Arc::as_ptr(&self.0.geometry),
            t: found.ray.tfar,
            hit: RtcHit {
                prim_id,
                ..found.hit
            },
        });
        Some(UserHit::new(found.ray.tfar, found.hit.u, found.hit.v))
    }

    fn occluded(&self, prim_id: u32, ray: &Ray) -> bool {
        (self.call(self.0.state.occluded, prim_id, ray))
            .is_some_and(|found| found.ray.tfar == f32::NEG_INFINITY)
    }

    /// The nearest point of the box: point queries call the client's function about every box in reach.
    fn closest_point(
        &self,
        prim_id: u32,
        point: [f64; 3],
        world_from_object: &[[f64; 4]; 3],
    ) -> Option<[f64; 3]> {
        let bounds = self.bounds(prim_id);
        // Corners in the world; exact for transforms that keep axes, and near enough for the others.
        let corner = |n: usize| {
            let at = |axis: usize| {
                f64::from(if n >> axis & 1 == 0 {
                    bounds.min[axis]
                } else {
                    bounds.max[axis]
                })
            };
            world_from_object.map(|[a, b, c, d]| a * at(0) + b * at(1) + c * at(2) + d)
        };
        let corners: [[f64; 3]; 8] = std::array::from_fn(corner);
        Some(std::array::from_fn(|axis| {
            let along = || corners.iter().map(|corner| corner[axis]);
            let low = along().fold(f64::INFINITY, f64::min);
            let high = along().fold(f64::NEG_INFINITY, f64::max);
            point[axis].max(low).min(high)
        }))
    }
}

/// Runs the filters of the geometry whose function calls, and returns whether all accept.
///
/// # Safety
/// Arguments that a function of this library was called with, and arguments of a filter for one ray.
unsafe fn filters_accept(
    query: Query,
    arguments: *const UserArguments,
    filter: *const FilterArguments,
) -> bool {
    // SAFETY: functions are only called with a `Call`.
    unsafe {
        let call = &*arguments.cast::<Call<'_>>();
        let filters = call.current.filters.of_query(query);
        filters.of(&call.placed.state).all(|function| {
            function(filter);
            *(*filter).valid != 0
        })
    }
}

/// A hit that is accepted is written behind the ray.
///
/// # Safety
/// Arguments that a function of this library was called with, and arguments of a filter for one ray.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcInvokeIntersectFilterFromGeometry(
    arguments: *const UserArguments,
    filter: *const FilterArguments,
) {
    // SAFETY: as the caller vouches.
    unsafe {
        if filters_accept(Query::Intersect, arguments, filter) {
            let rayhit = &mut *(*filter).ray.cast::<RtcRayHit>();
            rayhit.hit = *(*filter).hit.cast::<RtcHit>();
        }
    }
}

/// # Safety
/// As for the other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcInvokeOccludedFilterFromGeometry(
    arguments: *const UserArguments,
    filter: *const FilterArguments,
) {
    // SAFETY: as the caller vouches.
    unsafe { filters_accept(Query::Occluded, arguments, filter) };
}
