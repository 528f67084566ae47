//! Intel's Embree 4, loaded at run time. All `unsafe` of the program is here.
//!
//! Nothing of Embree is needed to build or to run the program. The functions used are looked up in the
//! shared library by name; their signatures and the layouts of rays are those of the headers
//! `embree4/rtcore_*.h` of versions 4.0 to 4.4. The library is never unloaded: threads of its task
//! scheduler may still be running in it.

use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicIsize, Ordering};
use std::time::Instant;

use antumbra::{Level, Ray};

use super::soup::Soup;

/// An Embree object; which kind is told by where it came from.
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
    commit_geometry: "rtcCommitGeometry" (Handle);
    attach_geometry: "rtcAttachGeometry" (Handle, Handle) -> c_uint;
    occluded1: "rtcOccluded1" (Handle, *mut SingleRay, *mut c_void);
    intersect1: "rtcIntersect1" (Handle, *mut RayHit, *mut c_void);
    occluded16: "rtcOccluded16" (*const c_int, Handle, *mut Ray16, *mut c_void);
}

const VERSION_MAJOR: c_uint = 1;
const VERSION_MINOR: c_uint = 2;
const VERSION_PATCH: c_uint = 3;
const TRIANGLE_GEOMETRY: c_uint = 0;
const INDEX_BUFFER: c_uint = 0;
const VERTEX_BUFFER: c_uint = 1;
const FORMAT_UINT3: c_uint = 0x5003;
const FORMAT_FLOAT3: c_uint = 0x9003;
const QUALITY_MEDIUM: c_uint = 1;
const FLAG_ROBUST: c_uint = 4;
const ALL_GEOMETRY: c_uint = c_uint::MAX;
const NO_GEOMETRY: c_uint = c_uint::MAX;

/// `RTCRay`.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct SingleRay {
    org: [f32; 3],
    tnear: f32,
    dir: [f32; 3],
    time: f32,
    /// Minus infinity after an occlusion query that found something, the distance after a closest hit.
    tfar: f32,
    mask: c_uint,
    id: c_uint,
    flags: c_uint,
}

/// `RTCRayHit`. What follows `geom_id` depends on how the library was compiled: by default the id of an instance
/// and, in later versions, the number inside an array of instances, with padding to 96 bytes. There is room for two
/// levels of instances; without instances Embree writes no more than the first.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct RayHit {
    ray: SingleRay,
    normal: [f32; 3],
    u: f32,
    v: f32,
    prim_id: c_uint,
    geom_id: c_uint,
    instances: [c_uint; 5],
}

/// `RTCRay16`: sixteen rays, property by property.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Ray16 {
    org: [[f32; 16]; 3],
    tnear: [f32; 16],
    dir: [[f32; 16]; 3],
    time: [f32; 16],
    tfar: [f32; 16],
    mask: [c_uint; 16],
    id: [c_uint; 16],
    flags: [c_uint; 16],
}

/// Up to sixteen rays with the mask that says how many.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Packet {
    valid: [c_int; 16],
    rays: Ray16,
}

impl SingleRay {
    /// The ray as Embree wants it, before any query.
    pub fn new(ray: &Ray) -> Self {
        Self {
            org: ray.org,
            tnear: ray.tnear,
            dir: ray.dir,
            time: 0.0,
            tfar: ray.tfar,
            mask: ALL_GEOMETRY,
            id: 0,
            flags: 0,
        }
    }

    /// What an occlusion query found.
    pub fn is_occluded(&self) -> bool {
        self.tfar == f32::NEG_INFINITY
    }
}

impl RayHit {
    /// The ray as Embree wants it, before any query.
    pub fn new(ray: &Ray) -> Self {
        Self {
            ray: SingleRay::new(ray),
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            prim_id: 0,
            geom_id: NO_GEOMETRY,
            instances: [NO_GEOMETRY; 5],
        }
    }

    /// Distance of the closest hit, infinite for none.
    pub fn distance(&self) -> f32 {
        if self.geom_id == NO_GEOMETRY {
            f32::INFINITY
        } else {
            self.ray.tfar
        }
    }
}

impl Packet {
    /// A packet of the first sixteen rays, or fewer.
    pub fn new(rays: &[Ray]) -> Self {
        let mut packet = Self {
            valid: [0; 16],
            rays: Ray16 {
                org: [[0.0; 16]; 3],
                tnear: [0.0; 16],
                // Lanes without a ray are not looked at, but they are computed with.
                dir: [[1.0; 16]; 3],
                time: [0.0; 16],
                tfar: [0.0; 16],
                mask: [ALL_GEOMETRY; 16],
                id: [0; 16],
                flags: [0; 16],
            },
        };
        for (lane, ray) in rays.iter().take(16).enumerate() {
            packet.valid[lane] = -1;
            for axis in 0..3 {
                packet.rays.org[axis][lane] = ray.org[axis];
                packet.rays.dir[axis][lane] = ray.dir[axis];
            }
            packet.rays.tnear[lane] = ray.tnear;
            packet.rays.tfar[lane] = ray.tfar;
        }
        packet
    }

