//! Writes the generated models with looks into a folder: `cargo run -p antumbra-testkit --example models -- FOLDER`.

use std::path::PathBuf;
use std::{env, fs, io};

use antumbra_testkit::model;

fn main() -> io::Result<()> {
    let folder = PathBuf::from(env::args_os().nth(1).unwrap_or_else(|| ".".into()));
    fs::create_dir_all(&folder)?;
    fs::write(folder.join("model.glb"), model::all_textures())?;
    fs::write(folder.join("balls.glb"), model::balls())?;
    for (name, bytes) in model::obj_with_materials() {
        fs::write(folder.join(name), bytes)?;
    }
    Ok(())
}
