//! What the program tells about itself: `list`, `completions`, `man` and `--version`.

use antumbra::recipe::{Level, Preset};
use antumbra::{Isa, Width};
use antumbra_trees::{BUILDERS, COLLAPSES, ORDERS};

use crate::support::{Place, fields, files};

/// Every list with the names that must be in it.
fn lists() -> [(&'static str, Vec<String>); 6] {
    fn names<T: ToString>(all: &[T]) -> Vec<String> {
        all.iter().map(ToString::to_string).collect()
    }
    [
        ("orders", names(&ORDERS)),
        ("builders", names(&BUILDERS)),
        ("collapses", names(&COLLAPSES)),
        ("levels", names(&Level::ALL)),
        ("presets", names(&Preset::ALL)),
        ("widths", names(&Width::ALL)),
    ]
}

#[test]
fn lists_hold_every_name_of_the_kernel() {
    let place = Place::empty();
    let all = place.run(&["list"]).expect(0).stdout;
    let document = place.run(&["list", "--json", "-"]).expect(0).json();
    assert_eq!(document["schema"], "antumbra.list/1");
    for (list, names) in lists() {
        let text = place.run(&["list", list]).expect(0).stdout;
        assert!(text.starts_with(list), "{text}");
        for name in &names {
            let is_row = |line: &str| line.split_whitespace().next() == Some(name);
            assert!(text.lines().any(is_row), "{name}: {text}");
            assert!(all.lines().any(is_row), "{name}: {all}");
        }
        assert_eq!(text.matches("[default]").count(), 1, "{text}");
        let rows = document[list].as_array().expect("a list");
        let found: Vec<_> = rows.iter().map(|row| row["name"].as_str()).collect();
        let expected: Vec<_> = names.iter().map(|name| Some(name.as_str())).collect();
        assert_eq!(found, expected);
    }
    for row in document["levels"].as_array().expect("a list") {
        let level: Level = row["name"]
            .as_str()
            .expect("a name")
            .parse()
            .expect("known");
        assert_eq!(row["available"], level.is_available());
    }
    place
        .run(&["list", "widths", "--json", "widths.json"])
        .expect(0);
    let mut found = fields(&place.json("widths.json")).join(" ");
    assert_eq!(found, "schema version widths");
    found = place.run(&["list", "colours"]).expect(2).stderr;
    assert!(found.contains("orders"), "{found}");
}

#[test]
fn shells_complete_commands_flags_and_names() {
    let place = Place::empty();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = place.run(&["completions", shell]).expect(0).stdout;
        for word in ["antumbra", "render", "resolution", "completions"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
        assert!(!script.contains('\u{1b}'), "{shell}");
    }
    let script = place.run(&["completions", "bash"]).stdout;
    for name in ["reinsertion", "sort-plus", "learned"] {
        // Names that the shell may choose for a flag; orders have signs of their own.
        let name = if name == "sort-plus" { "sort+" } else { name };
        assert!(script.contains(name), "{name}");
    }
    let unknown = place.run(&["completions", "cmd"]).expect(2);
    assert!(unknown.stderr.contains("fish"), "{}", unknown.stderr);
}

#[test]
fn manual_pages_tell_commands_and_flags() {
    let place = Place::empty();
    let page = place.run(&["man"]).expect(0).stdout;
    assert!(
        page.contains(".TH antumbra 1") && page.contains("render"),
        "{page}"
    );
    let run = place.run(&["man", "--out", "deep/man"]).expect(0);
    let pages = files(&place.path("deep/man"));
    let listed = [
        "antumbra.1",
        "antumbra-render.1",
        "antumbra-farm-slurm.1",
        "antumbra-image-compare.1",
    ];
    for name in listed {
        assert!(pages.iter().any(|page| page == name), "{name}: {pages:?}");
    }
    assert!(
        run.stderr.contains(&format!("{} pages", pages.len())),
        "{}",
        run.stderr
    );
    let text = std::fs::read_to_string(place.path("deep/man/antumbra-render.1")).expect("a page");
    assert!(
        text.contains("resolution") && text.contains("CHECKPOINTS"),
        "{text}"
    );
    for name in pages {
        let page = std::fs::read_to_string(place.path("deep/man").join(&name)).expect("a page");
        assert!(page.contains(".SH NAME"), "{name}");
        // Of every machine the same.
        assert!(!page.contains("instruction set:"), "{name}");
    }
}

#[test]
fn the_version_tells_what_was_built() {
    let place = Place::empty();
    let short = place.run(&["-V"]).expect(0).stdout;
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(short, format!("antumbra {version}\n"));
    let long = place.run(&["--version"]).expect(0).stdout;
    let lines: Vec<&str> = long.lines().collect();
    assert_eq!(lines[0], format!("antumbra {version}"));
    let commit = lines[1].strip_prefix("commit: ").expect("a commit");
    let is_hash = commit.len() == 40 && commit.bytes().all(|byte| byte.is_ascii_hexdigit());
    assert!(is_hash || commit == "unknown", "{long}");
    assert!(lines[2].starts_with("compiler: rustc 1."), "{long}");
    let target = lines[3].strip_prefix("target: ").expect("a target");
    assert!(target.contains(std::env::consts::ARCH), "{long}");
    let level = Isa::best().level();
    assert_eq!(lines[4..], [format!("instruction set: {level}")]);
}
