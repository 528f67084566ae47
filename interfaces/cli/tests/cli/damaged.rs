//! Damaged scenes and meshes: every run ends in time with a picture or with what is wrong, never with half a file.
//!
//! The environment variable `ANTUMBRA_DAMAGED` says how many copies are made; copy number n is the same in every run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use antumbra_image::Image;
use antumbra_testkit::{Rng, mutate};

use crate::support::{Place, files};

/// Copies that are made unless told otherwise.
const COPIES: usize = 24;
const SEED: u64 = 0xda3a_6ed0;
/// Seconds of all threads that a run may take.
const SECONDS: u32 = 10;
/// Folders of scenes with more than this are read with a small mesh in place of each of theirs.
const SMALL_FOLDER: u64 = 4 << 20;
/// Larger meshes on their own are left out.
const SMALL_MESH: u64 = 1 << 20;

const SMALL: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
    property float z\nproperty float u\nproperty float v\nelement face 4\n\
    property list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n0 0 1 1 1\n\
    3 0 1 2\n3 0 1 3\n3 0 2 3\n3 1 2 3\n";

#[test]
fn damaged_files_end_in_a_picture_or_a_complaint() {
    let copies = std::env::var("ANTUMBRA_DAMAGED").ok();
    let copies = copies.map_or(COPIES, |text| text.parse().expect("a number of copies"));
    let (home, originals) = originals();
    let (mut good, mut bad) = (0, 0);
    for copy in 0..copies {
        let mut rng = Rng::new(SEED + copy as u64);
        // Scenes and meshes in turn, each a random one of its kind.
        let of_kind = &originals[copy % originals.len()];
        let original = &of_kind[rng.below(of_kind.len())];
        let bytes = mutate(&fs::read(original).expect("a readable original"), &mut rng);
        let command = if rng.below(4) == 0 { "info" } else { "render" };
        match try_copy(copy, original, &bytes, command) {
            true => good += 1,
            false => bad += 1,
        }
    }
    println!("{copies} copies: {good} were read, {bad} were refused");
    drop(home);
    assert!(
        bad * 4 > copies,
        "{bad} of {copies}: damage is hardly noticed"
    );
}

/// Scenes, and meshes: the shared ones, or small ones in a folder that must live on.
fn originals() -> (Option<Place>, [Vec<PathBuf>; 2]) {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/scenes");
    if !shared.exists() {
        eprintln!("no shared scenes: damaged are copies of a small one");
        let place = Place::with_room();
        let lists = [vec![place.path("room.pbrt")], vec![place.path("thing.ply")]];
        return (Some(place), lists);
    }
    let mut lists = [Vec::new(), Vec::new()];
    let mut folders: Vec<_> = fs::read_dir(shared)
        .expect("a readable folder")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    for folder in folders {
        for name in files(&folder) {
            let path = folder.join(name);
            match path.extension().and_then(|e| e.to_str()) {
                Some("pbrt") => lists[0].push(path),
                Some("ply") if size(&path) <= SMALL_MESH => lists[1].push(path),
                _ => {}
            }
        }
    }
    (None, lists)
}

fn size(path: &Path) -> u64 {
    fs::metadata(path).expect("a file").len()
}

/// Runs the program on a damaged copy; returns whether it was read all the same.
fn try_copy(copy: usize, original: &Path, bytes: &[u8], command: &str) -> bool {
    let place = Place::empty();
    let name = original
        .file_name()
        .expect("a file")
        .to_str()
        .expect("text");
    let folder = original.parent().expect("a folder");
    fs::create_dir(place.path("in")).expect("a folder");
    fs::create_dir(place.path("out")).expect("a folder");
    fs::write(place.path("small.ply"), SMALL).expect("a file");
    fs::write(place.path("in").join(name), bytes).expect("a file");
    if name.ends_with(".pbrt") {
        add_neighbours(&place, folder, name);
    }

    let scene = format!("in/{name}");
    let mut args = vec![command, &scene, "--max-memory", "2G"];
    if command == "render" {
        args.extend(["--resolution", "2x2", "--spp", "1", "-o", "out/picture.exr"]);
    }
    // The shell's limit on CPU time: how busy the machine is does not matter.
    let output = Command::new("sh")
        .args([
            "-c",
            "ulimit -t \"$0\" && exec \"$@\"",
            &SECONDS.to_string(),
        ])
        .arg(env!("CARGO_BIN_EXE_antumbra"))
        .args(&args)
        .current_dir(place.path("."))
        .output()
        .expect("the program starts");
    let said = String::from_utf8_lossy(&output.stderr);
    let what = || {
        let kept = std::env::temp_dir().join(format!("antumbra-damaged-{copy}-{name}"));
        let _ = fs::write(&kept, bytes);
        format!(
            "copy {copy} of {}, kept as {}, {args:?}: {said}",
            original.display(),
            kept.display()
        )
    };
    assert!(
        matches!(output.status.code(), Some(0 | 65)),
        "{:?}: {}",
        output.status,
        what()
    );
    assert!(!said.contains("panicked"), "{}", what());
    let is_read = output.status.success();
    let made = files(&place.path("out"));
    if is_read && command == "render" {
        assert_eq!(made, ["picture.exr"], "{}", what());
        Image::read(place.path("out/picture.exr")).expect("a whole picture");
    } else {
        assert!(made.is_empty(), "{made:?}: {}", what());
        assert!(is_read || said.contains("error"), "{}", what());
    }
    is_read
}

/// Puts what a scene may name beside it: links to the files of its folder, or to a small mesh instead of many.
fn add_neighbours(place: &Place, folder: &Path, name: &str) {
    let names = files(folder);
    let total: u64 = names.iter().map(|name| size(&folder.join(name))).sum();
    for neighbour in names.iter().filter(|neighbour| *neighbour != name) {
        let is_mesh = neighbour.ends_with(".ply");
        let target = match total > SMALL_FOLDER && is_mesh {
            true => place.path("small.ply"),
            false => folder.join(neighbour),
        };
        link(&target, &place.path("in").join(neighbour));
    }
}

#[cfg(unix)]
fn link(target: &Path, path: &Path) {
    std::os::unix::fs::symlink(target, path).expect("a link");
}

#[cfg(not(unix))]
fn link(target: &Path, path: &Path) {
    fs::copy(target, path).expect("a copy");
}
