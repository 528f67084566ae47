//! The book in `docs/`: its links and the files it includes are there.

use std::path::{Path, PathBuf};

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

/// What stands between `open` and `close`, everywhere in a text.
fn between<'a>(text: &'a str, open: &str, close: &str) -> Vec<&'a str> {
    let parts = text.split(open).skip(1);
    parts
        .filter_map(|part| part.split_once(close))
        .map(|(found, _)| found)
        .collect()
}

#[test]
fn links_and_included_files_exist() {
    let source = docs().join("src");
    let summary = std::fs::read_to_string(source.join("SUMMARY.md")).expect("a summary");
    let listed = between(&summary, "](", ")");
    assert!(listed.len() > 6);
    let mut checked = 0;
    for entry in std::fs::read_dir(&source).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .expect("a name");
        let is_listed = listed.contains(&name) || name == "SUMMARY.md";
        assert!(is_listed, "{name} is not in the summary");
        let text = std::fs::read_to_string(&path).expect("a page");
        for link in between(&text, "](", ")") {
            if !link.starts_with("http") {
                let file = link.split('#').next().unwrap_or(link);
                assert!(source.join(file).is_file(), "{name} links to {link}");
                checked += 1;
            }
        }
        for include in between(&text, "{{#include ", "}}") {
            let (file, anchor) = include
                .split_once(".rs:")
                .map_or((include.to_owned(), None), |(file, anchor)| {
                    (format!("{file}.rs"), Some(anchor))
                });
            let found = std::fs::read_to_string(source.join(&file));
            let found = found.unwrap_or_else(|_| panic!("{name} includes {file}"));
            if let Some(anchor) = anchor {
                for end in ["ANCHOR", "ANCHOR_END"] {
                    let mark = format!("// {end}: {anchor}\n");
                    assert!(found.contains(&mark), "{name} includes {include}");
                }
            }
            // Links of included pages stand in the folder above; they are whole or none.
            for link in between(&found, "](", ")")
                .iter()
                .filter(|_| file.ends_with(".md"))
            {
                let whole = link.starts_with("http") || link.starts_with('#');
                assert!(
                    whole || docs().join(link).is_file(),
                    "{file} links to {link}"
                );
            }
            checked += 1;
        }
    }
    assert!(checked > 12, "{checked} links and files");
}

/// Every figure of the documents' tables is that of a record.
#[test]
fn tables_of_the_documents_are_those_of_the_records() {
    let script = docs().join("../bench/results");
    let run = std::process::Command::new("python3")
        .arg(script)
        .arg("--check")
        .output();
    let Ok(found) = run else {
        eprintln!("SKIPPED: no python3");
        return;
    };
    let told = String::from_utf8_lossy(&found.stderr);
    assert!(found.status.success(), "{told}");
}
