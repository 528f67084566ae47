//! Intel Open Image Denoise 2, loaded at run time. All `unsafe` of denoising is here.
//!
//! `unsafe` is needed because functions of a C library that is loaded at run time are called: the compiler sees neither their
//! signatures nor what they do with pointers.
//!
//! Nothing of the library is needed to build or to run the program. The functions used are looked up in the shared library
//! by name. Their signatures follow the header `OpenImageDenoise/oidn.h` of versions 2.0 to 2.5. The library is
//! never unloaded: threads of its task scheduler may still be running in it.

use std::env;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};

use libloading::Library as Shared;

/// Reason why a picture was not denoised.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The library was not found, or is something else.
    #[error(
        "Intel Open Image Denoise was not found ({reason}); install it from www.openimagedenoise.org or with \
         `pip install pyoidn`, or name its folder by --library or OIDN_LIBRARY"
    )]
    Missing {
        /// The last path tried, and the message of the system.
        reason: String,
    },
    /// The library has another version than 2.
    #[error("{}: it has no function {function}; version 2 of Intel Open Image Denoise is needed", path.display())]
    Version {
        /// File of the library.
        path: PathBuf,
        /// Function that is missing.
        function: &'static str,
    },
    /// A list does not have a value for every pixel.
    #[error("{found} values of {what} were given for {expected} pixels")]
    Count {
        /// Name of the list.
        what: &'static str,
        /// Number of pixels.
        expected: usize,
        /// Length of the list.
        found: usize,
    },
    /// The library failed.
    #[error("Intel Open Image Denoise: {0}")]
    Failed(String),
}

/// An object of the library.
type Handle = *mut c_void;

/// Declares the table of functions and the search for all of them.
macro_rules! functions {
    ($($field:ident: $name:literal ($($argument:ty),*) $(-> $result:ty)?;)*) => {
        struct Functions {
            $($field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            fn find(library: &'static Shared) -> Result<Self, &'static str> {
                Ok(Self {
                    $($field: {
                        // SAFETY: version 2 exports a function of this signature by this name, as its header declares.
                        // Version 1 is refused, because it lacks `oidnSetFilterBool`. The library is never unloaded.
                        let symbol = unsafe { library.get(concat!($name, "\0").as_bytes()) };
                        *symbol.map_err(|_| $name)?
                    },)*
                })
            }
        }
    };
}

functions! {
    new_device: "oidnNewDevice" (c_int) -> Handle;
    commit_device: "oidnCommitDevice" (Handle);
    device_error: "oidnGetDeviceError" (Handle, *mut *const c_char) -> c_int;
    release_device: "oidnReleaseDevice" (Handle);
    new_filter: "oidnNewFilter" (Handle, *const c_char) -> Handle;
    set_image: "oidnSetSharedFilterImage" (Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);
    set_bool: "oidnSetFilterBool" (Handle, *const c_char, bool);
    commit_filter: "oidnCommitFilter" (Handle);
    execute: "oidnExecuteFilter" (Handle);
    release_filter: "oidnReleaseFilter" (Handle);
}

/// `OIDN_DEVICE_TYPE_CPU`, which works on memory of the host.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// The library.
pub struct Library {
    functions: Functions,
}

/// Names of the library, by platform.
const NAMES: &[&str] = if cfg!(windows) {
    &["OpenImageDenoise.dll"]
} else if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]
};

/// Folder of the library in the packages of Python, by `pip install pyoidn`.
const PYOIDN: &str = "pyoidn/oidn";

impl Library {
    /// Loads the library: a file, or from a folder or its folders `lib` and `bin`. Without a path, what the variable
    /// `OIDN_LIBRARY` names, or else what the system finds, or else what `pip install pyoidn` has put there.
    ///
    /// # Errors
    /// [`Error::Missing`] or [`Error::Version`].
    pub fn open(path: Option<&Path>) -> Result<Self, Error> {
        let named = path.map(Path::to_path_buf);
        let named = named.or_else(|| env::var_os("OIDN_LIBRARY").map(PathBuf::from));
        let mut reason = String::new();
        for file in candidates(named.as_deref()) {
            // SAFETY: loading runs the initializers of a C library, which cannot be checked. It is the library that the
            // user named or installed.
            match unsafe { Shared::new(&file) } {
                Ok(library) => {
                    // Never unloaded: pointers to its functions are kept.
                    let library: &'static Shared = Box::leak(Box::new(library));
                    let found = Functions::find(library);
                    let functions = found.map_err(|function| Error::Version {
                        path: file,
                        function,
                    })?;
                    return Ok(Self { functions });
                }
                Err(error) => reason = format!("{}: {error}", file.display()),
            }
        }
        Err(Error::Missing { reason })
    }

