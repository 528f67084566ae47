//! Atomic replacement: files are written as a whole or not at all.

use std::fs;
use std::io;
use std::path::Path;

use antumbra_image::{Error, Image, Target, Window, atomic_write};

/// Names in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(name).collect();
    names.sort();
    names
}

#[test]
fn writes_and_replaces() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("result.json");
    atomic_write(&path, |file| file.write_all(b"first, and longer")).unwrap();
    atomic_write(&path, |file| write!(file, "second")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"second");
    assert_eq!(names(folder.path()), ["result.json"]);
}

#[test]
fn failure_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("result.json");
    fs::write(&path, "old").unwrap();
    let error = atomic_write(&path, |file| {
        file.write_all(&[0; 100_000])?;
        Err(io::Error::other("the pen broke"))
    });
    let message = error.unwrap_err().to_string();
    assert!(message.contains("result.json") && message.contains("the pen broke"));
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["result.json"]);
}

#[test]
fn a_panic_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("result.json");
    fs::write(&path, "old").unwrap();
    let caught = std::panic::catch_unwind(|| {
        let _never = atomic_write(&path, |_| panic!("on purpose"));
    });
    assert!(caught.is_err());
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["result.json"]);
}

#[test]
fn what_cannot_be_a_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let blocked = folder.path().join("folder.exr");
    fs::create_dir(&blocked).unwrap();
    let image = Image::new(1, 1, Window::full(1, 1), vec![[0.0; 3]]).unwrap();
    for path in [
        blocked.clone(),
        folder.path().join("missing").join("image.exr"),
    ] {
        let error = image.write(&path).unwrap_err();
        assert!(matches!(error, Error::Write { .. }), "{error}");
        assert!(error.to_string().contains(".exr"), "{error}");
    }
    for path in ["", "..", "/"] {
        assert!(atomic_write(path, |_| Ok(())).is_err(), "{path}");
    }
    assert!(blocked.is_dir());
    assert_eq!(names(folder.path()), ["folder.exr"]);
}

#[cfg(unix)]
#[test]
fn links_devices_and_permissions() {
    use std::os::unix::fs::{PermissionsExt, symlink};

    let folder = tempfile::tempdir().unwrap();
    let (path, link) = (folder.path().join("file"), folder.path().join("link"));
    fs::write(&path, "old").unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
    symlink(&path, &link).unwrap();
    atomic_write(&link, |file| file.write_all(b"new")).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read(&path).unwrap(), b"new");
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&path), 0o640);

    // New files get the default permissions.
    let (ordinary, ours) = (folder.path().join("ordinary"), folder.path().join("ours"));
    fs::write(&ordinary, "").unwrap();
    atomic_write(&ours, |_| Ok(())).unwrap();
    assert_eq!(mode(&ours), mode(&ordinary));

    // Devices are written to, also through a link, and stay.
    let null = folder.path().join("null");
    symlink("/dev/null", &null).unwrap();
    for device in [Path::new("/dev/null"), &null] {
        atomic_write(device, |file| file.write_all(b"gone")).unwrap();
    }
    assert!(fs::symlink_metadata(&null).unwrap().is_symlink());
    assert!(!fs::metadata("/dev/null").unwrap().is_file());
    assert!(atomic_write("/dev/full", |file| file.write_all(b"gone")).is_err());
}

#[cfg(unix)]
#[test]
fn links_that_lead_nowhere_make_their_target() {
    use std::os::unix::fs::symlink;

    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("sub")).unwrap();
    symlink("sub/new", at("one")).unwrap();
    symlink("one", at("two")).unwrap();
    atomic_write(at("two"), |file| file.write_all(b"new")).unwrap();
    assert_eq!(fs::read(at("sub/new")).unwrap(), b"new");
    for link in ["one", "two"] {
        assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink());
    }

    symlink("missing/new", at("lost")).unwrap();
    symlink("circle", at("circle")).unwrap();
    for bad in ["lost", "circle"] {
        assert!(Target::check(&at(bad)).is_err(), "{bad}");
        assert!(atomic_write(at(bad), |_| Ok(())).is_err(), "{bad}");
    }
    assert_eq!(
        names(folder.path()),
        ["circle", "lost", "one", "sub", "two"]
    );
}

#[cfg(unix)]
#[test]
fn write_protected_files_are_refused() {
    use std::os::unix::fs::PermissionsExt;

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    fs::write(&path, "old").unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
    for refused in [
        atomic_write(&path, |file| file.write_all(b"new")).is_err(),
        Target::check(&path).is_err(),
    ] {
        assert!(refused);
    }
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["file"]);
}

#[cfg(unix)]
#[test]
fn streams_have_names() {
    for (name, target) in [
        ("/dev/stdout", Target::Stdout),
        ("/dev/stderr", Target::Stderr),
        ("/dev/fd/1", Target::Stdout),
        ("/proc/self/fd/2", Target::Stderr),
        ("/dev/null", Target::Stream("/dev/null".into())),
    ] {
        assert_eq!(Target::of(Path::new(name)).unwrap(), target);
    }
}
