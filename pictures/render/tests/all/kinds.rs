//! A kind of material is two files, and a row in two others.

use std::fs;
use std::path::{Path, PathBuf};

/// Sources below a folder.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Files of the product that name a kind which only files of pbrt-v3 can have: who adds the like touches as many.
#[test]
fn a_material_is_two_files_and_two_rows() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let houses = ["pictures", "fields", "interfaces"].map(|house| root.join(house));
    let mut found = Vec::new();
    for house in houses.iter().filter(|house| house.is_dir()) {
        sources(house, &mut found);
    }
    let is_product = |path: &&PathBuf| {
        let path = path.to_string_lossy();
        // By a closed list of words of pbrt-v3, its reader tells one version from the other.
        let others = ["/tests", "/target/", "pbrt/src/version4"];
        others.iter().all(|other| !path.contains(other))
    };
    let names = |path: &&PathBuf| {
        let text = fs::read_to_string(path).expect("a source");
        text.split(|c: char| !c.is_alphanumeric() && c != '_')
            .any(|word| word == "Uber" || word == "uber")
    };
    let mut files: Vec<_> = found.iter().filter(is_product).filter(names).collect();
    files.sort();
    let ends = [
        "render/src/material/kinds/mod.rs",
        "render/src/material/kinds/uber.rs",
        "scene/src/material/mod.rs",
        "scene/src/material/uber.rs",
    ];
    assert_eq!(files.len(), ends.len(), "{files:?}");
    assert!(
        files
            .iter()
            .zip(ends)
            .all(|(file, end)| file.ends_with(end)),
        "{files:?}"
    );
}
