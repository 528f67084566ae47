//! Trees, objects and worlds in files and in memory.

use std::io::{self, Write};
use std::path::Path;

use antumbra::saved::Saved;
use antumbra::{Bvh, Error};

use crate::arrays::{Handle, Items, Slot};
use crate::build::OwnObject;
use crate::functions::Given;
use crate::interface::{FilePath, functions};
use crate::status::{Failure, Outcome};
use crate::world::OwnWorld;

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

/// Reads what a file holds.
fn read<T: Saved>(path: &Path, given: &Given) -> Outcome<T> {
    let about = |error| Failure::from(error).about(&path.display().to_string());
    let file = antumbra_files::open(path).map_err(|error| about(Error::from(error)))?;
    let read = given.functions.read(file).map_err(about)?;
    given.keep();
    Ok(read)
}

/// Gives memory to the caller, who frees it by `antumbra_memory_free`.
fn give(saved: Vec<u8>, bytes: &Handle<u8>, byte_count: &Slot<usize>) -> Outcome {
    let saved = saved.into_boxed_slice();
    byte_count.put(saved.len());
    bytes.0.put(Box::into_raw(saved).cast());
    Ok(())
}

/// Reads what memory of the caller holds.
///
/// # Safety
/// As of [`Items::new`].
unsafe fn read_memory<T: Saved>(bytes: *const u8, count: usize, given: &Given) -> Outcome<T> {
    // SAFETY: the caller's promise.
    let bytes = unsafe { Items::new(bytes, count, 0, "bytes") }?;
    let read = given
        .functions
        .from_bytes(bytes.as_slice().unwrap_or_default())?;
    given.keep();
    Ok(read)
}

functions! {
    /// Writes a tree, an object or a world into a file. Errors: IO.
    fn antumbra_bvh_save(bvh: &Bvh, path: FilePath<'_>) {
        write_file(path.0, |file| bvh.write(file))
    }

    /// Reads a tree, an object or a world from a file. `functions` may be NULL if the file needs none.
    ///
    /// Errors: IO, UNREADABLE, OTHER_FUNCTIONS.
    fn antumbra_bvh_load(path: FilePath<'_>, functions: Given, bvh: Handle<Bvh>) {
        bvh.give(read(path.0, &functions)?);
        Ok(())
    }

    /// Writes what the save functions write into memory of the library, which antumbra_memory_free() frees.
    fn antumbra_bvh_to_memory(bvh: &Bvh, bytes: Handle<u8>, byte_count: Slot<usize>) {
        give(bvh.to_bytes(), &bytes, &byte_count)
    }

    /// Reads what the functions above wrote, as the load functions do. No byte may be left over.
    fn antumbra_bvh_from_memory(
        bytes: *const u8,
        byte_count: usize,
        functions: Given,
        bvh: Handle<Bvh>,
    ) {
        // SAFETY: the header says what is at this address.
        let read = unsafe { read_memory(bytes, byte_count, &functions) }?;
        bvh.give(read);
        Ok(())
    }

    /// As `antumbra_bvh_save`, of an object.
    fn antumbra_object_save(object: &OwnObject, path: FilePath<'_>) {
        write_file(path.0, |file| object.object.write(file))
    }

    /// As `antumbra_bvh_load`, of an object.
    fn antumbra_object_load(path: FilePath<'_>, functions: Given, object: Handle<OwnObject>) {
        object.give(OwnObject::new(read(path.0, &functions)?));
        Ok(())
    }

    /// As `antumbra_bvh_to_memory`, of an object.
    fn antumbra_object_to_memory(object: &OwnObject, bytes: Handle<u8>, byte_count: Slot<usize>) {
        give(object.object.to_bytes(), &bytes, &byte_count)
    }

    /// As `antumbra_bvh_from_memory`, of an object.
    fn antumbra_object_from_memory(
        bytes: *const u8,
        byte_count: usize,
        functions: Given,
        object: Handle<OwnObject>,
    ) {
        // SAFETY: the header says what is at this address.
        let read = unsafe { read_memory(bytes, byte_count, &functions) }?;
        object.give(OwnObject::new(read));
        Ok(())
    }

    /// As `antumbra_bvh_save`, of a world.
    fn antumbra_world_save(world: &OwnWorld, path: FilePath<'_>) {
        write_file(path.0, |file| world.world.write(file))
    }

    /// As `antumbra_bvh_load`, of a world.
    fn antumbra_world_load(path: FilePath<'_>, functions: Given, world: Handle<OwnWorld>) {
        world.give(OwnWorld::new(read(path.0, &functions)?));
        Ok(())
    }

    /// As `antumbra_bvh_to_memory`, of a world.
    fn antumbra_world_to_memory(world: &OwnWorld, bytes: Handle<u8>, byte_count: Slot<usize>) {
        give(world.world.to_bytes(), &bytes, &byte_count)
    }

    /// As `antumbra_bvh_from_memory`, of a world.
    fn antumbra_world_from_memory(
        bytes: *const u8,
        byte_count: usize,
        functions: Given,
        world: Handle<OwnWorld>,
    ) {
        // SAFETY: the header says what is at this address.
        let read = unsafe { read_memory(bytes, byte_count, &functions) }?;
        world.give(OwnWorld::new(read));
        Ok(())
    }
}

/// Frees memory that one of the functions above returned, with the number of bytes that it returned.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn antumbra_memory_free(bytes: *mut u8, byte_count: usize) {
    if !bytes.is_null() {
        let bytes = std::ptr::slice_from_raw_parts_mut(bytes, byte_count);
        // SAFETY: the header says that these are the address and the number that the library returned.
        drop(unsafe { Box::from_raw(bytes) });
    }
}
