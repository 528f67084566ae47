//! Files to be written: found out early whether they can be.

use std::fs;
use std::path::{Path, PathBuf};

use antumbra_lab::probe;

use crate::exit::Failure;

/// Checks that a file can be put at `path`, long before there is anything to put there.
///
/// Leaves nothing behind. It can still fail later; this only spares people a wait in vain.
pub fn check_file(path: &Path) -> Result<(), Failure> {
    let cannot = |reason: &str| Failure::Work(format!("cannot write {}: {reason}", path.display()));
    if path.file_name().is_none() {
        return Err(cannot("that is not the name of a file"));
    }
    if path.is_dir() {
        return Err(cannot("that is a directory"));
    }
    let directory = directory(path);
    if !directory.is_dir() {
        let reason = format!("there is no directory {}", directory.display());
        return Err(cannot(&reason));
    }
    probe(directory).map_err(|source| cannot(&source.to_string()))
}

/// Checks that so many bytes have room beside `path`, as far as the system tells.
pub fn check_room(path: &Path, bytes: u64) -> Result<(), Failure> {
    match fs4::available_space(directory(path)) {
        Ok(free) if free < bytes => Err(Failure::Work(format!(
            "cannot write {}: it may take {}, and {} are free",
            path.display(),
            megabytes(bytes),
            megabytes(free)
        ))),
        _ => Ok(()),
    }
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

/// Removes what writers of `path` that were killed have left beside it.
pub fn remove_leftovers(path: &Path) {
    let Some(name) = path.file_name() else { return };
    let start = format!(".{}.", name.to_string_lossy());
    let Ok(entries) = fs::read_dir(directory(path)) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        // As `atomic_write` names them, with six letters in between.
        let middle = name
            .strip_prefix(&start)
            .and_then(|rest| rest.strip_suffix(".tmp"));
        if middle.is_some_and(|middle| middle.len() == 6 && !middle.contains('.')) {
            // Whoever cannot remove it has no need to: it is in nobody's way.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// The directory that a file is in.
fn directory(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Checks that no two outputs would be the same file, however they are written.
pub fn check_distinct<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Result<(), Failure> {
    let mut places = Vec::new();
    for path in paths {
        let place = place(path);
        if places.contains(&place) {
            let path = path.display();
            return Err(Failure::Usage(format!("{path} is meant for two outputs")));
        }
        places.push(place);
    }
    Ok(())
}

/// One name for all ways to write a file that may not be there yet: its directory with links and `..`
/// resolved, if there is one. A link in place of the file itself is not followed: outputs replace it.
fn place(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    match (absolute.parent(), absolute.file_name()) {
        (Some(parent), Some(name)) => match parent.canonicalize() {
            Ok(parent) => parent.join(name),
            Err(_) => absolute,
        },
        _ => absolute,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_one_place_however_it_is_written() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir(folder.path().join("sub")).expect("a folder");
        let at = |name: &str| folder.path().join(name);
        for same in ["./a", "sub/../a", ".//a", "sub/.././sub/../a"] {
            let paths = [at("a"), at("b"), at(same)];
            let failure = check_distinct(paths.iter().map(PathBuf::as_path));
            assert!(matches!(failure, Err(Failure::Usage(_))), "{same}");
        }
        for other in ["b", "sub/a", "no/such/../a", ".."] {
            let paths = [at("a"), at(other)];
            let result = check_distinct(paths.iter().map(PathBuf::as_path));
            assert!(result.is_ok(), "{other}");
        }
        let relative = [Path::new("a"), Path::new("./a")];
        assert!(check_distinct(relative).is_err());
    }
}
