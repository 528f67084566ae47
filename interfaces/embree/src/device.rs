//! Devices: settings, threads of commits, errors, and the memory monitor.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use antumbra::Isa;
use antumbra::recipe::Level;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::abi::{ErrorCode, ErrorFunction, MemoryFunction};
use crate::failure::{Failure, Outcome, forget, guarded, last_text, take};
use crate::handle::{Handle, device_of, give, lock, look, release, retain};

/// A function of the client with the pointer that it wants.
#[derive(Clone, Copy)]
pub struct Callback<F> {
    pub function: F,
    pub user: *mut c_void,
}

// SAFETY: the pointer is only handed back to the client, whose functions may be called from any thread.
unsafe impl<F: Send> Send for Callback<F> {}
// SAFETY: as above.
unsafe impl<F: Sync> Sync for Callback<F> {}

/// `RTCDevice`.
pub struct Device {
    id: u64,
    isa: Option<Isa>,
    /// Threads of commits, if the client chose their number. Otherwise rayon's own.
    pool: Option<ThreadPool>,
    error: Mutex<Option<Callback<ErrorFunction>>>,
    memory: Mutex<Option<Callback<MemoryFunction>>>,
}

impl Handle for Device {
    fn device(&self) -> Option<&Device> {
        Some(self)
    }
}

impl Device {
    fn new(config: &str) -> Outcome<Self> {
        static LAST_ID: AtomicU64 = AtomicU64::new(0);
        let settings = Settings::parse(config)?;
        let pool = match settings.threads {
            0 => None,
            threads => Some(
                (ThreadPoolBuilder::new().num_threads(threads).build())
                    .map_err(|error| Failure::new(ErrorCode::Unknown, error.to_string()))?,
            ),
        };
        Ok(Self {
            id: LAST_ID.fetch_add(1, Ordering::Relaxed) + 1,
            isa: settings.isa,
            pool,
            error: Mutex::default(),
            memory: Mutex::default(),
        })
    }

    /// A number that no other device has, not 0.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The instruction set that the client chose.
    pub fn isa(&self) -> Option<Isa> {
        self.isa
    }

    /// Runs work on the threads of the device.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }

    pub fn call_error_function(&self, code: c_int, text: &CStr) {
        let callback = *lock(&self.error);
        if let Some(Callback { function, user }) = callback {
            // SAFETY: the client gave the function with this pointer.
            unsafe { function(user, code, text.as_ptr()) }
        }
    }

