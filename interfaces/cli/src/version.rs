//! Facts about the program: version, commit, compiler, target and instruction set.

use antumbra::Isa;
use antumbra_lab::{Caller, Machine};

/// Version of the program.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
const UNKNOWN: &str = "unknown";

/// The text after `antumbra ` that `--version` prints.
pub fn long() -> String {
    let commit = option_env!("ANTUMBRA_COMMIT").unwrap_or(UNKNOWN);
    let compiler = option_env!("ANTUMBRA_COMPILER").unwrap_or(UNKNOWN);
    let target = option_env!("ANTUMBRA_TARGET").unwrap_or(UNKNOWN);
    let level = Isa::best().level();
    format!(
        "{VERSION}\ncommit: {commit}\ncompiler: {compiler}\ntarget: {target}\ninstruction set: {level}"
    )
}

/// The program and its command, for the records of experiments.
pub fn caller() -> Caller {
    Caller {
        command_line: std::env::args_os()
            .map(|arg| arg.to_string_lossy().into_owned())
            .collect(),
        compiler: option_env!("ANTUMBRA_COMPILER").map(str::to_owned),
        commit: option_env!("ANTUMBRA_COMMIT").map(str::to_owned),
    }
}

/// The machine, for the records of renderings.
pub fn machine(isa: Isa) -> Machine {
    Machine::new(isa, &caller())
}
