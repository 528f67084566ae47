//! Scenes: geometries by their numbers, and what the last commit made of them.
//!
//! `commit` builds what `committed` describes, `shapes` and `user` are the kernel's view of geometries.

mod commit;
mod committed;
mod shapes;
mod user;

use std::collections::BTreeMap;
use std::ffi::{c_int, c_void};
use std::sync::atomic::{AtomicPtr, Ordering};
use std::sync::{Arc, Mutex};

use crate::abi::{Bounds, INVALID, ProgressFunction};
use crate::device::{Callback, Device, Failure, Outcome, give, lock, share, share_on};
use crate::geometry::{Geometry, transform};
pub use committed::{Committed, Site, Traits};
pub use user::{Current, report_to_running, with_current};

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

exports! {
    fn rtcNewScene(device: Device) -> *const Scene {
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
    }

    fn rtcGetSceneDevice(scene: Scene) -> *const Device {
        Ok(give(Arc::clone(&scene.device)))
    }

    // A scene is what is traversed.
    fn rtcGetSceneTraversable(scene: Scene) -> *const Scene {
        scene.committed()?;
        Ok(std::ptr::from_ref(scene))
    }

    fn rtcAttachGeometry(scene: Scene, geometry: *const Geometry) -> u32 {
        let geometry = share_on(&scene.device, geometry)?;
        let mut state = lock(&scene.state);
        let geom_id = state.free_id();
        state.attach(geom_id, geometry)?;
        Ok(geom_id)
    }

    fn rtcAttachGeometryByID(scene: Scene, geometry: *const Geometry, geom_id: u32) {
        let geometry = share_on(&scene.device, geometry)?;
        if geom_id == INVALID {
            return Err(Failure::argument("invalid argument"));
        }
        lock(&scene.state).attach(geom_id, geometry)
    }

    fn rtcDetachGeometry(scene: Scene, geom_id: u32) {
        let mut state = lock(&scene.state);
        let gone = state.geometries.remove(&geom_id);
        state.is_modified |= gone.is_some();
        if gone.is_some() {
            state.first_free = state.first_free.min(geom_id);
        }
        drop(state);
        gone.map(|_| ())
            .ok_or_else(|| Failure::operation("invalid geometry ID"))
    }

    // The scene keeps its reference.
    fn rtcGetGeometry | rtcGetGeometryThreadSafe(scene: Scene, geom_id: u32) -> *const Geometry {
        Ok(Arc::as_ptr(&scene.geometry(geom_id)?))
    }

    // The first thread commits, on the threads of the device; others wait until it has.
    fn rtcCommitScene | rtcJoinCommitScene(scene: Scene) {
        scene.commit()
    }

    fn rtcSetSceneProgressMonitorFunction(scene: Scene, function: Option<ProgressFunction>, user: *mut c_void) {
        lock(&scene.state).progress = function.map(|function| Callback { function, user });
        Ok(())
    }

    fn rtcSetSceneBuildQuality(scene: Scene, quality: u32) {
        if quality > 2 {
            return Err(Failure::argument("invalid build quality"));
        }
        let mut state = lock(&scene.state);
        state.is_modified |= state.quality != quality;
        state.quality = quality;
        Ok(())
    }

    fn rtcSetSceneFlags(scene: Scene, flags: c_int) {
        let mut state = lock(&scene.state);
        state.is_modified |= state.flags != flags as u32;
        state.flags = flags as u32;
        Ok(())
    }

    fn rtcGetSceneFlags(scene: Scene) -> c_int {
        Ok(lock(&scene.state).flags as c_int)
    }

    fn rtcGetSceneBounds(scene: Scene, bounds: *mut Bounds) {
        let place = (bounds.as_mut())
            .ok_or_else(|| Failure::operation("invalid destination pointer"))?;
        *place = scene.committed()?.bounds();
        Ok(())
    }

    fn rtcGetGeometryUserDataFromScene | rtcGetGeometryUserDataFromTraversable(
        scene: Scene,
        geom_id: u32,
    ) -> *mut c_void {
        Ok(scene.geometry(geom_id)?.user())
    }

    // The transform of an instance, and the identity of other geometry.
    fn rtcGetGeometryTransformFromScene | rtcGetGeometryTransformFromTraversable(
        scene: Scene,
        geom_id: u32,
        _time: f32,
        which: u32,
        transform: *mut c_void,
    ) {
        transform::write(&scene.geometry(geom_id)?.transform(), which, transform)
    }
}

handle! { Scene: rtcRetainScene rtcReleaseScene }
