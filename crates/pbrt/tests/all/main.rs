//! Tests of the reader through its public door.
//!
//! - `accepted`: files that are right, and the scene each gives
//! - `broken`: files that are wrong, and the place and words of each complaint
//! - `includes`: includes, cycles and limits
//! - `instances`: objects and where they stand
//! - `lights`: lights with images
//! - `limits`: what asks for more than there may be
//! - `materials`, `textures`: what surfaces are made of
//! - `meshes`: meshes in files of their own
//! - `mutated`: damaged copies of good files never crash the reader
//! - `shapes`: smooth shapes
//! - `shared_scenes`: the scenes kept beside the repository, where they are present

mod accepted;
mod broken;
mod includes;
mod instances;
mod lights;
mod limits;
mod materials;
mod meshes;
mod mutated;
mod shapes;
mod shared_scenes;
mod textures;

use std::io::Write;
use std::path::Path;

use antumbra_pbrt::{Diagnostic, Error, Loaded, Options, load};
use antumbra_scene::Scene;
use tempfile::TempDir;

/// Orders that the tests accept in an accelerator.
const OPTIONS: Options = Options {
    orders: &["simple", "sort+"],
    max_memory: None,
};

/// A folder with the given files; the first one is read as a scene.
fn load_files(files: &[(&str, &[u8])]) -> (TempDir, Result<Loaded, Error>) {
    let folder = TempDir::new().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let result = load(&folder.path().join(files[0].0), &OPTIONS);
    (folder, result)
}

fn load_text(text: &str) -> Result<Loaded, Error> {
    load_files(&[("scene.pbrt", text.as_bytes())]).1
}

/// The scene of a file that must be right.
fn scene(text: &str) -> Scene {
    match load_text(text) {
        Ok(loaded) => loaded.scene,
        Err(error) => panic!("this should be right:\n{text}\n{error}"),
    }
}

/// The scene of a world block that must be right.
fn world(text: &str) -> Scene {
    scene(&format!("WorldBegin\n{text}\nWorldEnd\n"))
}

/// The complaints about a file that must be wrong.
fn complaints(result: Result<Loaded, Error>) -> Vec<Diagnostic> {
    match result {
        Err(Error::Scene(diagnostics)) => diagnostics.as_slice().to_vec(),
        Ok(_) => panic!("there should be mistakes"),
        Err(error) => panic!("not a mistake of the scene: {error}"),
    }
}

/// The scenes kept beside the repository, if they are there.
fn shared(path: &str) -> Option<std::path::PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let found = root.join(path);
    if !found.exists() {
        // Not `println!`, which a passing test keeps to itself.
        let _ = std::io::stderr().write_all(b"skipped: no shared scenes\n");
        return None;
    }
    Some(found)
}
