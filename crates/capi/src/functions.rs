//! Functions of the caller that trees keep: user geometry and opacities.

use std::ffi::c_void;
use std::fmt;
use std::sync::Arc;

use antumbra::cutout::{Candidate, Opacity, QueryKind};
use antumbra::{Aabb, Functions, PrimId, Ray, UserGeometry, UserHit};

use crate::arrays::{Versioned, handles, sized};
use crate::status::{Failure, Outcome, Status};

/// A box, `antumbra_box`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Box3 {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

/// A hit on user geometry, `antumbra_user_hit`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
pub struct UserHit3 {
    pub t: f32,
    pub u: f32,
    pub v: f32,
}

type Bounds = extern "C" fn(*mut c_void, u32, *mut Box3);
type Intersect = extern "C" fn(*mut c_void, u32, *const Ray, *mut UserHit3) -> i32;
type Occluded = extern "C" fn(*mut c_void, u32, *const Ray) -> i32;
type Closest = extern "C" fn(*mut c_void, u32, *const f64, *const f64, *mut f64) -> i32;
type Normal = extern "C" fn(*mut c_void, u32, *const Ray, *const UserHit3, *mut f32) -> i32;
type Release = extern "C" fn(*mut c_void);

/// Functions of user geometry, `antumbra_user_geometry`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct UserFunctions {
    pub size: usize,
    pub data: *mut c_void,
    pub bounds: Option<Bounds>,
    pub intersect: Option<Intersect>,
    pub occluded: Option<Occluded>,
    pub closest_point: Option<Closest>,
    pub normal: Option<Normal>,
    pub release: Option<Release>,
}

// SAFETY: `repr(C)`, the size first, and then pointers, which are only used as the header says.
unsafe impl Versioned for UserFunctions {
    const NAME: &'static str = "antumbra_user_geometry";
}

/// A point of a triangle that may be transparent, `antumbra_candidate`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Point {
    pub u: f32,
    pub v: f32,
    pub id: PrimId,
    pub is_occlusion: i32,
}

type OpacityOf = extern "C" fn(*mut c_void, *const Point) -> f32;

/// A function that tells how opaque triangles are, `antumbra_opacity`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct OpacityFunction {
    pub size: usize,
    pub data: *mut c_void,
    pub opacity: Option<OpacityOf>,
    pub release: Option<Release>,
}

// SAFETY: as of `UserFunctions`.
unsafe impl Versioned for OpacityFunction {
    const NAME: &'static str = "antumbra_opacity";
}

/// Data of the caller that callbacks receive, and what to do when nobody needs it any more.
struct Data {
    data: *mut c_void,
    release: Option<Release>,
}

// SAFETY: the library never looks at what the pointer points to. The header says that callbacks are called from any thread.
unsafe impl Send for Data {}
// SAFETY: as above.
unsafe impl Sync for Data {}

impl Drop for Data {
    fn drop(&mut self) {
        if let Some(release) = self.release {
            release(self.data);
        }
    }
}

/// User geometry that calls the functions of the caller.
struct Shape {
    data: Data,
    bounds: Bounds,
    intersect: Intersect,
    occluded: Option<Occluded>,
    closest_point: Option<Closest>,
    normal: Option<Normal>,
}

impl fmt::Debug for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shape").finish_non_exhaustive()
    }
}

impl UserGeometry for Shape {
    fn bounds(&self, prim_id: u32) -> Aabb {
        // Whoever writes nothing gives an empty box, which drops the primitive.
        let Aabb { min, max } = Aabb::EMPTY;
        let mut bounds = Box3 { min, max };
        (self.bounds)(self.data.data, prim_id, &raw mut bounds);
        Aabb::new(bounds.min, bounds.max)
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        let mut hit = UserHit3::default();
        let is_hit = (self.intersect)(self.data.data, prim_id, ray, &raw mut hit) != 0;
        is_hit.then_some(UserHit::new(hit.t, hit.u, hit.v))
    }

    fn occluded(&self, prim_id: u32, ray: &Ray) -> bool {
        match self.occluded {
            Some(occluded) => occluded(self.data.data, prim_id, ray) != 0,
            None => {
                let hit = self.intersect(prim_id, ray);
                hit.is_some_and(|hit| ray.tnear < hit.t && hit.t < ray.tfar)
            }
        }
    }

    fn closest_point(
        &self,
        prim_id: u32,
        point: [f64; 3],
        world_from_object: &[[f64; 4]; 3],
    ) -> Option<[f64; 3]> {
        let Some(closest_point) = self.closest_point else {
            let text = "the query came to user geometry without `closest_point`";
            Failure::new(Status::Unsupported, text).unwind();
        };
        let mut closest = [f64::NAN; 3];
        let is_found = closest_point(
            self.data.data,
            prim_id,
            point.as_ptr(),
            world_from_object.as_flattened().as_ptr(),
            closest.as_mut_ptr(),
        );
        (is_found != 0).then_some(closest)
    }

    fn normal(&self, prim_id: u32, ray: &Ray, hit: &UserHit) -> Option<[f32; 3]> {
        let told = UserHit3 {
            t: hit.t,
            u: hit.u,
            v: hit.v,
        };
        let mut normal = [0.0; 3];
        let is_known = self.normal?(
            self.data.data,
            prim_id,
            ray,
            &raw const told,
            normal.as_mut_ptr(),
        );
        (is_known != 0).then_some(normal)
    }
}