    /// Picture of `width * height` linear pixels without noise, row by row, with the albedo and the normals of its
    /// surfaces if they are known.
    ///
    /// # Errors
    /// [`Error::Count`] or [`Error::Failed`].
    pub fn denoise(
        &self,
        [width, height]: [usize; 2],
        color: &[[f32; 3]],
        albedo: Option<&[[f32; 3]]>,
        normal: Option<&[[f32; 3]]>,
    ) -> Result<Vec<[f32; 3]>, Error> {
        let expected = width.saturating_mul(height);
        let mut images = vec![(c"color", "colour", color)];
        images.extend(albedo.map(|albedo| (c"albedo", "albedo", albedo)));
        // The filter takes normals only together with albedo.
        let normal = normal.filter(|_| albedo.is_some());
        images.extend(normal.map(|normal| (c"normal", "normals", normal)));
        for &(_, what, values) in &images {
            if values.len() != expected {
                return Err(Error::Count {
                    what,
                    expected,
                    found: values.len(),
                });
            }
        }
        let mut output = vec![[0.0; 3]; expected];
        let functions = &self.functions;
        let set = |filter, name: &CStr, values: *mut [f32; 3]| {
            let (name, values) = (name.as_ptr(), values.cast());
            // SAFETY: a function of the loaded library, with the signature of its header. The filter exists. `values` has
            // `width * height` elements of three floats, as checked above, and outlives the filter. The library writes
            // only to the output.
            unsafe {
                (functions.set_image)(filter, name, values, FLOAT3, width, height, 0, 0, 0);
            }
        };
        // SAFETY: functions of the loaded library, with the signatures of its header. Handles are not null, as checked here,
        // are used only while they exist, and are released once.
        unsafe {
            let device = (functions.new_device)(CPU);
            if device.is_null() {
                return Err(Error::Failed(self.reason(device, "made no device")));
            }
            (functions.commit_device)(device);
            let filter = (functions.new_filter)(device, c"RT".as_ptr());
            if filter.is_null() {
                let reason = self.reason(device, "made no filter");
                (functions.release_device)(device);
                return Err(Error::Failed(reason));
            }
            for &(name, _, values) in &images {
                set(filter, name, values.as_ptr().cast_mut());
            }
            set(filter, c"output", output.as_mut_ptr());
            (functions.set_bool)(filter, c"hdr".as_ptr(), true);
            (functions.commit_filter)(filter);
            (functions.execute)(filter);
            let error = self.error(device);
            (functions.release_filter)(filter);
            (functions.release_device)(device);
            match error {
                Some(text) => Err(Error::Failed(text)),
                None => Ok(output),
            }
        }
    }

    /// Last error of a device, or of the thread for a null handle, as the library allows.
    ///
    /// # Safety
    /// The device exists or is null.
    unsafe fn error(&self, device: Handle) -> Option<String> {
        let mut message = std::ptr::null();
        // SAFETY: a function of the loaded library, with the signature of its header. The caller promises that the device
        // exists or is null. The message is null or a string, which lives until the next call.
        unsafe {
            let code = (self.functions.device_error)(device, &raw mut message);
            (code != 0).then(|| match message.is_null() {
                true => format!("error {code}"),
                false => CStr::from_ptr(message).to_string_lossy().into_owned(),
            })
        }
    }

    /// Error of the library, or what it did without one.
    ///
    /// # Safety
    /// As [`Self::error`].
    unsafe fn reason(&self, device: Handle, otherwise: &str) -> String {
        // SAFETY: the caller promises that the device exists or is null.
        let error = unsafe { self.error(device) };
        error.unwrap_or_else(|| format!("the library {otherwise}, and gives no reason"))
    }
}

/// Folders of the packages of Python: of the environment that is active, of the `python3` on the path, of the user.
fn site_packages() -> Vec<PathBuf> {
    let variables = ["VIRTUAL_ENV", "CONDA_PREFIX"];
    let mut homes: Vec<PathBuf> = variables
        .iter()
        .filter_map(|name| env::var_os(name).map(PathBuf::from))
        .collect();
    let path = env::var_os("PATH").unwrap_or_default();
    let python = env::split_paths(&path).find(|folder| folder.join("python3").exists());
    homes.extend(python.and_then(|folder| Some(folder.parent()?.to_path_buf())));
    homes.extend(env::home_dir().map(|home| home.join(".local")));
    let folders = homes.iter().flat_map(|home| {
        let entries = std::fs::read_dir(home.join("lib")).into_iter().flatten();
        entries.flatten().map(|entry| entry.path())
    });
    let is_python = |folder: &PathBuf| {
        let name = folder.file_name().unwrap_or_default();
        name.to_string_lossy().starts_with("python3")
    };
    folders
        .filter(is_python)
        .map(|folder| folder.join("site-packages"))
        .collect()
}

