//! Intel's Embree 4, loaded at run time. All `unsafe` of the laboratory is here.
//!
//! - this file: the library, and devices;  `scene`: scenes, built and refitted;  `queries`: rays and points
//! - `rays`: layouts of rays;  `callbacks`: functions that Embree calls: filters, user geometry, nearest points
//!
//! Nothing of Embree is needed to build or to run the program. The functions used are looked up in the
//! shared library by name; their signatures and the layouts of what they take follow the headers
//! `embree4/rtcore_*.h` of versions 4.0 to 4.4. The library is never unloaded: threads of its task
//! scheduler may still be running in it.

mod callbacks;
mod queries;
mod rays;
mod scene;
#[cfg(test)]
mod tests;

use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicIsize, Ordering};

use antumbra::recipe::Level;

use crate::Error;
use callbacks::{
    BoundsFunction, FilterFunction, IntersectFunction, OccludedFunction, PointContext,
    PointFunction, PointQuery,
};
use queries::Arguments;
use rays::{HitPacket, RayN};
use scene::Decomposition;

pub use queries::Call;
pub use rays::{Packet, RayHit, SingleRay};
pub use scene::{Scene, SceneFlags};

/// An Embree object of any kind; the function that returned it determines the kind.
type Handle = *mut c_void;
type MemoryMonitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;

