//! Programs in C and C++ that are compiled with all warnings, linked with the static library and run: each checks answers
//! and exits with 0 if all is right.
#![cfg(unix)]

mod support;

use std::process::Command;

use support::{Language, PROGRAM_WARNINGS, build, compiles, here, run};

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
fn worlds_refits_and_files() {
    program(Language::C99, "c/worlds.c");
}

#[test]
fn threads_progress_and_cancelling() {
    program(Language::C99, "c/threads.c");
}

#[test]
fn every_mistake_is_an_error() {
    program(Language::C99, "c/errors.c");
}

#[test]
fn the_layer_for_cpp() {
    program(Language::Cpp17, "cpp/layer.cpp");
}
