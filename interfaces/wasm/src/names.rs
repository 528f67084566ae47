//! Functions that the script calls. Addresses and counts are numbers of 32 bits; functions that can fail return `FAILED`, and
//! [`error`] says why. Names are exported from WebAssembly only: C has an `error` of its own.

use std::cell::RefCell;
use std::panic;

use antumbra::Ray;
use antumbra::recipe::Preset;

use crate::module::{Module, reserve};

/// Answer of a call that failed: no address and no number of a scene.
const FAILED: usize = usize::MAX;

thread_local! {
    static MODULE: RefCell<Module> = RefCell::default();
    /// Text of a panic, which ends the module.
    static PANIC: RefCell<String> = RefCell::default();
}

fn with<T>(call: impl FnOnce(&mut Module) -> T) -> T {
    MODULE.with(|module| call(&mut module.borrow_mut()))
}

/// Calls a function that can fail, and keeps its text.
fn kept<T>(call: impl FnOnce(&mut Module) -> Result<T, String>) -> Option<T> {
    with(|module| call(module).map_err(|error| module.error = error).ok())
}

/// Address of a list that is made long enough, if there is memory.
fn room<T: Clone>(list: impl FnOnce(&mut Module) -> &mut Vec<T>, count: usize, item: T) -> usize {
    kept(|module| {
        let list = list(module);
        reserve(list, count, item).ok_or("the memory of the module, at most 4 GiB, is full")?;
        Ok(list.as_ptr().addr())
    })
    .unwrap_or(FAILED)
}

/// Begins: texts of panics are kept for [`panic_text`].
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn begin() {
    panic::set_hook(Box::new(|info| {
        PANIC.with(|text| *text.borrow_mut() = info.to_string());
    }));
}

/// Address of `count` coordinates of the next mesh, 3 per vertex.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn positions(count: usize) -> usize {
    room(|module| &mut module.positions, count / 3, [0.0; 3])
}

/// Address of `count` indices of the next mesh, 3 per triangle.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn indices(count: usize) -> usize {
    room(|module| &mut module.indices, count / 3, [0; 3])
}

/// Address of `count` rays, 8 numbers each: origin, near end, direction, far end.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn rays(count: usize) -> usize {
    room(
        |module| &mut module.rays,
        count,
        Ray::new([0.0; 3], [0.0; 3]),
    )
}

/// Keeps the mesh for the next [`build`].
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn add_mesh() {
    with(Module::add_mesh);
}

/// Forgets the meshes that were added.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn drop_meshes() {
    with(Module::drop_meshes);
}

/// Builds a scene over the meshes and the rays to learn from; returns its number. `fast` is 1 for the shortest build.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn build(fast: u32) -> usize {
    let preset = if fast == 1 {
        Preset::Fast
    } else {
        Preset::Default
    };
    kept(|module| module.build(preset)).unwrap_or(FAILED)
}

/// Frees a scene.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn free_scene(scene: usize) {
    with(|module| module.free(scene));
}

/// Learns the child order of a scene again, from the rays.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn relearn(scene: usize) -> usize {
    kept(|module| module.relearn(scene)).map_or(FAILED, |()| 0)
}

/// Answers the rays by occlusion; returns the address of one byte per ray.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn occluded(scene: usize) -> usize {
    kept(|module| {
        module.occluded(scene)?;
        Ok(module.occluded.as_ptr().addr())
    })
    .unwrap_or(FAILED)
}

/// Answers the rays by closest hits; returns the address of the distances. See [`hits`] for the others.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn intersect(scene: usize) -> usize {
    kept(|module| {
        module.intersect(scene)?;
        Ok(module.hits.t.as_ptr().addr())
    })
    .unwrap_or(FAILED)
}

/// Address of a column of the last closest hits: 0 for weights, 1 for triangles, 2 for meshes.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn hits(column: u32) -> usize {
    with(|module| match column {
        0 => module.hits.uv.as_ptr().addr(),
        1 => module.hits.triangle.as_ptr().addr(),
        _ => module.hits.mesh.as_ptr().addr(),
    })
}

/// A figure of a scene: 0 triangles in the tree, 1 triangles dropped, 2 bytes, 3 training rays.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn report(scene: usize, figure: u32) -> f64 {
    kept(|module| {
        let report = module.scene(scene)?.report();
        Ok(match figure {
            0 => report.primitives as f64,
            1 => report.dropped as f64,
            2 => report.bytes as f64,
            _ => report.training_rays as f64,
        })
    })
    .unwrap_or(f64::NAN)
}

/// Address of the text of the last error, or the length of the text in bytes if `of_length` is 1.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn error(of_length: u32) -> usize {
    with(|module| text(&module.error, of_length))
}

/// The text of a panic, as [`error`]. Empty if the memory was full.
#[cfg_attr(target_family = "wasm", unsafe(no_mangle))]
pub extern "C" fn panic_text(of_length: u32) -> usize {
    PANIC.with(|panic| text(&panic.borrow(), of_length))
}

fn text(text: &str, of_length: u32) -> usize {
    if of_length == 1 {
        text.len()
    } else {
        text.as_ptr().addr()
    }
}
