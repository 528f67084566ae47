//! Intel Open Image Denoise 2, loaded at run time. All `unsafe` of denoising is here.
//!
//! Nothing of the library is needed to build or to run the program. The functions used are looked up in the shared library
//! by name. Their signatures are those of the header `OpenImageDenoise/oidn.h` of versions 2.0 to 2.5. The library is
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
         `pip install pyoidn`, and name its folder by --library or OIDN_LIBRARY"
    )]
    Missing {
        /// What was tried last, and what the system says.
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
        /// What the list holds.
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
            fn find(library: &Shared) -> Result<Self, &'static str> {
                Ok(Self {
                    $($field: {
                        // SAFETY: version 2 exports a function of this signature by this name. `oidnSetFilterBool`,
                        // which version 1 lacks, is among them.
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

impl Library {
    /// Loads the library: a file, or from a folder or its folders `lib` and `bin`. Without a path, what the variable
    /// `OIDN_LIBRARY` names, or else what the system finds.
    ///
    /// # Errors
    /// [`Error::Missing`] or [`Error::Version`].
    pub fn open(path: Option<&Path>) -> Result<Self, Error> {
        let named = path.map(Path::to_path_buf);
        let named = named.or_else(|| env::var_os("OIDN_LIBRARY").map(PathBuf::from));
        let mut reason = String::new();
        for file in candidates(named.as_deref()) {
            // SAFETY: loading runs the initializers of the library, which the user named or installed.
            match unsafe { Shared::new(&file) } {
                Ok(library) => {
                    // Never unloaded.
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
        let set = |filter: Handle, name: &CStr, values: *mut [f32; 3]| {
            // SAFETY: the filter exists, and `values` has `width * height` elements of three floats, which outlive it.
            // The library writes to the output alone.
            unsafe {
                (functions.set_image)(
                    filter,
                    name.as_ptr(),
                    values.cast(),
                    FLOAT3,
                    width,
                    height,
                    0,
                    0,
                    0,
                );
            }
        };
        // SAFETY: handles are used only while they exist, and are released once. The library allows null handles, which
        // it answers with an error.
        unsafe {
            let device = (functions.new_device)(CPU);
            (functions.commit_device)(device);
            let filter = (functions.new_filter)(device, c"RT".as_ptr());
            for &(name, _, values) in &images {
                set(filter, name, values.as_ptr().cast_mut());
            }
            set(filter, c"output", output.as_mut_ptr());
            (functions.set_bool)(filter, c"hdr".as_ptr(), true);
            (functions.commit_filter)(filter);
            (functions.execute)(filter);
            let mut message = std::ptr::null();
            let code = (functions.device_error)(device, &raw mut message);
            let text = if message.is_null() {
                format!("error {code}")
            } else {
                CStr::from_ptr(message).to_string_lossy().into_owned()
            };
            (functions.release_filter)(filter);
            (functions.release_device)(device);
            if code != 0 {
                return Err(Error::Failed(text));
            }
        }
        Ok(output)
    }
}

/// Files that may be the library.
fn candidates(named: Option<&Path>) -> Vec<PathBuf> {
    match named {
        None => NAMES.iter().map(PathBuf::from).collect(),
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

    /// With the library at hand, named by `OIDN_LIBRARY`: noise around a grey goes, an edge stays.
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
