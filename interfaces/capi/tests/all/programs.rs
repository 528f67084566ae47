//! Programs in C and C++ that are compiled with all warnings, linked with the static library and run: each checks answers
//! and exits with 0 if all is right.

use std::process::Command;

use crate::support::{Language, PROGRAM_WARNINGS, build, compiles, here, run};

/// Builds and runs a program of `tests/` with a folder of its own as its argument.
fn program(language: Language, name: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("program");
    let source = here().join("tests").join(name);
    if build(language, &source, &program, PROGRAM_WARNINGS).is_some() {
        let said = run(Command::new(&program).arg(folder.path()));
        assert!(said.ends_with(": ok\n"), "{said}");
    }
}

#[test]
fn headers_compile_as_c99_cpp11_and_cpp17() {
    let folder = tempfile::tempdir().expect("a folder");
    let c = "#include \"antumbra.h\"\n#include \"antumbra.h\"\nint main(void) { return antumbra_version() == NULL; }\n";
    compiles(Language::C99, folder.path(), "c99", c);
    compiles(Language::Cpp11, folder.path(), "cpp11", c);
    compiles(Language::Cpp17, folder.path(), "cpp17", c);
    let cpp = "#include \"antumbra.hpp\"\n#include \"antumbra.hpp\"\nint main() { return 0; }\n";
    compiles(Language::Cpp17, folder.path(), "layer", cpp);
}

#[test]
fn answers_are_those_of_brute_force() {
    program(Language::C99, "c/queries.c");
}

#[test]
fn shapes_masks_and_callbacks() {
    program(Language::C99, "c/shapes.c");
}

#[test]
fn points_and_groups() {
    program(Language::C99, "c/points.c");
}

#[test]
fn height_fields() {
    program(Language::C99, "c/fields.c");
}

#[test]
fn worlds_refits_and_files() {
    program(Language::C99, "c/worlds.c");
}

#[test]
fn threads_progress_and_cancelling() {
    program(Language::C99, "c/threads.c");
}

#[test]
fn no_memory_is_a_status() {
    program(Language::C99, "c/memory.c");
}

#[test]
fn every_mistake_is_an_error() {
    program(Language::C99, "c/errors.c");
}

#[test]
fn random_calls_do_no_harm() {
    program(Language::C99, "c/random.c");
}

#[test]
fn the_layer_for_cpp() {
    program(Language::Cpp17, "cpp/layer.cpp");
}

/// Builds and runs an example of the book, and checks what it prints.
fn example(language: Language, name: &str, expected: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("program");
    let source = here().join("examples").join(name);
    if build(language, &source, &program, PROGRAM_WARNINGS).is_some() {
        let said = run(&mut Command::new(&program));
        for line in expected {
            assert!(said.contains(line), "{said}");
        }
    }
}

#[test]
fn examples_print_what_the_book_says() {
    example(
        Language::C99,
        "first.c",
        &["50 of 100 points are in shadow\n"],
    );
    let lines = [
        "ray 0 hits 0 first, 0 without glass, 3 panes in all, glass: yes\n",
        "ray 1 hits 1 first, 2 without glass, 2 panes in all, glass: yes\n",
        "bad geometry: triangle 0 of geometry 3 uses vertex 1, but there are 1 vertices\n",
    ];
    example(Language::Cpp17, "first.cpp", &lines);
    let mean = "mean ambient occlusion of 40000 vertices, 256 directions: 0.4688\n";
    example(Language::C99, "ambient_occlusion.c", &[mean]);
    let seen = "200 instances, 60 frames: 7035 of 14400 pixels see one, 3225 are lit\n";
    example(Language::Cpp17, "moving_instances.cpp", &[seen]);
}

/// The page shows code of files that these tests run.
#[test]
fn the_page_shows_this_code() {
    let root = here().join("../..");
    let page = std::fs::read_to_string(root.join("docs/src/c.md")).expect("the page");
    let shown = page
        .matches("<!-- bench/snippets interfaces/capi/examples/")
        .count();
    let blocks = page.matches("```c\n").count() + page.matches("```cpp\n").count();
    assert_eq!(shown, blocks, "every block of C and C++ is of an example");
    let known = [
        "first.c",
        "first.cpp",
        "ambient_occlusion.c",
        "moving_instances.cpp",
    ];
    for block in page
        .split("<!-- bench/snippets interfaces/capi/examples/")
        .skip(1)
    {
        let file = block.split([':', ' ']).next().expect("a name");
        assert!(known.contains(&file), "{file} is not run");
    }
}
