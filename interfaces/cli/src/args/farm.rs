//! Flags of `farm`.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand};

use super::{heading, scene_of_all};
use crate::bake::BakeCommand;

/// Commands of `farm`.
#[derive(Debug, Subcommand)]
pub enum FarmCommand {
    /// Submit an array job of Slurm, and a job that merges
    ///
    /// Makes a plan in the folder, or takes one that `plan` has made. Each of its levels is an array job that waits for the one before,
    /// and a last job merges. Tasks that are preempted, lose their machine or come near their time limit go on from their checkpoints,
    /// or begin again if they are tiles. The last job submits again what is missing. So does this command when it is given again.
    /// Prints the numbers of the jobs.
    Slurm(SlurmArgs),
    /// Write a template by the Open Job Description
    ///
    /// For AWS Deadline Cloud and others; `openjd run` runs it here. Scene, Output, Folder and Program are parameters
    /// of the job. Paths inside the template's directory have defaults.
    Openjd(OpenjdArgs),
}

/// Commands that many machines can share.
fn jobs() -> Vec<&'static str> {
    [&["render"], BakeCommand::NAMES].concat()
}

/// Flags of everything that renders on many machines.
#[derive(Debug, Args)]
pub struct FarmArgs {
    #[arg(help = "Scene file, builtin:NAME[:TRIANGLES], or a plan", long_help = scene_of_all("For slurm a plan, of which all tasks that are not done are submitted, or an index of height rasters"))]
    pub scene: PathBuf,
    /// File to write: an image, or a result of the job
    ///
    /// May be given several times for all jobs but render and ao.
    #[arg(short, long, value_name = "FILE", required = true, help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Lines of sight, for visible
    ///
    /// As --lines of visible: a .csv of pairs, or a .ply of edges. The last task writes them.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    pub lines: Option<PathBuf>,
    #[arg(long = "command", help = format!("{} [default: render]", BakeCommand::NAMES.join(", ")), value_name = "COMMAND", value_parser = PossibleValuesParser::new(jobs()), hide_possible_values = true, help_heading = heading::JOB)]
    pub job: Option<String>,
    /// Standard error of every pixel's mean, as .exr
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    pub stderr_image: Option<PathBuf>,
    /// Number of parts, each a task [default: 4]
    #[arg(
        long, value_name = "N", help_heading = heading::JOB,
        value_parser = clap::value_parser!(u32).range(1..=100_000)
    )]
    pub tasks: Option<u32>,
    /// Parts, checkpoints, logs [default: FILE.farm]
    ///
    /// Directory of the scripts as well. Every machine must see it.
    #[arg(long, value_name = "DIR", help_heading = heading::JOB)]
    pub folder: Option<PathBuf>,
    /// Program, as the machines find it
    #[arg(long, value_name = "FILE", help_heading = heading::JOB)]
    pub program: Option<PathBuf>,
    /// Arguments of the command for every task
    ///
    /// Behind the scene: for visible, tables of points come first.
    #[arg(last = true, value_name = "FLAGS")]
    pub flags: Vec<String>,
}

/// Flags of `farm slurm`.
#[derive(Debug, Args)]
pub struct SlurmArgs {
    #[command(flatten)]
    pub farm: FarmArgs,
    /// Option of sbatch for all jobs
    ///
    /// As in --sbatch=--partition=night. May be given many times.
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true, help_heading = heading::JOB)]
    pub sbatch: Vec<String>,
    /// Seconds left when a task is requeued
    ///
    /// So long before its time limit a task writes a checkpoint and is queued again.
    #[arg(
        long, value_name = "SECONDS", default_value_t = 120, help_heading = heading::JOB,
        value_parser = clap::value_parser!(u32).range(1..=65535)
    )]
    pub grace: u32,
    /// Most times that a part is submitted
    #[arg(
        long, value_name = "N", default_value_t = 3, help_heading = heading::JOB,
        value_parser = clap::value_parser!(u32).range(1..=1000)
    )]
    pub attempts: u32,
    /// Print scripts and commands, submit nothing
    ///
    /// Nothing is written either.
    #[arg(long, help_heading = heading::JOB)]
    pub dry_run: bool,
}

/// Flags of `farm openjd`.
#[derive(Debug, Args)]
pub struct OpenjdArgs {
    #[command(flatten)]
    pub farm: FarmArgs,
    /// Template to write [default: standard output]
    #[arg(long, value_name = "FILE", help_heading = heading::JOB)]
    pub template: Option<PathBuf>,
}
