//! A client in C, compiled with all warnings and linked to the shared library.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::Command;

#[test]
fn a_client_in_c_finds_what_it_expects() {
    let own = std::env::current_exe().expect("a test");
    let library = own.with_file_name("libembree4.so");
    assert!(library.exists(), "{} is missing", library.display());
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("door");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c/door.c");
    // Programs look for the soname.
    std::os::unix::fs::symlink(&library, folder.path().join("libembree4.so.4")).expect("a link");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    let compiled = Command::new(compiler)
        .args([
            "-std=gnu11",
            "-pthread",
            "-O1",
            "-Wall",
            "-Wextra",
            "-Werror",
        ])
        .args([&source, &library])
        .arg("-o")
        .arg(&program)
        .arg("-lm")
        .status();
    let Ok(compiled) = compiled else {
        return eprintln!("SKIPPED: no C compiler");
    };
    assert!(compiled.success(), "{} does not compile", source.display());
    let ended = Command::new(&program)
        .env("LD_LIBRARY_PATH", folder.path())
        .output()
        .expect("the program starts");
    let said = String::from_utf8_lossy(&ended.stdout);
    assert!(
        ended.status.success() && said.ends_with("door: ok\n"),
        "{said}"
    );
}
