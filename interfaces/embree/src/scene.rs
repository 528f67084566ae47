//! Scenes: geometries by their numbers, and what the last commit made of them.

use std::collections::BTreeMap;
use std::ffi::{c_int, c_void};
use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Arc, Mutex};

use crate::abi::{Bounds, INVALID, ProgressFunction};
use crate::commit::{Committed, Plan};
use crate::device::{Callback, Device};
use crate::failure::{Failure, Outcome, guarded};
use crate::geometry::Geometry;
use crate::handle::{Handle, device_of, give, lock, look, release, retain, share};
use crate::transform;

/// `RTCScene`, and `RTCTraversable`.
pub struct Scene {
    device: Arc<Device>,
    state: Mutex<State>,
    /// A reference to what queries use; null before the first commit.
    committed: AtomicPtr<Committed>,
    /// Held during a commit.
    commit: Mutex<()>,
    /// The commit before the last one, which a query that should have ended may still use. Held for moments only, and no other
    /// lock is taken meanwhile: scenes may be instances of each other.
    retired: Mutex<Option<Arc<Committed>>>,
}

impl Handle for Scene {
    fn device(&self) -> Option<&Device> {
        Some(&self.device)
    }
}

#[derive(Default)]
struct State {
    geometries: BTreeMap<u32, Arc<Geometry>>,
    /// No smaller number is free.
    first_free: u32,
    flags: u32,
    quality: u32,
    progress: Option<Callback<ProgressFunction>>,
    /// Whether geometries, flags or quality have changed since the last commit.
    is_modified: bool,
}

impl State {
    fn attach(&mut self, geom_id: u32, geometry: Arc<Geometry>) -> Outcome {
        if geom_id == INVALID || self.geometries.contains_key(&geom_id) {
            return Err(Failure::operation("invalid geometry ID provided"));
        }
        self.geometries.insert(geom_id, geometry);
        self.is_modified = true;
        Ok(())
    }

    fn free_id(&mut self) -> u32 {
        while self.geometries.contains_key(&self.first_free) {
            self.first_free += 1;
        }
        self.first_free
    }
}

impl Scene {
    /// What queries use.
    ///
    /// # Errors
    /// Before the first commit.
    #[inline]
    pub fn committed(&self) -> Outcome<&Committed> {
        // SAFETY: the pointer is null or from an `Arc` that this scene holds until the commit after the next. Queries must
        // not run beside commits of their scene, as with Embree.
        unsafe { self.committed.load(Ordering::Acquire).as_ref() }
            .ok_or_else(|| Failure::operation("scene not committed"))
    }

    /// Address of what queries use, to compare; null before the first commit.
    pub fn committed_address(&self) -> *const Committed {
        self.committed.load(Ordering::Acquire)
    }

    /// What queries use, as a reference of its own.
    pub fn committed_arc(&self) -> Option<Arc<Committed>> {
        let _held = lock(&self.retired);
        let pointer = self.committed.load(Ordering::Acquire).cast_const();
        if pointer.is_null() {
            return None;
        }
        // SAFETY: the scene holds a reference, and lets none go while the lock is held.
        unsafe {
            Arc::increment_strong_count(pointer);
            Some(Arc::from_raw(pointer))
        }
    }

    pub fn geometry(&self, geom_id: u32) -> Outcome<Arc<Geometry>> {
        (lock(&self.state).geometries.get(&geom_id).cloned())
            .ok_or_else(|| Failure::argument("there is no geometry of this ID"))
    }

    fn commit(&self) -> Outcome {
        let _held = lock(&self.commit);
        let (plan, was_modified) = {
            let mut state = lock(&self.state);
            let plan = Plan {
                device: Arc::clone(&self.device),
                geometries: state.geometries.clone().into_iter().collect(),
                flags: state.flags,
                quality: state.quality,
                progress: state.progress,
            };
            (plan, std::mem::take(&mut state.is_modified))
        };
        // SAFETY: as in `committed`; the lock of commits is held.
        let now = unsafe { self.committed.load(Ordering::Acquire).as_ref() };
        if !was_modified && now.is_some_and(|now| now.is_current()) {
            return Ok(());
        }
        match plan.commit(self) {
            Ok(committed) => {
                let new = Arc::into_raw(Arc::new(committed)).cast_mut();
                let mut retired = lock(&self.retired);
                let old = self.committed.swap(new, Ordering::AcqRel);
                // SAFETY: the pointer came from `into_raw` here.
                let old = (!old.is_null()).then(|| unsafe { Arc::from_raw(old) });
                let last = std::mem::replace(&mut *retired, old);
                // What is dropped may call the monitor of memory, and may be the last holder of other scenes.
                drop(retired);
                drop(last);
                Ok(())
            }
            Err(failure) => {
                lock(&self.state).is_modified = true;
                Err(failure)
            }
        }
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        let committed = *self.committed.get_mut();
        if !committed.is_null() {
            // SAFETY: the pointer came from `into_raw` in `commit`.
            drop(unsafe { Arc::from_raw(committed) });
        }
    }
}

