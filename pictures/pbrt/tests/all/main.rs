//! Tests of the reader through its public functions.
//!
//! - `accepted`: valid files, and the scene of each
//! - `broken`: broken files, and the place and words of each message
//! - `includes`: includes, cycles and limits
//! - `instances`: objects and instances
//! - `lenses`: cameras with lens systems
//! - `lights`: lights with images
//! - `limits`: scenes that demand too much
//! - `materials`, `textures`: materials, textures and alpha masks
//! - `media`: participating media
//! - `meshes`: meshes in separate files
//! - `mutated`: damaged copies of valid files, which must not crash the reader
//! - `shapes`: smooth shapes
//! - `surfaces`: height fields and rational B-spline surfaces
//! - `shared_scenes`: scenes outside the repository, if they are present

mod accepted;
mod broken;
mod includes;
mod instances;
mod lenses;
mod lights;
mod limits;
mod materials;
mod media;
mod meshes;
mod motion;
mod mutated;
mod shapes;
mod shared_scenes;
mod surfaces;
mod textures;
mod version4;

use std::io::Write;
use std::path::Path;

use antumbra_pbrt::{Diagnostic, Error, Loaded, Options, load, parse};
use antumbra_scene::Scene;
use tempfile::TempDir;

/// Orders that the tests accept in `Accelerator`. What pbrt goes on after are mistakes.
const OPTIONS: Options = Options {
    orders: &["simple", "sort+"],
    max_memory: None,
    origin: glam::DVec3::ZERO,
    skip_unsupported: false,
    only_geometry: false,
    strict: true,
};

/// The warnings and notes about a scene whose mistakes are tolerated, and whose unsupported features are left out.
fn tolerated(text: &str) -> (Scene, Vec<Diagnostic>) {
    let options = Options {
        strict: false,
        skip_unsupported: true,
        ..OPTIONS
    };
    let loaded = parse(text.as_bytes().to_vec(), Path::new("s.pbrt"), &options);
    let loaded = loaded.unwrap_or_else(|error| panic!("{text}\n{error}"));
    (loaded.scene, loaded.notes)
}

/// Reads the first of the given files as a scene, in a folder with all of them.
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

/// Scene of a valid file.
fn scene(text: &str) -> Scene {
    match load_text(text) {
        Ok(loaded) => loaded.scene,
        Err(error) => panic!("the scene should be valid:\n{text}\n{error}"),
    }
}

/// Scene of a valid world block.
fn world(text: &str) -> Scene {
    scene(&format!("WorldBegin\n{text}\nWorldEnd\n"))
}

/// Mistakes of a broken file.
fn complaints(result: Result<Loaded, Error>) -> Vec<Diagnostic> {
    match result {
        Err(Error::Scene(diagnostics)) => diagnostics.as_slice().to_vec(),
        Ok(_) => panic!("there should be mistakes"),
        Err(error) => panic!("not a mistake of the scene: {error}"),
    }
}

/// Folder of the scenes outside the repository, if it is present.
fn shared(path: &str) -> Option<std::path::PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let found = root.join(path);
    if !found.exists() {
        // Not `println!`, whose output is hidden when a test passes.
        let _ = std::io::stderr().write_all(b"skipped: no shared scenes\n");
        return None;
    }
    Some(found)
}
