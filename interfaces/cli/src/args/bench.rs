//! Flags of `bench`.

use std::path::PathBuf;

use antumbra_lab::bench::Options;
use antumbra_trees::{BUILDERS, ORDERS};
use clap::Args;

use super::names::{self, help_list};
use super::tree::{BuilderArgs, CollapsesArgs, PrefetchArgs, PresetArgs, WidthsArgs};
use super::values::{Levels, Orders, ThreadCounts, Trees};
use super::{SCENE, SCENE_LONG, heading};
use crate::json::Destination;

/// Flags of `bench`. The laboratory has the same defaults.
#[derive(Debug, Args)]
pub struct BenchArgs {
    #[arg(value_name = "SCENE", default_value = "builtin:city", help = SCENE, long_help = SCENE_LONG)]
    pub scenes: Vec<PathBuf>,
    /// Directory of bench.json, bench.md, bench.svg
    #[arg(long, value_name = "DIR", help_heading = heading::OUTPUT)]
    pub out: Option<PathBuf>,
    /// Rows as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    #[command(flatten)]
    pub preset: PresetArgs,
    #[arg(
        long = "order",
        alias = "orders",
        value_name = "LIST",
        help_heading = heading::TREE,
        help = "Child orders, see `antumbra list`",
        long_help = help_list("Child orders of shadow rays", &names::all(&ORDERS), "all is every one. If absent: the choice of the preset.")
    )]
    pub orders: Option<Orders>,
    #[command(flatten)]
    pub builder: BuilderArgs,
    #[command(flatten)]
    pub collapses: CollapsesArgs,
    #[command(flatten)]
    pub widths: WidthsArgs,
    #[command(flatten)]
    pub prefetch: PrefetchArgs,
    /// Number of training rays
    ///
    /// Half of them are shadow rays, half are diffuse. Orders and collapses learn from them. None of them is timed. A rendering learns from 4096 to 16384, by the size
    /// of the picture; more save a few node tests on most scenes.
    #[arg(
        long = "training-rays", alias = "log-rays", value_name = "N", default_value_t = Options::default().log_rays as u32,
        help_heading = heading::LEARNING, value_parser = clap::value_parser!(u32).range(..=1 << 26)
    )]
    pub log_rays: u32,
    /// Embree 4, as a shared library
    ///
    /// bench/get-embree fetches one. If absent: what the environment
    /// variable ANTUMBRA_EMBREE names. Without Embree there are no ratios.
    #[arg(long, value_name = "LIB", help_heading = heading::WORK)]
    pub embree: Option<PathBuf>,
    /// Rays of each kind
    ///
    /// Fewer if the scene's paths do not have so many.
    #[arg(
        long, value_name = "N", default_value_t = Options::default().rays as u32,
        help_heading = heading::WORK, value_parser = clap::value_parser!(u32).range(1..=1 << 26)
    )]
    pub rays: u32,
    #[arg(
        long = "build-times",
        alias = "builds",
        value_name = "LIST",
        default_value = "all",
        help_heading = heading::WORK,
        help = "Builders to be timed",
        long_help = help_list("Builders whose build times are measured, beside Embree's", &names::all(&BUILDERS),
            "all is every one.")
    )]
    pub builds: Trees,
    /// Also measure what there is beside plain triangles
    ///
    /// Quads, user geometry, masks, filters, refits and points, on one thread. Scenes with instances are passed over.
    #[arg(long, help_heading = heading::WORK)]
    pub kinds: bool,
    /// Timed rounds of every engine
    #[arg(
        long, value_name = "N", default_value_t = Options::default().repeat as u32,
        help_heading = heading::WORK, value_parser = clap::value_parser!(u32).range(1..=10_000)
    )]
    pub repeat: u32,
    /// Seed of all random values
    #[arg(long, value_name = "N", default_value_t = Options::default().seed, help_heading = heading::WORK)]
    pub seed: u64,
    #[arg(
        long = "level",
        alias = "levels",
        value_name = "LIST",
        default_value = names::AUTO,
        help_heading = heading::MACHINE,
        help = "Instruction sets",
        long_help = help_list("Instruction sets", &names::levels(),
            "auto is the best of this CPU. Embree is made to use the same.")
    )]
    pub levels: Levels,
    /// Numbers of threads, or all
    ///
    /// Separated by commas.
    #[arg(long, value_name = "LIST", default_value = "1,all", help_heading = heading::MACHINE)]
    pub threads: ThreadCounts,
}