/// Files that may be the library.
fn candidates(named: Option<&Path>) -> Vec<PathBuf> {
    match named {
        None => {
            let of_system = NAMES.iter().map(PathBuf::from);
            let of_python = site_packages()
                .into_iter()
                .map(|folder| folder.join(PYOIDN));
            let of_python = of_python.filter(|folder| folder.is_dir());
            of_system
                .chain(of_python.flat_map(|folder| candidates(Some(&folder))))
                .collect()
        }
        Some(path) if path.is_dir() => {
            let folders = [path.to_path_buf(), path.join("lib"), path.join("bin")];
            let mut found: Vec<PathBuf> = folders
                .iter()
                .flat_map(|folder| NAMES.iter().map(|name| folder.join(name)))
                .filter(|file| file.is_file())
                .collect();
            // Packages may hold only the name with the full version.
            for folder in &folders {
                let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
                let mut versions: Vec<PathBuf> = entries
                    .map(|entry| entry.path())
                    .filter(|file| {
                        let name = file.file_name().unwrap_or_default().to_string_lossy();
                        NAMES
                            .iter()
                            .any(|known| name.starts_with(&format!("{known}.")))
                    })
                    .collect();
                versions.sort();
                found.extend(versions);
            }
            if found.is_empty() {
                found.push(path.join(NAMES[0]));
            }
            found
        }
        Some(path) => vec![path.to_path_buf()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_library_is_explained() {
        let error = Library::open(Some(Path::new("/nowhere/libOpenImageDenoise.so")));
        let text = error.err().expect("nothing is there").to_string();
        assert!(text.contains("pip install pyoidn"), "{text}");
        assert!(text.contains("/nowhere/"), "{text}");
    }

    /// A library that makes nothing, without a device and with one.
    #[test]
    fn null_handles_are_errors() {
        extern "C" fn new_device(_: c_int) -> Handle {
            std::ptr::null_mut()
        }
        extern "C" fn some_device(_: c_int) -> Handle {
            std::ptr::dangling_mut::<u8>().cast()
        }
        extern "C" fn one(_: Handle) {}
        extern "C" fn device_error(_: Handle, _: *mut *const c_char) -> c_int {
            0
        }
        extern "C" fn new_filter(_: Handle, _: *const c_char) -> Handle {
            std::ptr::null_mut()
        }
        #[rustfmt::skip]
        extern "C" fn set_image(
            _: Handle, _: *const c_char, _: *mut c_void, _: c_int, _: usize, _: usize, _: usize, _: usize, _: usize,
        ) {}
        extern "C" fn set_bool(_: Handle, _: *const c_char, _: bool) {}
        let devices: [(extern "C" fn(c_int) -> Handle, &str); 2] =
            [(new_device, "no device"), (some_device, "no filter")];
        for (new_device, what) in devices {
            let functions = Functions {
                new_device,
                commit_device: one,
                device_error,
                release_device: one,
                new_filter,
                set_image,
                set_bool,
                commit_filter: one,
                execute: one,
                release_filter: one,
            };
            let denoised = Library { functions }.denoise([1, 1], &[[1.0; 3]], None, None);
            let text = denoised.expect_err("nothing was done").to_string();
            assert!(text.contains(what), "{text}");
        }
    }

    /// With the library named by `OIDN_LIBRARY`: noise around a grey goes, an edge stays.
    #[test]
    fn noise_goes_and_edges_stay() {
        if env::var_os("OIDN_LIBRARY").is_none() {
            println!("not run: OIDN_LIBRARY names no library");
            return;
        }
        let library = Library::open(None).expect("the library that OIDN_LIBRARY names");
        let size = 64;
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let level = |x: usize| if x < size / 2 { 0.2 } else { 0.8 };
        let pixels: Vec<[f32; 3]> = (0..size * size)
            .map(|i| [level(i % size) * (0.5 + noise()); 3])
            .collect();
        let clean = library
            .denoise([size, size], &pixels, None, None)
            .expect("a picture");
        let error = |pixels: &[[f32; 3]]| {
            let squares = pixels
                .iter()
                .enumerate()
                .map(|(i, pixel)| (pixel[0] - level(i % size)).powi(2));
            squares.sum::<f32>() / pixels.len() as f32
        };
        assert!(
            error(&clean) < 0.1 * error(&pixels),
            "{} {}",
            error(&clean),
            error(&pixels)
        );
        let short = library.denoise([size, size], &pixels[1..], None, None);
        assert!(matches!(short, Err(Error::Count { .. })));
    }
}