/// An opacity that calls the function of the caller.
struct Cutout {
    data: Data,
    opacity: OpacityOf,
}

impl fmt::Debug for Cutout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Cutout").finish_non_exhaustive()
    }
}

impl Opacity for Cutout {
    fn opacity(&self, at: &Candidate) -> f32 {
        let point = Point {
            u: at.u,
            v: at.v,
            id: PrimId {
                inst_id: at.inst_id,
                geom_id: at.geom_id,
                prim_id: at.prim_id,
            },
            is_occlusion: i32::from(at.query == QueryKind::Occluded),
        };
        (self.opacity)(self.data.data, &raw const point)
    }
}

/// A function that must be there.
fn needed<F>(function: Option<F>, name: &str) -> Outcome<F> {
    function.ok_or_else(|| Failure::argument(format_args!("`{name}` is null")))
}

impl UserFunctions {
    /// The shape. Data is released with it, and not if this fails.
    ///
    /// # Safety
    /// If the pointer is not null, the functions do what the header says, for as long as the shape lives.
    pub unsafe fn shape(functions: *const Self, name: &str) -> Outcome<Arc<dyn UserGeometry>> {
        // SAFETY: the caller's promise.
        let functions = unsafe { sized(functions, name) }?;
        let bounds = needed(functions.bounds, &format!("{name}->bounds"))?;
        let intersect = needed(functions.intersect, &format!("{name}->intersect"))?;
        Ok(Arc::new(Shape {
            data: Data {
                data: functions.data,
                release: functions.release,
            },
            bounds,
            intersect,
            occluded: functions.occluded,
            closest_point: functions.closest_point,
            normal: functions.normal,
        }))
    }
}

impl OpacityFunction {
    /// The filter. Data is released with it, and not if this fails.
    ///
    /// # Safety
    /// As [`UserFunctions::shape`].
    pub unsafe fn filter(function: *const Self, name: &str) -> Outcome<Arc<dyn Opacity>> {
        // SAFETY: the caller's promise.
        let function = unsafe { sized(function, name) }?;
        let opacity = needed(function.opacity, &format!("{name}->opacity"))?;
        Ok(Arc::new(Cutout {
            data: Data {
                data: function.data,
                release: function.release,
            },
            opacity,
        }))
    }
}

/// Functions that files cannot hold, `antumbra_functions`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct FunctionLists {
    pub size: usize,
    pub user_geometries: *const *const UserFunctions,
    pub user_geometry_count: usize,
    pub opacities: *const *const OpacityFunction,
    pub opacity_count: usize,
}

// SAFETY: as of `UserFunctions`.
unsafe impl Versioned for FunctionLists {
    const NAME: &'static str = "antumbra_functions";
}

impl FunctionLists {
    /// The functions; null is none.
    ///
    /// # Safety
    /// As [`UserFunctions::shape`], for every function of the lists.
    pub unsafe fn functions(lists: *const Self) -> Outcome<Functions> {
        if lists.is_null() {
            return Ok(Functions::new());
        }
        // SAFETY: the caller's promise.
        let lists = unsafe { sized(lists, "functions") }?;
        let (shapes, filters) = (lists.user_geometry_count, lists.opacity_count);
        // SAFETY: the caller's promise: so many addresses are there.
        let (shapes, filters) = unsafe {
            let shapes = handles(lists.user_geometries, shapes, "user_geometries")?;
            (shapes, handles(lists.opacities, filters, "opacities")?)
        };
        // All are checked before any is taken over, so nothing fails and releases a part of them.
        // SAFETY: as above, for each of them.
        unsafe {
            for shape in &shapes {
                checked_shape(std::ptr::from_ref(*shape))?;
            }
            for filter in &filters {
                checked_filter(std::ptr::from_ref(*filter))?;
            }
        }
        // SAFETY: as above.
        let shape = |shape| unsafe { UserFunctions::shape(shape, "user_geometries[i]") };
        // SAFETY: as above.
        let filter = |filter| unsafe { OpacityFunction::filter(filter, "opacities[i]") };
        let shapes = shapes.into_iter().map(|own| shape(own));
        let filters = filters.into_iter().map(|own| filter(own));
        Ok(Functions::new()
            .shapes(shapes.collect::<Outcome<_>>()?)
            .filters(filters.collect::<Outcome<_>>()?))
    }
}

/// Fails for what [`UserFunctions::shape`] fails for.
///
/// # Safety
/// As [`UserFunctions::shape`].
unsafe fn checked_shape(functions: *const UserFunctions) -> Outcome {
    // SAFETY: the caller's promise.
    let found = unsafe { sized(functions, "user_geometries[i]") }?;
    needed(found.bounds, "user_geometries[i]->bounds")?;
    needed(found.intersect, "user_geometries[i]->intersect")?;
    Ok(())
}

/// Fails for what [`OpacityFunction::filter`] fails for.
///
/// # Safety
/// As [`UserFunctions::shape`].
unsafe fn checked_filter(function: *const OpacityFunction) -> Outcome {
    // SAFETY: the caller's promise.
    let found = unsafe { sized(function, "opacities[i]") }?;
    needed(found.opacity, "opacities[i]->opacity")?;
    Ok(())
}