/// Declares the table of functions and the search for all of them.
macro_rules! functions {
    ($($field:ident: $name:literal ($($argument:ty),*) $(-> $result:ty)?;)*) => {
        struct Functions {
            $($field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            fn find(library: &libloading::Library) -> Result<Self, String> {
                Ok(Self {
                    $($field: {
                        // SAFETY: Embree 4 exports a function of this signature by this name. That it is
                        // version 4 is checked by the caller, with a function whose signature
                        // is the same in all versions.
                        let symbol = unsafe { library.get(concat!($name, "\0").as_bytes()) };
                        *symbol.map_err(|_| format!("it has no function {}", $name))?
                    },)*
                })
            }
        }
    };
}

functions! {
    new_device: "rtcNewDevice" (*const c_char) -> Handle;
    release_device: "rtcReleaseDevice" (Handle);
    device_property: "rtcGetDeviceProperty" (Handle, c_uint) -> isize;
    device_error: "rtcGetDeviceError" (Handle) -> c_uint;
    memory_monitor: "rtcSetDeviceMemoryMonitorFunction" (Handle, Option<MemoryMonitor>, *mut c_void);
    new_scene: "rtcNewScene" (Handle) -> Handle;
    release_scene: "rtcReleaseScene" (Handle);
    scene_flags: "rtcSetSceneFlags" (Handle, c_uint);
    scene_quality: "rtcSetSceneBuildQuality" (Handle, c_uint);
    commit_scene: "rtcCommitScene" (Handle);
    new_geometry: "rtcNewGeometry" (Handle, c_uint) -> Handle;
    release_geometry: "rtcReleaseGeometry" (Handle);
    new_buffer: "rtcSetNewGeometryBuffer" (Handle, c_uint, c_uint, c_uint, usize, usize) -> *mut c_void;
    buffer_data: "rtcGetGeometryBufferData" (Handle, c_uint, c_uint) -> *mut c_void;
    update_buffer: "rtcUpdateGeometryBuffer" (Handle, c_uint, c_uint);
    geometry_quality: "rtcSetGeometryBuildQuality" (Handle, c_uint);
    commit_geometry: "rtcCommitGeometry" (Handle);
    attach_geometry: "rtcAttachGeometry" (Handle, Handle) -> c_uint;
    get_geometry: "rtcGetGeometry" (Handle, c_uint) -> Handle;
    user_data: "rtcSetGeometryUserData" (Handle, *mut c_void);
    occluded_filter: "rtcSetGeometryOccludedFilterFunction" (Handle, Option<FilterFunction>);
    intersect_filter: "rtcSetGeometryIntersectFilterFunction" (Handle, Option<FilterFunction>);
    user_count: "rtcSetGeometryUserPrimitiveCount" (Handle, c_uint);
    user_bounds: "rtcSetGeometryBoundsFunction" (Handle, Option<BoundsFunction>, *mut c_void);
    user_intersect: "rtcSetGeometryIntersectFunction" (Handle, Option<IntersectFunction>);
    user_occluded: "rtcSetGeometryOccludedFunction" (Handle, Option<OccludedFunction>);
    instanced_scene: "rtcSetGeometryInstancedScene" (Handle, Handle);
    time_steps: "rtcSetGeometryTimeStepCount" (Handle, c_uint);
    transform: "rtcSetGeometryTransform" (Handle, c_uint, c_uint, *const c_void);
    quaternion: "rtcSetGeometryTransformQuaternion" (Handle, c_uint, *const Decomposition);
    occluded1: "rtcOccluded1" (Handle, *mut SingleRay, *mut Arguments);
    intersect1: "rtcIntersect1" (Handle, *mut RayHit, *mut Arguments);
    occluded4: "rtcOccluded4" (*const c_int, Handle, *mut RayN<4>, *mut Arguments);
    occluded8: "rtcOccluded8" (*const c_int, Handle, *mut RayN<8>, *mut Arguments);
    occluded16: "rtcOccluded16" (*const c_int, Handle, *mut RayN<16>, *mut Arguments);
    intersect16: "rtcIntersect16" (*const c_int, Handle, *mut HitPacket, *mut Arguments);
    point_query: "rtcPointQuery"
        (Handle, *mut PointQuery, *mut PointContext, Option<PointFunction>, *mut c_void) -> bool;
}

const VERSION_MAJOR: c_uint = 1;
const VERSION_MINOR: c_uint = 2;
const VERSION_PATCH: c_uint = 3;

/// Embree 4, loaded from a shared library.
#[derive(Clone, Copy)]
pub struct Embree {
    functions: &'static Functions,
    version: [isize; 3],
}

impl Embree {
    /// Loads a shared library and checks that it is Embree 4.
    ///
    /// The user answers for the library: loading it runs its initialisers.
    ///
    /// # Errors
    /// [`Error::EmbreeLibrary`].
    pub fn load(path: &Path) -> Result<Self, Error> {
        let reason = |reason: String| Error::EmbreeLibrary {
            path: path.to_path_buf(),
            reason,
        };
        // Without a directory the system would look for the name in its own places.
        let path = std::path::absolute(path).map_err(|error| reason(error.to_string()))?;
        if !path.is_file() {
            return Err(reason("there is no such file".into()));
        }
        preload_scheduler(&path);
        // SAFETY: the user names a library whose initialisers are safe to run; there is no way to check.
        let library = unsafe { libloading::Library::new(&path) };
        let library = library.map_err(|error| reason(with_cause(&error)))?;
        let functions = Functions::find(&library).map_err(reason)?;
        let mut embree = Self {
            functions: Box::leak(Box::new(functions)),
            version: [0; 3],
        };
        std::mem::forget(library);
        let device = Device::open(embree, "threads=1").map_err(reason)?;
        embree.version = [VERSION_MAJOR, VERSION_MINOR, VERSION_PATCH].map(|part| {
            // SAFETY: the device is alive; the signature is the same in all versions.
            unsafe { (embree.functions.device_property)(device.handle, part) }
        });
        if embree.version[0] != 4 {
            let [major, ..] = embree.version;
            return Err(reason(format!("it is version {major}, not 4")));
        }
        Ok(embree)
    }

    /// Version of the library, such as `4.4.0`.
    pub fn version(self) -> String {
        let [major, minor, patch] = self.version;
        format!("{major}.{minor}.{patch}")
    }
}

/// An error and what the system says about it.
fn with_cause(error: &libloading::Error) -> String {
    match std::error::Error::source(error) {
        Some(cause) => format!("{error}: {cause}"),
        None => error.to_string(),
    }
}

/// Embree's task scheduler (TBB) usually lies beside it, where the system does not look.
#[cfg(unix)]
fn preload_scheduler(embree: &Path) {
    use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_NOW};

    let Some(entries) = embree.parent().and_then(|path| path.read_dir().ok()) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let library = name.contains(".so") || name.contains(".dylib");
        if library && (name.starts_with("libtbb.") || name.starts_with("libtbb-")) {
            // SAFETY: as for Embree itself, which would load this very library if the system found it.
            let library = unsafe { Library::open(Some(entry.path()), RTLD_NOW | RTLD_GLOBAL) };
            // If it does not load, Embree says what it lacks. If it does, it stays.
            std::mem::forget(library);
        }
    }
}

