//! Every kind of name becomes a scene, and every mistake an error that names its place.

use std::fs;
use std::path::Path;

use antumbra_load::{Error, MemorySize, Options, load};

const TETRAHEDRON: &str =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n";

fn error(name: &Path) -> Error {
    load(name, &Options::default()).expect_err("no scene")
}

#[test]
fn files_and_names_become_scenes() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("Thing.OBJ");
    fs::write(&path, TETRAHEDRON).expect("a file");
    let loaded = load(&path, &Options::default()).expect("a scene");
    assert_eq!(
        (loaded.scene.name.as_str(), loaded.scene.triangle_count()),
        ("Thing", 4)
    );
    assert!(loaded.times.is_none() && loaded.files.is_empty() && loaded.notes.is_empty());

    let path = folder.path().join("ball.pbrt");
    fs::write(&path, "WorldBegin Shape \"sphere\" WorldEnd").expect("a file");
    let loaded = load(&path, &Options::default()).expect("a scene");
    assert_eq!(loaded.scene.name, "ball");
    assert!(loaded.times.is_some());
    assert_eq!(loaded.files, [path.canonicalize().expect("a file")]);

    let city = load("builtin:city:2000".as_ref(), &Options::default()).expect("a scene");
    assert!(city.scene.triangle_count() > 1000);
}

#[test]
fn mistakes_name_their_place() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("broken.pbrt");
    fs::write(&path, "WorldBegin\n  Shpae \"sphere\"\nWorldEnd\n").expect("a file");
    let found = error(&path);
    assert!(found.names_places());
    let places: Vec<_> = found
        .diagnostics()
        .iter()
        .map(|mistake| (mistake.file.clone(), mistake.line, mistake.column))
        .collect();
    assert_eq!(places, [(path, 2, 3)]);

    let path = folder.path().join("broken.obj");
    fs::write(&path, "v 0 0 0\noops\n").expect("a file");
    let text = error(&path).to_string();
    assert!(text.contains("broken.obj:2:1: error:"), "{text}");

    let missing = error(&folder.path().join("missing.pbrt"));
    assert!(!missing.names_places() && missing.to_string().contains("missing.pbrt"));
    let blend = error("room.blend".as_ref()).to_string();
    assert!(
        blend.contains("`blend`") && blend.contains(".pbrt"),
        "{blend}"
    );
    let moon = error("builtin:moon".as_ref()).to_string();
    assert!(moon.contains("builtin:city"), "{moon}");
}

#[test]
fn a_scene_beyond_the_budget_is_refused() {
    let max_memory = MemorySize::new(1 << 16);
    let refused =
        load("builtin:city:2000".as_ref(), &Options { max_memory }).expect_err("too large");
    assert!(matches!(refused, Error::SceneTooLarge { allowed, .. } if allowed == max_memory));
    assert!(
        refused.to_string().contains("64.0 KiB allowed"),
        "{refused}"
    );
}
