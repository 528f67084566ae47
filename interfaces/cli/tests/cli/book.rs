//! The pages for readers: their links, the book's summary, and the parts that scripts write.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every text between `open` and `close`.
fn between<'a>(text: &'a str, open: &str, close: &str) -> Vec<&'a str> {
    let parts = text.split(open).skip(1);
    parts
        .filter_map(|part| part.split_once(close))
        .map(|(found, _)| found)
        .collect()
}

/// All Markdown files of a folder and of the folders in it.
fn pages(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            pages(&path, found);
        } else if path.extension().is_some_and(|kind| kind == "md") {
            found.push(path);
        }
    }
}

/// Whether a page has a heading with this anchor, as GitHub and mdBook name anchors.
fn has_anchor(page: &str, anchor: &str) -> bool {
    let prose = page.split("\n```").step_by(2).flat_map(str::lines);
    let headings = prose.filter(|line| line.starts_with('#'));
    let mut names = headings.map(|line| {
        let words = line.trim_start_matches('#').trim().to_lowercase();
        let kept = words
            .chars()
            .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.collect::<String>().replace(' ', "-")
    });
    names.any(|name| name == anchor)
}

#[test]
fn links_lead_to_files_and_headings() {
    let outside = [
        "README.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "ARCHITECTURE.md",
        "bench/performance.md",
        "bench/results.md",
    ];
    let mut all: Vec<_> = outside.map(|name| root().join(name)).into();
    pages(&root().join("docs"), &mut all);
    let book = root().join("docs/src");
    let book = book.canonicalize().expect("the book");
    let mut checked = 0;
    for page in &all {
        let text = std::fs::read_to_string(page).expect("a page");
        let name = page.display();
        assert!(
            !text.contains("{{#"),
            "{name}: GitHub shows no included files"
        );
        for link in between(&text, "](", ")") {
            if link.starts_with("http") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => page.clone(),
                _ => page.parent().expect("a folder").join(file),
            };
            let whole = target.canonicalize();
            let of_book = page.canonicalize().expect("a page").starts_with(&book);
            let leads = whole.is_ok_and(|whole| !of_book || whole.starts_with(&book));
            assert!(leads, "{name} links to {link}");
            if !anchor.is_empty() {
                let there = std::fs::read_to_string(&target).expect("a page");
                assert!(has_anchor(&there, anchor), "{name} links to {link}");
            }
            checked += 1;
        }
    }
    assert!(checked > 100, "{checked} links");
}

#[test]
fn the_summary_lists_every_page_of_the_book() {
    let source = root().join("docs/src");
    let summary = std::fs::read_to_string(source.join("SUMMARY.md")).expect("a summary");
    let listed: Vec<_> = between(&summary, "](", ")")
        .iter()
        .map(|page| source.join(page))
        .collect();
    let mut all = Vec::new();
    pages(&source, &mut all);
    all.retain(|page| !page.ends_with("SUMMARY.md"));
    for page in &all {
        assert!(listed.contains(page), "{}", page.display());
    }
    assert_eq!(
        listed.len(),
        all.len(),
        "a page is listed twice or is missing"
    );
}

/// Pages that are longer than the others may be: evidence, lists that are made from the program.
const LONG: [&str; 8] = [
    "atlas.md",
    "commands/render.md",
    "commands/sun.md",
    "pbrt-support.md",
    "python/reference.md",
    "reliability.md",
    "replication.md",
    "results.md",
];

#[test]
fn pages_have_at_most_1500_words() {
    let source = root().join("docs/src");
    let mut all = Vec::new();
    pages(&source, &mut all);
    for page in all {
        let words = std::fs::read_to_string(&page).expect("a page");
        let words = words.split_whitespace().count();
        let is_long = LONG.iter().any(|name| page == source.join(name));
        assert!(
            is_long || words <= 1500,
            "{}: {words} words",
            page.display()
        );
    }
}

/// Runs a script of `bench/` that compares the pages with what they are made from.
fn check(script: &str, arguments: &[&str]) {
    let mut command = std::process::Command::new("python3");
    command.arg(root().join(script)).args(arguments);
    let Ok(found) = command.arg("--check").output() else {
        eprintln!("SKIPPED: no python3");
        return;
    };
    let message = String::from_utf8_lossy(&found.stderr);
    assert!(found.status.success(), "{message}");
}

#[test]
fn tables_of_the_pages_are_those_of_the_records() {
    check("bench/results", &[]);
}

#[test]
fn code_on_the_pages_is_that_of_tested_files() {
    check("bench/snippets", &[]);
}

#[test]
fn pictures_are_drawn_from_the_tables_of_the_pages() {
    check("bench/pictures", &[]);
}

#[test]
fn the_reference_of_commands_says_what_the_help_says() {
    check("bench/commands", &[env!("CARGO_BIN_EXE_antumbra")]);
}

#[test]
fn types_and_main_functions_of_the_kernel_have_examples() {
    check("bench/examples", &[]);
}

#[test]
fn pages_and_comments_use_the_words_of_the_field() {
    check("bench/words", &[]);
}
