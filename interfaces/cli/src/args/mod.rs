//! Commands and flags, each defined once together with its help.
//!
//! - `render`, `view`, `merge`, `farm`, `study`, `bench`, `info`, `image`, `list`, `man`: the flags of one command each; commands
//!   that bake have theirs in [`bake`](crate::bake)
//! - `camera`: flags about camera, film and light
//! - `picture`, `tree`, `display`, `machine`, `map`, `chunks`: flags that several commands have
//! - `slips`: better words about mistakes
//! - `values`: what flags may be set to;  `names`: names of orders, builders and so on, from the kernel's lists

mod bench;
mod camera;
mod chunks;
mod display;
mod farm;
mod image;
mod info;
mod list;
mod machine;
mod man;
mod map;
mod merge;
mod names;
mod picture;
mod plan;
mod raster;
mod render;
mod sensors;
mod slips;
mod study;
mod times;
mod tree;
pub mod values;
mod view;

use clap::{Parser, Subcommand};

use antumbra_load::MemorySize;

use crate::bake::BakeCommand;
use crate::version;

pub use bench::BenchArgs;
pub use camera::{CameraArgs, PoseArgs};
pub use chunks::ChunkArgs;
pub use display::{AovNames, DisplayArgs, is_for_displays, usual};
pub use farm::{FarmArgs, FarmCommand, OpenjdArgs, SlurmArgs};
pub use image::{CompareArgs, ImageCommand};
pub use info::InfoArgs;
pub use list::{ListArgs, ListName};
pub use machine::{MachineArgs, ThreadArgs, start_threads};
pub use man::{CompletionsArgs, ManArgs};
pub use map::MapArgs;
pub use merge::MergeArgs;
pub use picture::PictureArgs;
pub use plan::{CheckArgs, IndexArgs, PlanArgs, RunArgs};
pub use raster::RasterArgs;
pub use render::{RenderArgs, UntilArgs};
pub use sensors::{NorthArgs, PlaceArgs, UnitArgs, up_axis};
pub use slips::parse;
pub use study::StudyArgs;
pub use times::TimeArgs;
pub use values::{CameraChoice, Resolution};
pub use view::ViewArgs;

/// Headings of groups of flags.
pub mod heading {
    pub const PICTURE: &str = "Picture";
    pub const OUTPUT: &str = "Output";
    pub const CAMERA: &str = "Camera and film";
    pub const LIGHT: &str = "Light";
    pub const TREE: &str = "Tree (never changes the picture)";
    pub const CHECKPOINTS: &str = "Checkpoints and shards";
    pub const MACHINE: &str = "Machine";
    pub const WORK: &str = "Work";
    pub const SENSORS: &str = "Sensors";
    pub const SUN: &str = "Sun and sky";
    pub const JOB: &str = "Job";
    pub const LEARNING: &str = "Learning (never changes the picture)";
}

/// Help of every argument that is a scene.
pub const SCENE: &str = "Scene file, - or builtin:NAME[:TRIANGLES]";
pub const SCENE_LONG: &str = "\
Scene: a .pbrt file, a mesh (.ply, .obj, .stl, .gltf or .glb, with its materials, shown under a clear sky unless it \
has lights), a height raster (.tif, .asc, .npy, .vrt, or a folder of tiles), or a built-in scene as builtin:NAME[:TRIANGLES], such as builtin:city or builtin:city:20000. - reads a \
.pbrt file from the standard input";

/// The same of commands whose scene other machines read, too, so that it is no standard input.
pub fn scene_of_all(first: &str) -> String {
    let scene = SCENE_LONG.split(". -").next().unwrap_or(SCENE_LONG);
    format!("{first}, or any scene that other machines read under its name. {scene}")
}

/// The same of commands that take several rasters.
pub fn rasters_long() -> String {
    format!(
        "{SCENE_LONG}. Height rasters whose cells fall on each other are one scene, such as tiles/*.tif"
    )
}

/// Ray tracing that learns from shadow rays
///
/// Without a command the demonstration runs: it shows a built-in city in sunlight, by its sky and by its sun, times the
/// learned tree, and writes only to antumbra-out/.
#[derive(Debug, Parser)]
#[command(
    name = "antumbra",
    version,
    long_version = version::long(),
    after_help = AFTER_HELP,
    after_long_help = AFTER_LONG_HELP
)]
pub struct Cli {
    /// Command; the demonstration if absent
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Memory limit, such as 8G
    ///
    /// Counts what a scene and its picture take; if absent, all memory of the machine. A scene that needs more is
    /// refused with exit code 65.
    #[arg(long, value_name = "SIZE", global = true, help_heading = heading::MACHINE)]
    pub max_memory: Option<MemorySize>,
    /// Take warnings about files as errors
    ///
    /// If absent, a mesh is read without what its file says wrongly, such as unknown statements and missing materials, and a
    /// warning says so; a .pbrt file with unknown materials is read as by pbrt. With it, they are errors with exit code 65.
    #[arg(long, global = true, help_heading = heading::MACHINE)]
    pub strict: bool,
    /// Leave out what is not supported of .pbrt files
    ///
    /// If absent, a scene with such features is refused with exit code 65. With it, each of them is named in a warning, and the
    /// rest is rendered: materials as matte, shapes, lights and media not at all.
    #[arg(long, global = true, conflicts_with = "strict", help_heading = heading::MACHINE)]
    pub skip_unsupported: bool,
    /// Print only errors
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = heading::MACHINE)]
    pub quiet: bool,
    /// Print more: all notes, the tree, where the time went
    #[arg(short, long, global = true, help_heading = heading::MACHINE)]
    pub verbose: bool,
}

