//! Trees, objects and worlds in files and in memory.

use std::ffi::{CStr, c_char};
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use antumbra::{Bvh, Error, Object, World};

use crate::arrays::{Items, Slot, shared, text};
use crate::build::OwnObject;
use crate::functions::FunctionLists;
use crate::status::{Failure, Outcome, Status, guarded};
use crate::world::OwnWorld;

/// A path of the caller.
#[cfg(unix)]
fn path_of(path: &CStr) -> Outcome<&Path> {
    use std::os::unix::ffi::OsStrExt;
    Ok(Path::new(std::ffi::OsStr::from_bytes(path.to_bytes())))
}

/// A path of the caller, in UTF-8.
#[cfg(not(unix))]
fn path_of(path: &CStr) -> Outcome<&Path> {
    let path = path
        .to_str()
        .map_err(|_| Failure::argument("`path` is not UTF-8"))?;
    Ok(Path::new(path))
}

/// Writes a file as a whole or not at all.
fn write_file(path: &Path, write: impl FnOnce(&mut dyn Write) -> Result<(), Error>) -> Outcome {
    let mut failed = None;
    let written = antumbra_files::write_file(path, |file| {
        write(file).map_err(|error| {
            let text = error.to_string();
            failed = Some(error);
            io::Error::other(text)
        })
    });
    // Errors of the kernel say more than those of files that hold them.
    let error = |error: io::Error| failed.unwrap_or(Error::from(error));
    written.map_err(|source| Failure::from(error(source)).about(&path.display().to_string()))
}

/// Opens a file to read.
fn open(path: &Path) -> Outcome<File> {
    let file = antumbra_files::open(path);
    file.map_err(|error| Failure::from(Error::from(error)).about(&path.display().to_string()))
}

/// The four functions of a type.
macro_rules! saved {
    ($what:literal, $handle:literal, $Own:ty, $Kernel:ty, $kernel:expr, $own:expr, $save:ident, $load:ident, $to_memory:ident, $from_memory:ident) => {
        #[doc = concat!("Writes ", $what, " into a file.")]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $save(saved: *const $Own, path: *const c_char) -> Status {
            guarded(|| {
                // SAFETY: the header says what is at these addresses.
                let (saved, path) = unsafe { (shared(saved, $handle)?, text(path, "path")?) };
                let kernel: fn(&$Own) -> &$Kernel = $kernel;
                write_file(path_of(path)?, |file| kernel(saved).write(file))
            })
        }

        #[doc = concat!("Reads ", $what, " from a file.")]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $load(
            path: *const c_char,
            functions: *const FunctionLists,
            loaded: *mut *mut $Own,
        ) -> Status {
            guarded(|| {
                // SAFETY: the header says what is at these addresses.
                let (slot, path) = unsafe {
                    (
                        Slot::handle(loaded, $handle)?,
                        path_of(text(path, "path")?)?,
                    )
                };
                let file = open(path)?;
                // SAFETY: the header says what the functions do.
                let given = unsafe { FunctionLists::functions(functions) }?;
                let loaded: Result<$Kernel, Error> = given.functions.read(file);
                let loaded = loaded
                    .map_err(|error| Failure::from(error).about(&path.display().to_string()))?;
                let own: fn($Kernel) -> $Own = $own;
                given.keep();
                slot.give(own(loaded));
                Ok(())
            })
        }

        #[doc = concat!("Writes ", $what, " into memory.")]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $to_memory(
            saved: *const $Own,
            bytes: *mut *mut u8,
            byte_count: *mut usize,
        ) -> Status {
            guarded(|| {
                // SAFETY: the header says what is at these addresses.
                let (saved, bytes, byte_count) = unsafe {
                    let bytes = Slot::handle(bytes, "bytes")?;
                    (
                        shared(saved, $handle)?,
                        bytes,
                        Slot::new(byte_count, "byte_count")?,
                    )
                };
                let kernel: fn(&$Own) -> &$Kernel = $kernel;
                let saved = kernel(saved).to_bytes().into_boxed_slice();
                byte_count.put(saved.len());
                bytes.put(Box::into_raw(saved).cast());
                Ok(())
            })
        }

        #[doc = concat!("Reads ", $what, " from memory.")]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $from_memory(
            bytes: *const u8,
            byte_count: usize,
            functions: *const FunctionLists,
            loaded: *mut *mut $Own,
        ) -> Status {
            guarded(|| {
                // SAFETY: the header says what is at these addresses.
                let (slot, bytes) = unsafe {
                    let bytes = Items::new(bytes, byte_count, 0, "bytes")?;
                    (Slot::handle(loaded, $handle)?, bytes)
                };
                // SAFETY: the header says what the functions do.
                let given = unsafe { FunctionLists::functions(functions) }?;
                let loaded: $Kernel = given
                    .functions
                    .from_bytes(bytes.as_slice().unwrap_or_default())?;
                let own: fn($Kernel) -> $Own = $own;
                given.keep();
                slot.give(own(loaded));
                Ok(())
            })
        }
    };
}

saved!(
    "a tree",
    "bvh",
    Bvh,
    Bvh,
    |bvh| bvh,
    |bvh| bvh,
    antumbra_bvh_save,
    antumbra_bvh_load,
    antumbra_bvh_to_memory,
    antumbra_bvh_from_memory
);
saved!(
    "an object",
    "object",
    OwnObject,
    Object,
    |object| &object.object,
    |object| OwnObject {
        object,
        masks: Vec::new()
    },
    antumbra_object_save,
    antumbra_object_load,
    antumbra_object_to_memory,
    antumbra_object_from_memory
);
saved!(
    "a world",
    "world",
    OwnWorld,
    World,
    |world| &world.world,
    OwnWorld::new,
    antumbra_world_save,
    antumbra_world_load,
    antumbra_world_to_memory,
    antumbra_world_from_memory
);

/// Frees memory that a tree, an object or a world was written to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_memory_free(bytes: *mut u8, byte_count: usize) {
    if !bytes.is_null() {
        let bytes = std::ptr::slice_from_raw_parts_mut(bytes, byte_count);
        // SAFETY: the header says that these are the address and the number that the library returned.
        drop(unsafe { Box::from_raw(bytes) });
    }
}