    /// Reports bytes that come, or go if negative, to the memory monitor. The monitor may refuse bytes that come.
    pub fn count_memory(&self, bytes: isize) -> Outcome {
        let callback = *lock(&self.memory);
        let Some(Callback { function, user }) = callback else {
            return Ok(());
        };
        // SAFETY: the client gave the function with this pointer.
        let goes_on = unsafe { function(user, bytes, bytes < 0) };
        if goes_on || bytes < 0 {
            Ok(())
        } else {
            Err(Failure::new(
                ErrorCode::Cancelled,
                "memory monitor forced termination",
            ))
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        forget(self.id);
    }
}

/// Settings of a configuration string.
#[derive(Debug, Default)]
struct Settings {
    threads: usize,
    isa: Option<Isa>,
}

impl Settings {
    /// Settings of speed and of details inside Embree mean nothing here; names that Embree does not have are refused.
    fn parse(config: &str) -> Outcome<Self> {
        const INSIDE: [&str; 27] = [
            "user_threads",
            "set_affinity",
            "affinity",
            "start_threads",
            "hugepages",
            "verbose",
            "frequency_level",
            "enable_selockmemoryprivilege",
            "alloc_main_block_size",
            "alloc_num_main_slots",
            "alloc_thread_block_size",
            "alloc_single_thread_alloc",
            "tessellation_cache_size",
            "max_spatial_split_replications",
            "max_triangles_per_leaf",
            "tri_accel",
            "tri_builder",
            "tri_traverser",
            "quad_accel",
            "quad_builder",
            "quad_traverser",
            "object_accel",
            "object_builder",
            "grid_accel",
            "hair_accel",
            "subdiv_accel",
            "ignore_config_files",
        ];
        let mut settings = Self::default();
        let parts = config.split([',', ';']).map(str::trim);
        for part in parts.filter(|part| !part.is_empty()) {
            let (key, value) = part.split_once('=').unwrap_or((part, ""));
            let (key, value) = (key.trim().to_ascii_lowercase(), value.trim());
            match key.as_str() {
                "threads" => {
                    settings.threads = value.parse().map_err(|_| {
                        Failure::argument(format!("threads={value}: not a number of threads"))
                    })?;
                }
                "isa" | "max_isa" => settings.isa = Some(isa(value)?),
                key if INSIDE.contains(&key.trim_end_matches("_mb")) => {}
                _ => return Err(Failure::argument(format!("unknown setting `{key}`"))),
            }
        }
        Ok(settings)
    }
}

/// The instruction set of this name, or the best one below it that the machine has. Answers are the same on each.
fn isa(name: &str) -> Outcome<Isa> {
    let level = match name.to_ascii_lowercase().as_str() {
        "sse" | "sse2" | "sse3" | "ssse3" | "sse41" | "sse4.1" | "sse42" | "sse4.2" | "avx"
        | "avxi" => Level::Scalar,
        "avx2" => Level::Avx2,
        "avx512" | "avx512skx" | "avx512knl" => Level::Avx512,
        "neon" | "neon2x" => return Ok(Isa::best()),
        _ => return Err(Failure::argument(format!("unknown isa `{name}`"))),
    };
    Ok(Isa::new(level).unwrap_or_else(|_| Isa::best()))
}

/// `RTCDeviceProperty`.
fn property(property: c_int) -> Outcome<isize> {
    Ok(match property {
        // Version 4.4.0.
        0 => 40400,
        1 | 2 => 4,
        3 => 0,
        // Packets of 4, 8 and 16 rays are traced in packets and streams.
        32..=34 => 1,
        // Culling of back faces is off, also of spheres and curves; invalid rays are ignored; meshes are not compact.
        62 | 63 | 65 | 68 => 0,
        // Masks, filters, ignored invalid rays.
        64 | 66 | 67 => 1,
        // Triangles, quads, user geometry, points (spheres).
        96 | 97 | 100 | 101 => 1,
        // Subdivision surfaces, curves.
        98 | 99 => 0,
        // Tasks run in a system of the library; commits can be joined, and may run at once.
        128 => 0,
        129 | 130 => 1,
        140 => 1,
        141 => 0,
        _ => return Err(Failure::argument("unknown readable property")),
    })
}

/// # Safety
/// `config` is null or a text that ends with 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcNewDevice(config: *const c_char) -> *const Device {
    guarded(None, std::ptr::null(), || {
        let config = if config.is_null() {
            ""
        } else {
            // SAFETY: the caller's text.
            (unsafe { CStr::from_ptr(config) }.to_str())
                .map_err(|_| Failure::argument("the configuration is not UTF-8"))?
        };
        Ok(give(Arc::new(Device::new(config)?)))
    })
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcRetainDevice(device: *const Device) {
    // SAFETY: the caller's handle.
    unsafe { guarded(device_of(device), (), || retain(device)) }
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcReleaseDevice(device: *const Device) {
    // SAFETY: the caller's handle.
    guarded(None, (), || unsafe { release(device) })
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetDeviceProperty(device: *const Device, which: c_int) -> isize {
    // SAFETY: the caller's handle.
    unsafe {
        guarded(device_of(device), 0, || {
            look(device)?;
            property(which)
        })
    }
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetDeviceProperty(device: *const Device, _: c_int, _: isize) {
    // SAFETY: the caller's handle.
    unsafe {
        guarded(device_of(device), (), || {
            look(device)?;
            Err(Failure::argument("unknown writable property"))
        })
    }
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetDeviceError(device: *const Device) -> c_int {
    // SAFETY: the caller's handle.
    let id = unsafe { device.as_ref() }.map_or(0, Device::id);
    take(id) as c_int
}

/// # Safety
/// A device of this library, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcGetDeviceLastErrorMessage(device: *const Device) -> *const c_char {
    // SAFETY: the caller's handle.
    last_text(unsafe { device.as_ref() }.map_or(0, Device::id))
}

#[unsafe(no_mangle)]
pub extern "C" fn rtcGetErrorString(code: c_int) -> *const c_char {
    match code {
        0 => c"RTC_ERROR_NONE",
        1 => c"RTC_ERROR_UNKNOWN",
        2 => c"RTC_ERROR_INVALID_ARGUMENT",
        3 => c"RTC_ERROR_INVALID_OPERATION",
        4 => c"RTC_ERROR_OUT_OF_MEMORY",
        5 => c"RTC_ERROR_UNSUPPORTED_CPU",
        6 => c"RTC_ERROR_CANCELLED",
        7 => c"RTC_ERROR_LEVEL_ZERO_RAYTRACING_SUPPORT_MISSING",
        _ => c"Invalid error code",
    }
    .as_ptr()
}

/// # Safety
/// A device of this library, or null; the function takes `user`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetDeviceErrorFunction(
    device: *const Device,
    function: Option<ErrorFunction>,
    user: *mut c_void,
) {
    // SAFETY: the caller's handle.
    unsafe {
        guarded(device_of(device), (), || {
            let callback = function.map(|function| Callback { function, user });
            *lock(&look(device)?.error) = callback;
            Ok(())
        })
    }
}

/// # Safety
/// A device of this library, or null; the function takes `user`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rtcSetDeviceMemoryMonitorFunction(
    device: *const Device,
    function: Option<MemoryFunction>,
    user: *mut c_void,
) {
    // SAFETY: the caller's handle.
    unsafe {
        guarded(device_of(device), (), || {
            let callback = function.map(|function| Callback { function, user });
            *lock(&look(device)?.memory) = callback;
            Ok(())
        })
    }
}
