//! Tells the program what it was built of and by: commit, compiler and target, for `--version` and for the records of
//! benchmarks. Without git, or outside of the project's repository, the commit is unknown.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=RUSTC");
    if let Ok(target) = std::env::var("TARGET") {
        println!("cargo::rustc-env=ANTUMBRA_TARGET={target}");
    }
    if let Some(compiler) = std::env::var_os("RUSTC")
        && let Some(version) = output(&mut Command::new(compiler), &["--version"])
    {
        println!("cargo::rustc-env=ANTUMBRA_COMPILER={version}");
    }
    // Only in the project's own repository: an unpacked release may lie in somebody else's.
    if Path::new("../../.git").exists() {
        if let Some(commit) = output(&mut Command::new("git"), &["rev-parse", "HEAD"]) {
            println!("cargo::rustc-env=ANTUMBRA_COMMIT={commit}");
        }
        // Every commit and checkout writes here.
        let log = ["rev-parse", "--git-path", "logs/HEAD"];
        if let Some(log) = output(&mut Command::new("git"), &log)
            && Path::new(&log).exists()
        {
            println!("cargo::rerun-if-changed={log}");
        }
    }
}

/// The text that a command prints, if it succeeds.
fn output(command: &mut Command, args: &[&str]) -> Option<String> {
    let output = command.args(args).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let text = text.trim();
    (output.status.success() && !text.is_empty()).then(|| text.to_owned())
}
