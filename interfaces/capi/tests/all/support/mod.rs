//! Compilers of C and C++, and the static library that this test was built with.
#![allow(dead_code, reason = "programs run on Unix only")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// Folder of this crate.
pub fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All warnings, as errors.
pub const WARNINGS: &[&str] = &[
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Werror",
    "-Wshadow",
    "-Wconversion",
];

/// Warnings of programs: the warnings of headers, except for conversions.
pub const PROGRAM_WARNINGS: &[&str] = &["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wshadow"];

#[derive(Clone, Copy, PartialEq)]
pub enum Language {
    C99,
    Cpp11,
    Cpp17,
}

impl Language {
    pub fn standard(self) -> &'static str {
        match self {
            Self::C99 => "-std=c99",
            Self::Cpp11 => "-std=c++11",
            Self::Cpp17 => "-std=c++17",
        }
    }

    fn extension(self) -> &'static str {
        match self {
            Self::C99 => "c",
            Self::Cpp11 | Self::Cpp17 => "cpp",
        }
    }
}

/// A compiler of the system: what `CC` or `CXX` say, or `cc` and `c++`. `None`, and a line, if there is none.
pub fn compiler(language: Language) -> Option<String> {
    let (variable, usual) = match language {
        Language::C99 => ("CC", "cc"),
        Language::Cpp11 | Language::Cpp17 => ("CXX", "c++"),
    };
    let name = std::env::var(variable).unwrap_or_else(|_| usual.into());
    let is_there = Command::new(&name).arg("--version").output().is_ok();
    if !is_there {
        println!("skipped: no {language} compiler `{name}`", language = usual);
    }
    is_there.then_some(name)
}

/// Runs a command and returns what it wrote to its standard output.
pub fn run(command: &mut Command) -> String {
    let output = command
        .output()
        .unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(
        output.status.success(),
        "{command:?}\n{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).expect("text")
}

/// The static library, beside the program of this test.
pub fn static_library() -> PathBuf {
    let program = std::env::current_exe().expect("a path");
    let library = program.with_file_name("libantumbra_capi.a");
    assert!(library.exists(), "{} is missing", library.display());
    library
}

/// Compiles a program and links it with the static library. `None` if there is no compiler.
pub fn build(language: Language, source: &Path, program: &Path, flags: &[&str]) -> Option<()> {
    let compiler = compiler(language)?;
    run(Command::new(compiler)
        .arg(language.standard())
        .args(["-O1", "-g"])
        .args(flags)
        .arg("-I")
        .arg(here().join("include"))
        .arg(source)
        .arg(static_library())
        .args(["-lpthread", "-ldl", "-lm"])
        .arg("-o")
        .arg(program));
    Some(())
}

/// Writes a source to a folder and checks that it compiles.
pub fn compiles(language: Language, folder: &Path, name: &str, text: &str) {
    let Some(compiler) = compiler(language) else {
        return;
    };
    let source = folder.join(format!("{name}.{}", language.extension()));
    std::fs::write(&source, text).expect("written");
    run(Command::new(compiler)
        .arg(language.standard())
        .args(WARNINGS)
        .arg("-fsyntax-only")
        .arg("-I")
        .arg(here().join("include"))
        .arg(&source));
}
