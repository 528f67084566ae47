//! Where and how a result was made: what makes figures comparable.

use antumbra::Isa;
use serde::Serialize;

/// The program that runs an experiment, for the records.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Caller {
    /// The command, as it was given.
    pub command_line: Vec<String>,
    /// The compiler that built the program, if known.
    pub compiler: Option<String>,
    /// The commit the program was built of, if known.
    pub commit: Option<String>,
}

/// The part of a JSON document with measured times that says how the document came about.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Machine {
    /// Version of Antumbra.
    pub version: &'static str,
    /// Name of the CPU, if the system reports it.
    pub cpu: Option<String>,
    /// Instruction set of the queries, the first if there are several.
    pub level: String,
    /// Threads that build and trace.
    pub threads: usize,
    /// The command, as it was given.
    pub command_line: Vec<String>,
}

impl Machine {
    /// The machine, now.
    pub fn new(isa: Isa, caller: &Caller) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            cpu: cpu_name(),
            level: isa.level().to_string(),
            threads: rayon::current_num_threads(),
            command_line: caller.command_line.clone(),
        }
    }

    /// One line for people.
    pub fn describe(&self) -> String {
        let cpu = self.cpu.as_deref().unwrap_or("unknown CPU");
        let plural = if self.threads == 1 { "" } else { "s" };
        format!(
            "{cpu}, level {}, {} thread{plural}",
            self.level, self.threads
        )
    }
}

/// The CPU's name, where Linux reports it.
fn cpu_name() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
