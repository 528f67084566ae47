//! Reads scenes and prints time and memory: `load SCENE.pbrt ...`.

use std::path::Path;

use antumbra_pbrt::{Options, load};

fn main() {
    for name in std::env::args().skip(1) {
        let loaded = match load(Path::new(&name), &Options::default()) {
            Ok(loaded) => loaded,
            Err(error) => {
                eprintln!("{error}");
                std::process::exit(1);
            }
        };
        let (scene, times) = (loaded.scene, loaded.times);
        println!(
            "{}: {} triangles stored, {} instances; text {:.3} s, meshes {:.3} s, images {:.3} s; {}",
            scene.name,
            scene.stored_triangle_count(),
            scene.instances.len(),
            times.parse.as_secs_f64(),
            times.meshes.as_secs_f64(),
            times.images.as_secs_f64(),
            peak_memory().unwrap_or_default()
        );
    }
}

/// Peak memory of the process, on systems that report it.
fn peak_memory() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    Some(line.split_whitespace().collect::<Vec<_>>().join(" "))
}
