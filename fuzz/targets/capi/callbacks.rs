//! Functions of the caller.

use std::ffi::c_void;

use antumbra::{Hit, Ray};
use antumbra_capi::functions::{Box3, Point, UserHit3};

use crate::script::Script;

/// Data of callbacks, which `release` frees.
pub struct Numbers([f32; 24]);

impl Numbers {
    pub fn leak(script: &mut Script) -> *mut c_void {
        Box::into_raw(Box::new(Numbers([0.0; 24].map(|_| script.number())))).cast()
    }

    fn of(data: *mut c_void, place: u32) -> f32 {
        // SAFETY: made by `leak`, and alive until it is released.
        unsafe { (*data.cast::<Numbers>()).0[place as usize % 24] }
    }
}

pub extern "C" fn release(data: *mut c_void) {
    // SAFETY: made by `leak`, released once.
    drop(unsafe { Box::from_raw(data.cast::<Numbers>()) });
}

pub extern "C" fn bounds(data: *mut c_void, prim_id: u32, bounds: *mut Box3) {
    let corner = |first| [0, 1, 2].map(|axis| Numbers::of(data, 6 * prim_id + first + axis));
    let (min, max) = (corner(0), corner(3));
    // SAFETY: the place of a box.
    unsafe { *bounds = Box3 { min, max } };
}

pub extern "C" fn intersect(
    data: *mut c_void,
    prim_id: u32,
    ray: *const Ray,
    hit: *mut UserHit3,
) -> i32 {
    // SAFETY: a ray, and the place of a hit.
    let (ray, hit) = unsafe { (&*ray, &mut *hit) };
    let (t, u, v) = (
        Numbers::of(data, prim_id) + 0.1 * ray.org[0],
        Numbers::of(data, 1),
        1.0,
    );
    *hit = UserHit3 { t, u, v };
    (prim_id % 3) as i32
}

pub extern "C" fn nearest(
    data: *mut c_void,
    prim_id: u32,
    point: *const f64,
    _: *const f64,
    closest: *mut f64,
) -> i32 {
    for axis in 0..3u8 {
        // SAFETY: three numbers each.
        unsafe {
            *closest.add(axis.into()) =
                *point.add(axis.into()) * f64::from(Numbers::of(data, prim_id))
        };
    }
    (prim_id % 2) as i32
}

pub extern "C" fn normal(
    data: *mut c_void,
    prim_id: u32,
    _: *const Ray,
    _: *const UserHit3,
    normal: *mut f32,
) -> i32 {
    for axis in 0..3u8 {
        // SAFETY: three numbers.
        unsafe { *normal.add(axis.into()) = Numbers::of(data, prim_id + u32::from(axis)) };
    }
    (prim_id % 2) as i32
}

pub extern "C" fn opacity(data: *mut c_void, at: *const Point) -> f32 {
    // SAFETY: a candidate.
    let at = unsafe { &*at };
    at.u * Numbers::of(data, at.id.prim_id)
}

pub extern "C" fn filter(_: *mut c_void, ray: usize, hit: *const Hit) -> i32 {
    // SAFETY: a hit.
    i32::from(!(unsafe { (*hit).prim_id } as usize + ray).is_multiple_of(3))
}

pub extern "C" fn visit(_: *mut c_void, ray: usize, hit: *const Hit) -> i32 {
    // SAFETY: a hit.
    ((unsafe { (*hit).prim_id } as usize + ray) % 3) as i32
}

pub extern "C" fn cancelled(data: *mut c_void) -> i32 {
    i32::from(!data.is_null())
}

pub extern "C" fn progress(_: *mut c_void, done: f32) {
    assert!((0.0..=1.0).contains(&done));
}
