//! Functions of the caller that trees keep: user geometry and opacities.

use std::ffi::c_void;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use antumbra::cutout::{Candidate, Opacity, QueryKind};
use antumbra::saved::Functions;
use antumbra::shapes::{UserGeometry, UserHit};
use antumbra::{Aabb, PrimId, Ray};

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

/// A function that returns how opaque triangles are, `antumbra_opacity`.
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
pub struct Data {
    data: *mut c_void,
    release: Option<Release>,
    /// Whether a call that took the functions succeeded. Otherwise the data stays the caller's.
    is_kept: AtomicBool,
}

// SAFETY: the library never looks at what the pointer points to. The header says that callbacks are called from any thread.
unsafe impl Send for Data {}
// SAFETY: as above.
unsafe impl Sync for Data {}

impl Drop for Data {
    fn drop(&mut self) {
        if let (Some(release), true) = (self.release, *self.is_kept.get_mut()) {
            release(self.data);
        }
    }
}

impl Data {
    fn new(data: *mut c_void, release: Option<Release>) -> Arc<Self> {
        let is_kept = AtomicBool::new(false);
        Arc::new(Self {
            data,
            release,
            is_kept,
        })
    }

    /// The call that took the functions succeeds: their data is released when nobody needs them any more.
    pub fn keep(&self) {
        self.is_kept.store(true, Ordering::Relaxed);
    }
}

/// User geometry that calls the functions of the caller.
struct Shape {
    data: Arc<Data>,
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
    data: Arc<Data>,
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
    /// The shape, and its data, to be kept.
    ///
    /// # Safety
    /// If the pointer is not null, the functions do what the header says, for as long as the shape lives.
    pub unsafe fn shape(
        functions: *const Self,
        name: &str,
    ) -> Outcome<(Arc<dyn UserGeometry>, Arc<Data>)> {
        // SAFETY: the caller's promise.
        let functions = unsafe { sized(functions, name) }?;
        let bounds = needed(functions.bounds, &format!("{name}->bounds"))?;
        let intersect = needed(functions.intersect, &format!("{name}->intersect"))?;
        let data = Data::new(functions.data, functions.release);
        let shape = Shape {
            data: Arc::clone(&data),
            bounds,
            intersect,
            occluded: functions.occluded,
            closest_point: functions.closest_point,
            normal: functions.normal,
        };
        Ok((Arc::new(shape), data))
    }
}

impl OpacityFunction {
    /// The filter, and its data, to be kept.
    ///
    /// # Safety
    /// As [`UserFunctions::shape`].
    pub unsafe fn filter(
        function: *const Self,
        name: &str,
    ) -> Outcome<(Arc<dyn Opacity>, Arc<Data>)> {
        // SAFETY: the caller's promise.
        let function = unsafe { sized(function, name) }?;
        let opacity = needed(function.opacity, &format!("{name}->opacity"))?;
        let data = Data::new(function.data, function.release);
        let cutout = Cutout {
            data: Arc::clone(&data),
            opacity,
        };
        Ok((Arc::new(cutout), data))
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

/// Functions of a file that is read.
#[derive(Default)]
pub struct Given {
    pub functions: Functions,
    data: Vec<Arc<Data>>,
}

impl Given {
    /// Keeps the data of all functions.
    pub fn keep(&self) {
        self.data.iter().for_each(|data| data.keep());
    }
}

impl FunctionLists {
    /// The functions; null is none.
    ///
    /// # Safety
    /// As [`UserFunctions::shape`], for every function of the lists.
    pub unsafe fn functions(lists: *const Self) -> Outcome<Given> {
        if lists.is_null() {
            return Ok(Given::default());
        }
        // SAFETY: the caller's promise.
        let lists = unsafe { sized(lists, "functions") }?;
        let (shapes, filters) = (lists.user_geometry_count, lists.opacity_count);
        // SAFETY: the caller's promise: so many addresses are there.
        let (shapes, filters) = unsafe {
            let shapes = handles(lists.user_geometries, shapes, "user_geometries")?;
            (shapes, handles(lists.opacities, filters, "opacities")?)
        };
        // SAFETY: as above.
        let shape =
            |own: &UserFunctions| unsafe { UserFunctions::shape(own, "user_geometries[i]") };
        // SAFETY: as above.
        let filter =
            |own: &OpacityFunction| unsafe { OpacityFunction::filter(own, "opacities[i]") };
        let shapes: Vec<_> = shapes.into_iter().map(shape).collect::<Outcome<_>>()?;
        let filters: Vec<_> = filters.into_iter().map(filter).collect::<Outcome<_>>()?;
        let (shapes, mut data): (Vec<_>, Vec<_>) = shapes.into_iter().unzip();
        let (filters, more): (Vec<_>, Vec<_>) = filters.into_iter().unzip();
        data.extend(more);
        let functions = Functions::new().shapes(shapes).filters(filters);
        Ok(Given { functions, data })
    }
}
