//! Handles that calls share, and what every status must be.

use std::ptr::{null, null_mut};
use std::sync::OnceLock;

use antumbra::{Bvh, ChildOrder};
use antumbra_capi::build::*;
use antumbra_capi::learning::antumbra_child_order_free;
use antumbra_capi::scene::{Scene, antumbra_scene_free};
use antumbra_capi::status::{Status, antumbra_last_error};
use antumbra_capi::threads::{Threads, antumbra_threads_new};
use antumbra_capi::world::{OwnWorld, antumbra_world_free};

use crate::script::Script;

/// A status that is allowed; whether the call succeeded.
#[track_caller]
pub fn done(status: Status) -> bool {
    assert!(status != Status::Internal, "an internal error");
    if status != Status::Ok {
        // SAFETY: a text of the library.
        assert!(
            unsafe { *antumbra_last_error() } != 0,
            "a failure without a text"
        );
    }
    status == Status::Ok
}

/// A new handle for the pool, or null after a failure.
#[track_caller]
pub fn keep<T>(pool: &mut Vec<*mut T>, status: Status, handle: *mut T) {
    assert_eq!(done(status), !handle.is_null());
    if !handle.is_null() {
        pool.push(handle);
    }
}

/// A handle of the pool; null if there is none, and now and then.
pub fn any<T>(pool: &[*mut T], script: &mut Script) -> *mut T {
    let place = script.below(16);
    match pool.is_empty() || place == 15 {
        true => null_mut(),
        false => pool[place % pool.len()],
    }
}

/// Removes a handle from the pool if it is full, or if the script says so.
pub fn full<T>(pool: &mut Vec<*mut T>, script: &mut Script) -> *mut T {
    let place = script.below(16);
    match pool.len() > 3 || (place == 15 && !pool.is_empty()) {
        true => pool.swap_remove(place % pool.len()),
        false => null_mut(),
    }
}

/// All that was made and not freed.
#[derive(Default)]
pub struct Handles {
    pub scenes: Vec<*mut Scene>,
    pub objects: Vec<*mut OwnObject>,
    pub trees: Vec<*mut Bvh>,
    pub worlds: Vec<*mut OwnWorld>,
    pub orders: Vec<*mut ChildOrder>,
}

impl Drop for Handles {
    fn drop(&mut self) {
        // SAFETY: each handle was given to this list once.
        unsafe {
            self.scenes
                .drain(..)
                .for_each(|handle| antumbra_scene_free(handle));
            self.objects
                .drain(..)
                .for_each(|handle| antumbra_object_free(handle));
            self.trees
                .drain(..)
                .for_each(|handle| antumbra_bvh_free(handle));
            self.worlds
                .drain(..)
                .for_each(|handle| antumbra_world_free(handle));
            self.orders
                .drain(..)
                .for_each(|handle| antumbra_child_order_free(handle));
        }
    }
}

/// No pool of threads, or one of two threads.
pub fn threads(script: &mut Script) -> *const Threads {
    static POOL: OnceLock<usize> = OnceLock::new();
    let pool = POOL.get_or_init(|| {
        let mut pool = null_mut();
        // SAFETY: a place for a handle.
        assert!(done(unsafe { antumbra_threads_new(2, &mut pool) }));
        pool as usize
    });
    if script.rarely(8) {
        *pool as *const Threads
    } else {
        null()
    }
}