/// Windows looks beside the library itself.
#[cfg(not(unix))]
fn preload_scheduler(_: &Path) {}

/// Name by which Embree uses the instructions of a level; `None` if it has no such.
pub fn isa(level: Level) -> Option<&'static str> {
    match level {
        Level::Avx512 => Some("avx512"),
        Level::Avx2 => Some("avx2"),
        // Embree has no scalar kernels, and on Arm no choice that could be checked.
        _ => None,
    }
}

/// An Embree device. What it allocates is counted.
pub struct Device {
    embree: Embree,
    handle: Handle,
    /// Bytes allocated at present. Boxed: Embree keeps its address.
    bytes: Box<AtomicIsize>,
}

// SAFETY: Embree's API may be called from any thread; the handle is only released by the last owner.
unsafe impl Send for Device {}
// SAFETY: as above; a device is shared, not changed.
unsafe impl Sync for Device {}

/// Counts what a device allocates and frees.
unsafe extern "C" fn count_bytes(counter: *mut c_void, bytes: isize, _done: bool) -> bool {
    // SAFETY: the pointer given to `rtcSetDeviceMemoryMonitorFunction`, to a counter that lives as long as
    // the device.
    let counter = unsafe { &*counter.cast::<AtomicIsize>() };
    counter.fetch_add(bytes, Ordering::Relaxed);
    true
}

impl Device {
    /// A device that builds on so many threads, all if 0, and uses the instructions of a level or the best.
    ///
    /// # Errors
    /// [`Error::Embree`].
    pub fn new(embree: Embree, isa: Option<&str>, threads: usize) -> Result<Arc<Self>, Error> {
        let isa = isa.map_or_else(String::new, |isa| format!("isa={isa},"));
        let device = Self::open(embree, &format!("{isa}threads={threads}"));
        device.map(Arc::new).map_err(Error::Embree)
    }

    fn open(embree: Embree, config: &str) -> Result<Self, String> {
        let config = CString::new(config).map_err(|error| error.to_string())?;
        let config: &CStr = &config;
        let bytes = Box::new(AtomicIsize::new(0));
        let counter: *const AtomicIsize = &raw const *bytes;
        // SAFETY: a string that ends in 0; Embree copies it.
        let handle = unsafe { (embree.functions.new_device)(config.as_ptr()) };
        if handle.is_null() {
            return Err(format!("no device for {config:?}"));
        }
        // SAFETY: the device is new; the counter is freed after it, and is only used as what it is.
        unsafe {
            (embree.functions.memory_monitor)(handle, Some(count_bytes), counter.cast_mut().cast());
        }
        Ok(Self {
            embree,
            handle,
            bytes,
        })
    }

    fn bytes(&self) -> usize {
        self.bytes.load(Ordering::Relaxed).max(0) as usize
    }

    fn check(&self) -> Result<(), String> {
        // SAFETY: the device is alive.
        match unsafe { (self.embree.functions.device_error)(self.handle) } {
            0 => Ok(()),
            4 => Err("Embree is out of memory".into()),
            code => Err(format!("Embree reports error {code}")),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: no scene is left: each owns a share of the device.
        unsafe { (self.embree.functions.release_device)(self.handle) };
    }
}
