//! Flags that several commands have.

use std::num::NonZeroUsize;

use antumbra::Isa;
use antumbra_load::IntegratorKind;
use clap::Args;
use clap::builder::RangedU64ValueParser;

use super::heading;
use super::names::{self, help_one, one_of};
use super::values::{LevelChoice, Resolution};
use crate::exit::Failure;

/// Flags that decide the picture.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::PICTURE)]
pub struct PictureArgs {
    /// Samples per pixel [default: the scene's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: Option<u32>,
    /// Size of the full picture [default: the scene's]
    #[arg(long, value_name = "WxH")]
    pub resolution: Option<Resolution>,
    /// Integrator, by pbrt's name [default: the scene's]
    ///
    /// Integrator: path, directlighting or ambientocclusion. If the scene asks for the same, its settings are kept;
    /// otherwise they are pbrt-v3's defaults.
    #[arg(long, value_name = "I", value_parser = one_of::<IntegratorKind>(integrators()), hide_possible_values = true)]
    pub integrator: Option<IntegratorKind>,
    /// Shadow rays per camera ray, or samples per light
    ///
    /// Shadow rays per camera ray of ambientocclusion, or samples of each light of directlighting. Lights without a
    /// size are asked by one ray. Refused for path, which asks one light once at every vertex.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub samples: Option<u32>,
    /// Seed of all random values
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
}

fn integrators() -> Vec<String> {
    let names = IntegratorKind::ALL.iter().map(|kind| kind.name());
    names.map(str::to_owned).collect()
}

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
        help = "Instruction set, see `antumbra list levels`",
        long_help = help_one("Instruction set", &names::levels(), "auto is the best of this CPU. Never changes the picture.")
    )]
    pub level: LevelChoice,
    /// Number of threads [default: all CPUs]
    ///
    /// Number of threads; all CPUs if absent. Never changes the picture.
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<u16>::new().range(1..=1024))]
    pub threads: Option<u16>,
}

impl MachineArgs {
    /// The instruction set asked for, checked against this CPU.
    pub fn isa(&self) -> Result<Isa, Failure> {
        self.level.isa()
    }

    /// Starts the threads asked for. Everything parallel uses them from then on.
    pub fn start_threads(&self) -> Result<(), Failure> {
        start_threads(self.threads.and_then(|n| NonZeroUsize::new(n.into())))
    }
}

/// Starts this many threads, or one per CPU.
pub fn start_threads(threads: Option<NonZeroUsize>) -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.map_or(0, NonZeroUsize::get))
        .build_global()
        .map_err(|source| Failure::Work(format!("cannot start the threads: {source}")))
}