/// Runs a call on a scene.
///
/// # Safety
/// A scene of this library, or null.
#[inline]
pub unsafe fn with<T>(
    scene: *const Scene,
    otherwise: T,
    call: impl FnOnce(&Scene) -> Outcome<T>,
) -> T {
    // SAFETY: the caller's handle.
    unsafe { guarded(device_of(scene), otherwise, || call(look(scene)?)) }
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcNewScene(device: *const Device) -> *const Scene {
    // SAFETY: the caller's handle.
    unsafe {
        guarded(device_of(device), std::ptr::null(), || {
            Ok(give(Arc::new(Scene {
                device: share(device)?,
                state: Mutex::new(State {
                    quality: 1,
                    is_modified: true,
                    ..State::default()
                }),
                committed: AtomicPtr::default(),
                commit: Mutex::default(),
                retired: Mutex::default(),
            })))
        })
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetSceneDevice(scene: *const Scene) -> *const Device {
    // SAFETY: the caller's handle.
    unsafe {
        with(scene, std::ptr::null(), |scene| {
            Ok(give(Arc::clone(&scene.device)))
        })
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcRetainScene(scene: *const Scene) {
    // SAFETY: the caller's handle.
    unsafe { guarded(device_of(scene), (), || retain(scene)) }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcReleaseScene(scene: *const Scene) {
    // SAFETY: the caller's handle.
    guarded(None, (), || unsafe { release(scene) })
}

/// A scene is what is traversed.
///
/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetSceneTraversable(scene: *const Scene) -> *const Scene {
    // SAFETY: the caller's handle.
    unsafe {
        with(scene, std::ptr::null(), |scene| {
            scene.committed()?;
            Ok(std::ptr::from_ref(scene))
        })
    }
}

/// # Safety
/// Handles of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcAttachGeometry(scene: *const Scene, geometry: *const Geometry) -> u32 {
    // SAFETY: the caller's handles.
    unsafe {
        with(scene, INVALID, |scene| {
            let geometry = owned(scene, geometry)?;
            let mut state = lock(&scene.state);
            let geom_id = state.free_id();
            state.attach(geom_id, geometry)?;
            Ok(geom_id)
        })
    }
}

/// # Safety
/// Handles of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcAttachGeometryByID(
    scene: *const Scene,
    geometry: *const Geometry,
    geom_id: u32,
) {
    // SAFETY: the caller's handles.
    unsafe {
        with(scene, (), |scene| {
            let geometry = owned(scene, geometry)?;
            if geom_id == INVALID {
                return Err(Failure::argument("invalid argument"));
            }
            lock(&scene.state).attach(geom_id, geometry)
        })
    }
}

/// A geometry of the device of the scene.
///
/// # Safety
/// A geometry of this library, or null.
unsafe fn owned(scene: &Scene, geometry: *const Geometry) -> Outcome<Arc<Geometry>> {
    // SAFETY: the caller's handle.
    let geometry = unsafe { share(geometry)? };
    if geometry.device().map(Device::id) == Some(scene.device.id()) {
        Ok(geometry)
    } else {
        Err(Failure::argument("inputs are from different devices"))
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcDetachGeometry(scene: *const Scene, geom_id: u32) {
    // SAFETY: the caller's handle.
    unsafe {
        with(scene, (), |scene| {
            let mut state = lock(&scene.state);
            let gone = state.geometries.remove(&geom_id);
            state.is_modified |= gone.is_some();
            if gone.is_some() {
                state.first_free = state.first_free.min(geom_id);
            }
            drop(state);
            gone.map(|_| ())
                .ok_or_else(|| Failure::operation("invalid geometry ID"))
        })
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometry(scene: *const Scene, geom_id: u32) -> *const Geometry {
    // SAFETY: the caller's handle.
    unsafe {
        with(scene, std::ptr::null(), |scene| {
            // The scene keeps its reference.
            Ok(Arc::as_ptr(&scene.geometry(geom_id)?))
        })
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryThreadSafe(
    scene: *const Scene,
    geom_id: u32,
) -> *const Geometry {
    // SAFETY: as for the other.
    unsafe { rtcGetGeometry(scene, geom_id) }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcCommitScene(scene: *const Scene) {
    // SAFETY: the caller's handle.
    unsafe { with(scene, (), Scene::commit) }
}

/// The first thread commits, on the threads of the device; others wait until it has.
///
/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcJoinCommitScene(scene: *const Scene) {
    // SAFETY: the caller's handle.
    unsafe { with(scene, (), Scene::commit) }
}

/// # Safety
/// A scene of this library, or null; the function takes `user`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetSceneProgressMonitorFunction(
    scene: *const Scene,
    function: Option<ProgressFunction>,
    user: *mut c_void,
) {
    // SAFETY: the caller's handle.
    unsafe {
        with(scene, (), |scene| {
            lock(&scene.state).progress = function.map(|function| Callback { function, user });
            Ok(())
        })
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetSceneBuildQuality(scene: *const Scene, quality: u32) {
    // SAFETY: the caller's handle.
    unsafe {
        with(scene, (), |scene| {
            if quality > 2 {
                return Err(Failure::argument("invalid build quality"));
            }
            let mut state = lock(&scene.state);
            state.is_modified |= state.quality != quality;
            state.quality = quality;
            Ok(())
        })
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetSceneFlags(scene: *const Scene, flags: c_int) {
    // SAFETY: the caller's handle.
    unsafe {
        with(scene, (), |scene| {
            let mut state = lock(&scene.state);
            state.is_modified |= state.flags != flags as u32;
            state.flags = flags as u32;
            Ok(())
        })
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetSceneFlags(scene: *const Scene) -> c_int {
    // SAFETY: the caller's handle.
    unsafe { with(scene, 0, |scene| Ok(lock(&scene.state).flags as c_int)) }
}

/// # Safety
/// A scene of this library, or null; room for bounds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetSceneBounds(scene: *const Scene, bounds: *mut Bounds) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(scene, (), |scene| {
            let place = bounds
                .as_mut()
                .ok_or_else(|| Failure::operation("invalid destination pointer"))?;
            *place = scene.committed()?.bounds();
            Ok(())
        })
    }
}

/// Nothing moves, so bounds are the same at both times.
///
/// # Safety
/// A scene of this library, or null; room for two bounds.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetSceneLinearBounds(scene: *const Scene, bounds: *mut [Bounds; 2]) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(scene, (), |scene| {
            let place = bounds
                .as_mut()
                .ok_or_else(|| Failure::operation("invalid destination pointer"))?;
            *place = [scene.committed()?.bounds(); 2];
            Ok(())
        })
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryUserDataFromScene(
    scene: *const Scene,
    geom_id: u32,
) -> *mut c_void {
    // SAFETY: the caller's handle.
    unsafe {
        with(scene, std::ptr::null_mut(), |scene| {
            Ok(scene.geometry(geom_id)?.user())
        })
    }
}

/// # Safety
/// A scene of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryUserDataFromTraversable(
    scene: *const Scene,
    geom_id: u32,
) -> *mut c_void {
    // SAFETY: as for the other.
    unsafe { rtcGetGeometryUserDataFromScene(scene, geom_id) }
}

/// The transform of an instance, and the identity of other geometry.
///
/// # Safety
/// A scene of this library, or null; room for a transform in this format.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryTransformFromScene(
    scene: *const Scene,
    geom_id: u32,
    _time: f32,
    which: u32,
    transform: *mut c_void,
) {
    // SAFETY: the caller's handle and memory.
    unsafe {
        with(scene, (), |scene| {
            transform::write(&scene.geometry(geom_id)?.transform(), which, transform)
        })
    }
}

/// # Safety
/// As for the other.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetGeometryTransformFromTraversable(
    scene: *const Scene,
    geom_id: u32,
    time: f32,
    which: u32,
    transform: *mut c_void,
) {
    // SAFETY: as for the other.
    unsafe { rtcGetGeometryTransformFromScene(scene, geom_id, time, which, transform) }
}