    /// What an occlusion query found for the rays of the packet.
    pub fn occluded(&self) -> impl Iterator<Item = bool> {
        let lanes = self.valid.iter().zip(self.rays.tfar);
        lanes
            .filter(|(valid, _)| **valid != 0)
            .map(|(_, tfar)| tfar == f32::NEG_INFINITY)
    }
}

/// The loaded library.
#[derive(Clone, Copy)]
pub struct Embree {
    functions: &'static Functions,
    version: [isize; 3],
}

impl Embree {
    /// Loads a shared library and checks that it is Embree 4.
    ///
    /// # Errors
    /// Why it cannot be used, for people.
    pub fn load(path: &Path) -> Result<Self, String> {
        let reason = |reason: String| format!("cannot use {} as Embree: {reason}", path.display());
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

    /// Its version.
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

/// The `isa` by which Embree uses the instructions of a level; `None` if it has no such.
pub fn isa(level: Level) -> Option<&'static str> {
    match level {
        Level::Avx512 => Some("avx512"),
        Level::Avx2 => Some("avx2"),
        Level::Sse41 => Some("sse4.2"),
        // Embree has no scalar kernels, and on Arm no choice that could be checked.
        Level::Scalar | Level::Neon => None,
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
    /// A device that builds on so many threads and uses the instructions of a level.
    ///
    /// # Errors
    /// What Embree says.
    pub fn new(embree: Embree, isa: &str, threads: usize) -> Result<Arc<Self>, String> {
        Self::open(embree, &format!("isa={isa},threads={threads}")).map(Arc::new)
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

/// A committed scene of one triangle mesh.
pub struct Scene {
    device: Arc<Device>,
    handle: Handle,
    /// Seconds in `rtcCommitScene`.
    pub seconds: f64,
    /// Bytes that the device holds more after the commit than before: the finished tree.
    pub bytes: usize,
    /// Bytes of the vertex and index buffers, allocated before.
    pub buffer_bytes: usize,
}

// SAFETY: a committed scene may be queried from any thread at the same time, and is never changed again.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

impl Scene {
    /// Builds a scene of quality MEDIUM, Embree's default; `robust` asks for its watertight traversal. The
    /// device must have no other scene under construction, or bytes are mixed up.
    ///
    /// # Errors
    /// What Embree says.
    pub fn build(device: &Arc<Device>, soup: &Soup, robust: bool) -> Result<Self, String> {
        let functions = device.embree.functions;
        let before = device.bytes();
        // SAFETY: the device is alive as long as the scene, which owns a share of it.
        let handle = unsafe { (functions.new_scene)(device.handle) };
        if handle.is_null() {
            device.check()?;
            return Err("Embree makes no scene".into());
        }
        let mut scene = Self {
            device: Arc::clone(device),
            handle,
            seconds: 0.0,
            bytes: 0,
            buffer_bytes: 0,
        };
        // SAFETY: the scene is alive and not committed.
        unsafe {
            (functions.scene_flags)(handle, if robust { FLAG_ROBUST } else { 0 });
            (functions.scene_quality)(handle, QUALITY_MEDIUM);
        }
        if !soup.triangles.is_empty() {
            scene.attach(soup)?;
        }
        let filled = device.bytes();
        let start = Instant::now();
        // SAFETY: the scene is alive, and nobody else has it yet.
        unsafe { (functions.commit_scene)(handle) };
        scene.seconds = start.elapsed().as_secs_f64();
        device.check()?;
        scene.buffer_bytes = filled.saturating_sub(before);
        scene.bytes = device.bytes().saturating_sub(filled);
        Ok(scene)
    }

    fn attach(&self, soup: &Soup) -> Result<(), String> {
        let functions = self.device.embree.functions;
        // SAFETY: the device is alive.
        let geometry = unsafe { (functions.new_geometry)(self.device.handle, TRIANGLE_GEOMETRY) };
        if geometry.is_null() {
            self.device.check()?;
            return Err("Embree makes no geometry".into());
        }
        let fill = |kind, format, from: *const [u32; 3], count: usize| {
            // SAFETY: the geometry is alive and not committed. Embree allocates at least `count` items of 12
            // bytes each, with the padding that its own loads need, and returns null if it cannot.
            let buffer = unsafe { (functions.new_buffer)(geometry, kind, 0, format, 12, count) };
            if !buffer.is_null() {
                // SAFETY: `from` points to `count` items of three 32-bit numbers; the buffer is new, so they
                // do not overlap.
                unsafe { std::ptr::copy_nonoverlapping(from, buffer.cast(), count) };
            }
        };
        let (positions, triangles) = (&soup.positions, &soup.triangles);
        let vertices = positions.as_ptr().cast::<[u32; 3]>();
        fill(VERTEX_BUFFER, FORMAT_FLOAT3, vertices, positions.len());
        fill(
            INDEX_BUFFER,
            FORMAT_UINT3,
            triangles.as_ptr(),
            triangles.len(),
        );
        let filled = self.device.check();
        // SAFETY: the geometry is alive; attached, it belongs to the scene, too, so that this share of it can
        // be given up.
        unsafe {
            if filled.is_ok() {
                (functions.commit_geometry)(geometry);
                (functions.attach_geometry)(self.handle, geometry);
            }
            (functions.release_geometry)(geometry);
        }
        filled
    }

    /// `rtcOccluded1` for every ray.
    pub fn occluded(&self, rays: &mut [SingleRay]) {
        let occluded1 = self.device.embree.functions.occluded1;
        let _mode = FlushDenormals::begin();
        for ray in rays {
            // SAFETY: the scene is committed and alive; the ray has the layout of `RTCRay`; no arguments
            // are given.
            unsafe { occluded1(self.handle, ray, std::ptr::null_mut()) };
        }
    }

    /// `rtcIntersect1` for every ray.
    pub fn intersect(&self, rays: &mut [RayHit]) {
        let intersect1 = self.device.embree.functions.intersect1;
        let _mode = FlushDenormals::begin();
        for ray in rays {
            // SAFETY: as above, with room for an `RTCRayHit`.
            unsafe { intersect1(self.handle, ray, std::ptr::null_mut()) };
        }
    }

    /// `rtcOccluded16` for every packet.
    pub fn occluded_packets(&self, packets: &mut [Packet]) {
        let occluded16 = self.device.embree.functions.occluded16;
        let _mode = FlushDenormals::begin();
        for Packet { valid, rays } in packets {
            // SAFETY: as above, with the layout and alignment of a mask of 16 and an `RTCRay16`.
            unsafe { occluded16(valid.as_ptr(), self.handle, rays, std::ptr::null_mut()) };
        }
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: queries borrow the scene, so none is running.
        unsafe { (self.device.embree.functions.release_scene)(self.handle) };
    }
}

/// Has this thread flush denormal numbers to zero until dropped, as Embree recommends to its callers. While it
/// lives only Embree may compute with floating-point numbers: Rust assumes the default mode.
struct FlushDenormals {
    #[cfg(target_arch = "x86_64")]
    before: u32,
}

#[cfg(target_arch = "x86_64")]
impl FlushDenormals {
    /// Flush to zero, and denormals are zeros.
    const BITS: u32 = 0x8040;

    fn begin() -> Self {
        let mut before = 0u32;
        // SAFETY: stores the control register to a variable. Every x86-64 CPU has it.
        unsafe { std::arch::asm!("stmxcsr [{}]", in(reg) &mut before, options(nostack)) };
        Self::set(before | Self::BITS);
        Self { before }
    }

    fn set(mode: u32) {
        // SAFETY: loads a control register that was read before, at most with two defined bits more; Rust
        // code meets it restored, see above.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &mode, options(nostack)) };
    }
}

#[cfg(target_arch = "x86_64")]
impl Drop for FlushDenormals {
    fn drop(&mut self) {
        Self::set(self.before);
    }
}

#[cfg(not(target_arch = "x86_64"))]
impl FlushDenormals {
    fn begin() -> Self {
        Self {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_are_those_of_the_headers() {
        assert_eq!((size_of::<SingleRay>(), align_of::<SingleRay>()), (48, 16));
        assert_eq!(std::mem::offset_of!(SingleRay, tfar), 32);
        assert_eq!((size_of::<RayHit>(), align_of::<RayHit>()), (96, 16));
        assert_eq!(std::mem::offset_of!(RayHit, prim_id), 68);
        assert_eq!(std::mem::offset_of!(RayHit, geom_id), 72);
        assert_eq!((size_of::<Ray16>(), align_of::<Ray16>()), (768, 64));
        assert_eq!(std::mem::offset_of!(Packet, rays), 64);
    }

    #[test]
    fn what_is_not_embree_is_refused_in_words() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let missing = folder.path().join("none.so");
        let text = folder.path().join("text.so");
        std::fs::write(&text, "not a library").expect("a file");
        for (path, hint) in [(missing, "no such file"), (text, "text.so")] {
            let reason = Embree::load(&path).err().expect("no Embree");
            assert!(
                reason.contains(hint) && reason.contains("as Embree"),
                "{reason}"
            );
        }
    }
}