const AFTER_HELP: &str = "\
Example: antumbra render builtin:city -o city.png
More: antumbra COMMAND --help";

const AFTER_LONG_HELP: &str = "\
Example:
  antumbra render builtin:city -o city.png

Exit codes:
  0    done
  1    failed while working, or results that differ
  2    wrong usage
  65   bad scene or file
  75   interrupted, can be resumed
  130  interrupted";

/// A command.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene to an image
    Render(RenderArgs),
    /// Look at a scene in a browser, and move its camera
    ///
    /// Prints the address of a page on this machine, which shows the picture as it comes. Every move of the camera
    /// begins a new picture at once. The tree learns between pictures. The page can show the tests of shadow rays before
    /// and after learning, and save the picture. Nothing is written by itself.
    ///
    /// The page is served only on 127.0.0.1, and its address is secret.
    View(ViewArgs),
    /// Join the parts of a picture or a bake made by `--shard`
    ///
    /// The output has the same bits as if one machine had made it. Of bakes, the mesh and the tables are
    /// read again, under the names that made the parts. Parts that are missing, given twice,
    /// incomplete or of another picture are refused by name.
    Merge(MergeArgs),
    /// Spread a rendering over the machines of a scheduler
    #[command(subcommand)]
    Farm(FarmCommand),
    /// Make height rasters of many files one, by an index
    ///
    /// Then horizon, sun and visible take the index as a scene, and `plan` divides their work into tiles, whose memory does not grow
    /// with the raster, and whose results have the bits of the whole. All cells are read once. Example:
    ///
    /// antumbra index tiles/*.tif -o country.index
    Index(IndexArgs),
    /// Divide a job into tasks that any engine can run
    ///
    /// A plan is text: a line for each task, with its id, what it reads with checksums, the tasks whose results it needs, and estimates of
    /// its seconds and its memory. Of an index, tasks are tiles; of other scenes, shares of the work. Says what all tasks take,
    /// before anything is run. Example:
    ///
    /// antumbra plan country.index -o plan.jsonl sun --cells --from 2025-01-01 --to 2025-12-31 --step 60
    Plan(PlanArgs),
    /// Run a task of a plan, or all
    ///
    /// A task writes a file in the folder of the plan by renaming it, and then a receipt with its checksum. A task that is done is not
    /// run again. Two runs of one task do no harm: both find the same bits, or the second one says that it does not.
    Run(RunArgs),
    /// Say which tasks of a plan are done
    ///
    /// Looks at all receipts and checksums, and prints the ids of tasks that are to be run: they are missing, stale (of another plan or
    /// of other inputs), or disagree with their receipts. The exit code is 1 if there are any.
    Check(CheckArgs),
    /// Compare the work of shadow rays by orders, trees and widths
    ///
    /// Every order is rendered once with the default tree and collapse. Every other tree and collapse is rendered
    /// once with the default order, and the paper's trees with order simple too. The tests of every shadow ray are
    /// counted. With --repeat, everything is rendered again without counting, in turn. All images of a scene must be
    /// the same, bit for bit; otherwise the exit code is 1.
    ///
    /// All other combinations are replayed (see --replay): each of them answers a sample of the rendering's shadow
    /// rays, and as many ambient occlusion rays. The answers must be the same, bit for bit.
    ///
    /// --preset paper makes the paper's Tables 2 and 3: its six orders, 4 and 8 children, the builder of pbrt-v3, paths of
    /// at most 5 scattering events (2 in sanmiguel), the random sampler, 1 sample per pixel and 3 timed renderings. The
    /// paper does not give the cost of a primitive test, so orders are learned with 0.15 and with 1. Flags override these.
    ///
    /// An interrupted study with --out continues when the same command is given again.
    Study(StudyArgs),
    /// Measure rays per second, side by side with Embree
    ///
    /// The rays come from camera paths of up to five bounces: camera rays, shadow rays to the lights, and diffuse
    /// bounces. All engines take turns on one list of rays. Ratios are medians over the rounds.
    ///
    /// Before anything is timed, all answers are compared with a watertight reference, which is compared with brute
    /// force. If an answer of ours is wrong, the exit code is 1.
    ///
    /// Spheres are traced as meshes, instances as instances. Alpha masks are looked up wherever a mesh with one is hit,
    /// by Embree through its filter functions. Close other programs first.
    Bench(BenchArgs),
    #[command(flatten)]
    Bake(BakeCommand),
    /// Describe a scene and its trees
    Info(InfoArgs),
    /// Compare, convert and draw images
    #[command(subcommand)]
    Image(ImageCommand),
    /// List orders, builders, collapses, levels and widths
    List(ListArgs),
    /// Print the completion script of a shell
    ///
    /// For bash: antumbra completions bash > ~/.local/share/bash-completion/completions/antumbra
    Completions(CompletionsArgs),
    /// Print the manual page, in roff
    ///
    /// To read it: antumbra man | man -l -
    Man(ManArgs),
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    /// All commands with their subcommands.
    fn all(command: &mut clap::Command, found: &mut Vec<String>) {
        found.push(command.render_help().to_string());
        for sub in command.get_subcommands_mut() {
            all(sub, found);
        }
    }

    #[test]
    fn short_help_has_a_line_per_flag_below_80_columns() {
        let mut found = Vec::new();
        let mut cli = Cli::command();
        cli.build();
        all(&mut cli, &mut found);
        assert!(found.len() > 15, "{}", found.len());
        let wide: Vec<&str> = found
            .iter()
            .flat_map(|help| help.lines())
            .filter(|line| line.chars().count() >= 80 && !line.starts_with("Usage:"))
            .collect();
        assert!(wide.is_empty(), "{}", wide.join("\n"));
    }
}
