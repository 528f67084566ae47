//! Flags about the machine: instruction set and threads.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering};

use antumbra::Isa;
use clap::Args;
use clap::builder::RangedU64ValueParser;

use super::heading;
use super::names::{self, help_one, one_of};
use super::values::LevelChoice;
use crate::exit::Failure;

/// Flags about the machine.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::MACHINE)]
pub struct MachineArgs {
    #[arg(
        long,
        value_name = "L",
        default_value = names::AUTO,
        value_parser = one_of::<LevelChoice>(names::levels()),
        hide_possible_values = true,
        help = "Instruction set",
        long_help = help_one("Instruction set", &names::levels(), "auto is the best of this CPU. Never changes the picture.")
    )]
    pub level: LevelChoice,
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The flag about threads.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::MACHINE)]
pub struct ThreadArgs {
    /// Number of threads [default: all CPUs]
    ///
    /// Never changes the picture.
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<u16>::new().range(1..=1024))]
    pub threads: Option<u16>,
}

impl ThreadArgs {
    /// Starts the chosen number of threads. Everything parallel uses them from then on.
    pub fn start(&self) -> Result<(), Failure> {
        start_threads(self.threads.and_then(|n| NonZeroUsize::new(n.into())))
    }
}

impl MachineArgs {
    /// The chosen instruction set, checked against this CPU.
    pub fn isa(&self) -> Result<Isa, Failure> {
        self.level.isa()
    }

    /// Starts the chosen number of threads. Everything parallel uses them from then on.
    pub fn start_threads(&self) -> Result<(), Failure> {
        self.threads.start()
    }
}

/// Starts this many threads, or one per CPU. Where some were started before, these go on.
pub fn start_threads(threads: Option<NonZeroUsize>) -> Result<(), Failure> {
    static HAS_THREADS: AtomicBool = AtomicBool::new(false);
    if HAS_THREADS.swap(true, Ordering::Relaxed) {
        return Ok(());
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.map_or(0, NonZeroUsize::get))
        .build_global()
        .map_err(|source| Failure::Work(format!("cannot start the threads: {source}")))
}
