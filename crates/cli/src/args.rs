//! Commands and flags. Each flag is defined here once, together with its help text.
//!
//! - `values`: what flags may be set to

mod values;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use antumbra::{Builder, Collapse, Isa, Order};
use antumbra_render::{Options, RaysFrom, Shard};
use clap::builder::RangedU64ValueParser;
use clap::{Args, Parser, Subcommand};

use crate::exit::Failure;
use crate::json::Destination;
use crate::memory::MemorySize;

pub use values::{
    CameraChoice, Collapses, IntegratorName, Interval, LevelChoice, Levels, LogSize, Orders,
    PrefetchChoice, Resolution, ThreadCounts, Trees, WidthChoice, Widths,
};

/// Ray tracing with learned visiting orders for shadow rays
///
/// Without a command it runs the demonstration: it renders a built-in city with every order, prints a
/// table and writes images, heat maps and a report to `antumbra-out/`.
#[derive(Debug, Parser)]
#[command(name = "antumbra", version, after_help = AFTER_HELP)]
pub struct Cli {
    /// What to do; the demonstration if absent
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Memory that a scene and its picture may take, such as 512M or 8G; what the machine has if absent
    ///
    /// A scene that needs more is refused (exit code 65) instead of being read until the memory is used up.
    #[arg(long, value_name = "SIZE", global = true)]
    pub max_memory: Option<MemorySize>,
}

const AFTER_HELP: &str = "\
SCENE is a .pbrt file (version 3), a mesh (.ply, .obj, .gltf or .glb, shown under a clear sky), or
builtin:city.
Exit codes: 0 done, 1 failed while working, 2 wrong usage, 65 bad scene or file,
75 interrupted and can be resumed, 130 interrupted.";

/// Help of an order.
fn one_order() -> String {
    format!("Visiting order of shadow rays: {}", Order::names())
}

/// More of it.
const ONE_ORDER: &str =
    "\n\nIf absent: what the scene asks for, or joint. Never changes the picture.";

/// Help of several orders.
fn some_orders() -> String {
    let names = Order::names();
    format!("Visiting orders, separated by commas: {names}; or all")
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene to an image
    Render(RenderArgs),
    /// Join the parts of a picture that `render --shard` made to the same bits as if one machine had made it
    ///
    /// Parts that are missing, there twice, not complete or of another picture are refused by name.
    Merge(MergeArgs),
    /// Spread a rendering over the machines of a scheduler
    #[command(subcommand)]
    Farm(FarmCommand),
    /// Render scenes with several orders, widths, trees and collapses and compare the work of their shadow rays
    ///
    /// Every order is rendered once with the default tree and collapse, and every other tree and collapse once with
    /// the default order, counting the tests of every shadow ray, and with --repeat again without counting, all
    /// in turn. All images of a scene must be the same, bit for bit; otherwise the exit code is 1.
    ///
    /// All other combinations are replayed (see --replay): a sample of the rendering's shadow rays, and as many
    /// ambient occlusion rays, are answered by each of them. The answers must be the same bit for bit, from which it
    /// follows that the images would be. A study with --out that was interrupted continues where it stopped when the
    /// same command is given again.
    Study(StudyArgs),
    /// Measure how many rays per second are answered, side by side with Embree
    ///
    /// The rays are those of camera paths of up to five bounces: camera rays, shadow rays to the lights, and
    /// diffuse bounces. All engines take turns on one list of rays; ratios are medians over the rounds. Before
    /// anything is timed, all answers are compared with a watertight reference that is itself compared with
    /// brute force; if an answer of ours is wrong, the exit code is 1.
    ///
    /// Spheres are traced as meshes, instances as instances, and alpha masks are asked wherever a mesh with one is
    /// hit, by Embree through its filter functions. Close other programs first.
    Bench(BenchArgs),
    /// Tell what is in a scene and what its trees look like
    Info(InfoArgs),
    /// Compare, convert and draw images
    #[command(subcommand)]
    Image(ImageCommand),
}

/// Flags of everything that renders.
#[derive(Debug, Args)]
pub struct RenderingArgs {
    /// Samples per pixel, instead of the scene's own number
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: Option<u32>,
    /// Size of the full picture in pixels, instead of the scene's own
    #[arg(long, value_name = "WxH")]
    pub resolution: Option<Resolution>,
    /// What to compute, instead of what the scene asks for: path, directlighting or ambientocclusion
    ///
    /// With the scene's own settings if it asks for the same, otherwise with those that pbrt-v3 has by default.
    #[arg(long, value_name = "I")]
    pub integrator: Option<IntegratorName>,
    /// Shadow rays per camera ray of ambientocclusion, or samples of each light of directlighting
    ///
    /// All lights are asked then, those without a size by one ray as ever. Not for path, which asks one
    /// light once at every vertex.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub samples: Option<u32>,
    /// How the binary tree is made wide: area, sah, or, for synthetic rays and the scene's own, learned or rsc
    ///
    /// Never changes the picture.
    #[arg(long, value_name = "C", default_value_t = Collapse::default())]
    pub collapse: Collapse,
    /// Instruction set: auto (the best of this CPU), scalar, sse41, avx2, avx512 or neon
    ///
    /// Never changes the picture.
    #[arg(long, value_name = "L", default_value = "auto")]
    pub level: LevelChoice,
    /// Number of threads; all CPUs if absent. Never changes the picture
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<u16>::new().range(1..=1024))]
    pub threads: Option<u16>,
    /// Seed of all random values
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
}

impl RenderingArgs {
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

/// Flags of `render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// The scene: a .pbrt, .ply, .obj, .gltf or .glb file, or builtin:NAME[:TRIANGLES]
    pub scene: PathBuf,
    /// Where to write the image, .exr or .png
    ///
    /// If absent: the name that the scene gives its film, or the scene's name, in the current directory,
    /// with the extension .exr if it has none of these.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    #[arg(long, value_name = "O", help = one_order(), long_help = one_order() + ONE_ORDER)]
    pub order: Option<Order>,
    /// Children per node: 4, 8, 16, or auto for what suits the instruction set
    ///
    /// If absent: what the scene asks for, or auto. Never changes the picture.
    #[arg(long, value_name = "W")]
    pub width: Option<WidthChoice>,
    /// Builder of the tree: binned-sah, reinsertion, ploc, ploc-reinsertion, sbvh, or, driven by the scene's own
    /// shadow rays, rdh, srdh, vdbvh
    ///
    /// Never changes the picture.
    #[arg(long, value_name = "B", default_value_t = Options::default().builder)]
    pub builder: Builder,
    /// Fetch nodes and leaves before their turn: on, off, or auto for what is faster on the rays learned from
    ///
    /// Never changes the picture. Where nothing is learned, auto is on.
    #[arg(long, value_name = "P", default_value = "auto")]
    pub prefetch: PrefetchChoice,
    #[command(flatten)]
    pub rendering: RenderingArgs,
    /// Also write the standard error of every pixel's mean, as .exr, for `image compare`
    ///
    /// With --shard that of the shard's own pixels; `merge` can write all of them then.
    #[arg(long, value_name = "FILE")]
    pub stderr_image: Option<PathBuf>,
    /// How often a checkpoint is written beside the image, as FILE.checkpoint: 90s, 10m, 1h30m
    ///
    /// It is also written on SIGINT and SIGTERM, which end the rendering with exit code 75, and on SIGUSR1, which does
    /// not; and it goes when the image is complete.
    #[arg(long, value_name = "DURATION", default_value = "10m")]
    pub checkpoint_every: Interval,
    /// Go on from the checkpoint beside the image, to the same bits; start afresh where there is none
    #[arg(long)]
    pub resume: bool,
    /// Render one of N equal shares of the tiles, I from 0 to N - 1, for `merge`: FILE is a .part then
    ///
    /// If FILE is absent, its name ends in .I-of-N.part.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Write what the visiting order is learned from to a file, as soon as it is known
    #[arg(long, value_name = "FILE")]
    pub save_order: Option<PathBuf>,
    /// Learn the visiting order from a file that --save-order wrote, without tracing rays for it
    ///
    /// For any order, width and camera, but for the same geometry. Never changes the picture.
    #[arg(long, value_name = "FILE")]
    pub load_order: Option<PathBuf>,
    /// Write the figures of the rendering as JSON to a file, or to the standard output with -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<Destination>,
}

/// Flags of `merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// All parts of one picture, in any order, as `render --shard` wrote them
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// Where to write the image, .exr or .png
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Also write the standard error of every pixel's mean, as .exr; the parts must have been rendered with it
    #[arg(long, value_name = "FILE")]
    pub stderr_image: Option<PathBuf>,
    /// Write the figures as JSON to a file, or to the standard output with -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<Destination>,
}

/// Commands of `farm`.
#[derive(Debug, Subcommand)]
pub enum FarmCommand {
    /// Submit an array job of Slurm that renders the parts of an image, and a dependent job that merges them
    ///
    /// Tasks that are preempted, lose their machine or come near their time limit go on from their checkpoints.
    /// The dependent job submits again what is missing; so does this command when it is given again. Prints the
    /// numbers of the jobs.
    Slurm(SlurmArgs),
    /// Write a template by the Open Job Description, for AWS Deadline Cloud and others; `openjd run` runs it here
    ///
    /// Scene, Output, Folder and Program are parameters of the job. Those paths that lie in the template's directory
    /// have defaults.
    Openjd(OpenjdArgs),
}

/// Flags of everything that renders on many machines.
#[derive(Debug, Args)]
pub struct FarmArgs {
    /// The scene: a .pbrt, .ply, .obj, .gltf or .glb file, or builtin:NAME[:TRIANGLES]
    pub scene: PathBuf,
    /// Where to write the image, .exr or .png
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Number of parts, each a task
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub tasks: u32,
    /// Where parts, checkpoints, scripts and logs go: every machine must see it; FILE.farm if absent
    #[arg(long, value_name = "DIR")]
    pub folder: Option<PathBuf>,
    /// Also write the standard error of every pixel's mean, as .exr
    #[arg(long, value_name = "FILE")]
    pub stderr_image: Option<PathBuf>,
    /// This program as the machines find it
    #[arg(long, value_name = "FILE")]
    pub program: Option<PathBuf>,
    /// Flags of `render` for every task
    #[arg(last = true, value_name = "RENDER FLAGS")]
    pub flags: Vec<String>,
}

/// Flags of `farm slurm`.
#[derive(Debug, Args)]
pub struct SlurmArgs {
    #[command(flatten)]
    pub farm: FarmArgs,
    /// An option of sbatch for both jobs, as --sbatch=--partition=night; may be given many times
    #[arg(long, value_name = "OPTION", allow_hyphen_values = true)]
    pub sbatch: Vec<String>,
    /// Seconds before its time limit at which a task writes a checkpoint and is queued again
    #[arg(long, value_name = "SECONDS", default_value_t = 120, value_parser = clap::value_parser!(u32).range(1..=65535))]
    pub grace: u32,
    /// How often a part is submitted at most
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub attempts: u32,
    /// Print the scripts and commands, and write and submit nothing
    #[arg(long)]
    pub dry_run: bool,
}

/// Flags of `farm openjd`.
#[derive(Debug, Args)]
pub struct OpenjdArgs {
    #[command(flatten)]
    pub farm: FarmArgs,
    /// Where to write the template, as JSON; the standard output if absent
    #[arg(long, value_name = "FILE")]
    pub template: Option<PathBuf>,
}

/// Flags of `study`.
#[derive(Debug, Args)]
pub struct StudyArgs {
    /// The scenes: .pbrt, .ply, .obj, .gltf or .glb files, or builtin:NAME[:TRIANGLES]
    #[arg(required = true, value_name = "SCENE")]
    pub scenes: Vec<PathBuf>,
    #[arg(long, value_name = "LIST", default_value = "all", help = some_orders())]
    pub orders: Orders,
    /// Children per node, separated by commas: 4, 8, 16, auto
    #[arg(long, value_name = "LIST", default_value = "auto")]
    pub widths: Widths,
    #[command(flatten)]
    pub rendering: RenderingArgs,
    /// Builders of the binary tree, separated by commas, or all; the default one if absent
    ///
    /// The default one, or else the first, is that of the renderings by all orders. Never changes the picture.
    #[arg(long, value_name = "LIST")]
    pub trees: Option<Trees>,
    /// Collapses, separated by commas, or all; that of --collapse if absent
    ///
    /// The default one, or else the first, is that of the renderings by all orders. Never changes the picture.
    #[arg(long, value_name = "LIST", conflicts_with = "collapse")]
    pub collapses: Option<Collapses>,
    /// Answer N shadow rays and N ambient occlusion rays by every combination of order, tree, collapse and width
    ///
    /// None of these rays is learned from. If absent: 100000 if any of --trees, --collapses, --train-camera,
    /// --rays-from and --log-size is given, otherwise none.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(..=1 << 24))]
    pub replay: Option<u32>,
    /// How much is learned from: a share of the shadow rays such as 1%, or a number of rays
    ///
    /// A share is raised to some thousand rays in small pictures, and is no more than 16384 rays where rays are
    /// replayed, 4096 to 16384 by the size of the picture where a collapse is learned. A rendering takes the share of
    /// the samples that has about as many.
    #[arg(long, value_name = "SIZE")]
    pub log_size: Option<LogSize>,
    /// The camera whose rays are learned from in replays: "EX,EY,EZ AX,AY,AZ UX,UY,UZ" (as LookAt) or a scene file
    ///
    /// The test camera if absent. Renderings always learn from their own rays.
    #[arg(long, value_name = "CAMERA")]
    pub train_camera: Option<CameraChoice>,
    /// The camera of the pictures and of the rays that are replayed, likewise; the scene's own if absent
    #[arg(long, value_name = "CAMERA")]
    pub test_camera: Option<CameraChoice>,
    /// What replays learn from: camera, surfaces (synthetic rays), or both as renderings do
    #[arg(long, value_name = "SOURCE", value_parser = values::rays_from)]
    pub rays_from: Option<RaysFrom>,
    /// Render so often again, without counting, for the times; the fastest counts
    ///
    /// Counting takes a few per cent of a rendering, about the same for every order. Without repetitions the
    /// times are those of the rendering that counts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=1000))]
    pub repeat: u32,
    /// Also write report.html, report.md, results.json, results.csv, images and heat maps of the tests per shadow
    /// ray to a directory
    ///
    /// What is finished is kept there at once, in journal.jsonl; the same command continues after it.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Forget what a study has finished in the directory of --out, and begin anew
    #[arg(long, requires = "out")]
    pub restart: bool,
    /// Write the rows as JSON to a file, or to the standard output with -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<Destination>,
}

/// Flags of `bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// The scenes: .pbrt, .ply, .obj, .gltf or .glb files, or builtin:NAME[:TRIANGLES]
    #[arg(value_name = "SCENE", default_value = "builtin:city")]
    pub scenes: Vec<PathBuf>,
    /// Shared library of Embree 4 to compare with; bench/get-embree fetches one
    ///
    /// If absent: what the environment variable ANTUMBRA_EMBREE names. Without Embree there are no ratios.
    #[arg(long, value_name = "LIB")]
    pub embree: Option<PathBuf>,
    /// Rays of each kind; fewer if the scene's paths do not have so many
    #[arg(long, value_name = "N", default_value_t = 131072, value_parser = clap::value_parser!(u32).range(1..=1 << 26))]
    pub rays: u32,
    /// Rays that orders and collapses learn from, half shadow, half diffuse; none of them is timed
    ///
    /// A rendering learns from 4096 to 16384, by the size of the picture; more save a few node tests on most scenes.
    #[arg(long, value_name = "N", default_value_t = 65536, value_parser = clap::value_parser!(u32).range(..=1 << 26))]
    pub log_rays: u32,
    #[arg(long, value_name = "LIST", default_value = "sort+", help = some_orders())]
    pub orders: Orders,
    /// How binary trees are made wide, separated by commas: area, sah, learned, rsc; or all
    ///
    /// The last two learn from the same rays as orders and as many synthetic ones.
    #[arg(long, value_name = "LIST", default_value = "learned")]
    pub collapses: Collapses,
    /// Children per node, separated by commas: 4, 8, 16, auto
    #[arg(long, value_name = "LIST", default_value = "auto")]
    pub widths: Widths,
    /// Builder of the trees that are traced
    ///
    /// One that is driven by rays is given those that orders and collapses learn from, and as many synthetic ones.
    #[arg(long, value_name = "B", default_value_t = Builder::default())]
    pub builder: Builder,
    /// Builders whose build times are measured, beside Embree's, separated by commas; or all
    #[arg(long, value_name = "LIST", default_value = "all")]
    pub builds: Trees,
    /// Have batches of ours fetch nodes and leaves before their turn: on, off, or auto
    ///
    /// Auto is, for each tree, what is faster on the rays that are learned from.
    #[arg(long, value_name = "P", default_value = "auto")]
    pub prefetch: PrefetchChoice,
    /// Instruction sets, separated by commas: auto, scalar, sse41, avx2, avx512, neon
    ///
    /// Embree is made to use the same.
    #[arg(
        long,
        visible_alias = "level",
        value_name = "LIST",
        default_value = "auto"
    )]
    pub levels: Levels,
    /// Numbers of threads, separated by commas; all is one per CPU
    #[arg(long, value_name = "LIST", default_value = "1,all")]
    pub threads: ThreadCounts,
    /// Rounds in which every engine is timed once
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub repeat: u32,
    /// Seed of all random values
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Also write bench.json, bench.md and a chart, bench.svg, to a directory
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write the rows as JSON to a file, or to the standard output with -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<Destination>,
}

/// Flags of `info`.
#[derive(Debug, Args)]
pub struct InfoArgs {
    /// The scene: a .pbrt, .ply, .obj, .gltf or .glb file, or builtin:NAME[:TRIANGLES]
    pub scene: PathBuf,
    /// Builder of the trees; one that is driven by rays is given synthetic ones
    #[arg(long, value_name = "B", default_value_t = Options::default().builder)]
    pub builder: Builder,
    /// Write everything as JSON to a file, or to the standard output with -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<Destination>,
}

/// Commands of `image`.
#[derive(Debug, Subcommand)]
pub enum ImageCommand {
    /// Compare an image with a reference; the exit code is 1 if they differ by more than chance
    ///
    /// Every pixel is tested: z is the difference over the standard error of the difference. An image
    /// without standard errors is taken as exact, so without any the test is for equality up to rounding.
    Compare(CompareArgs),
    /// Convert an image to the format that the extension names
    Convert {
        /// The image to read, .exr
        input: PathBuf,
        /// The image to write, .exr or .png
        output: PathBuf,
    },
    /// Draw the mean of the channels of an image in colours, with a legend
    Heatmap {
        /// The image to read, .exr
        input: PathBuf,
        /// The picture to write, .png
        output: PathBuf,
        /// Values of the coldest and the hottest colour; 0 and the largest value if absent
        #[arg(long, num_args = 2, value_names = ["MIN", "MAX"], allow_negative_numbers = true)]
        range: Option<Vec<f32>>,
    },
}

/// Flags of `image compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// The image
    pub image: PathBuf,
    /// The reference
    pub reference: PathBuf,
    /// Standard errors of the image
    #[arg(long, value_name = "FILE")]
    pub stderr_a: Option<PathBuf>,
    /// Standard errors of the reference
    #[arg(long, value_name = "FILE")]
    pub stderr_b: Option<PathBuf>,
    /// A pixel is beyond the limit when |z| of any channel is above this
    #[arg(long, value_name = "Z", default_value_t = 4.0)]
    pub limit: f64,
    /// The test is passed when at most this share of the pixels, 0 to 1, is beyond the limit
    #[arg(long, value_name = "S", default_value_t = 0.01)]
    pub share: f64,
    /// Relative difference that is put down to rounding
    #[arg(long, value_name = "R", default_value_t = 1e-5)]
    pub rounding: f64,
    /// Write the measures as JSON to a file, or to the standard output with -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<Destination>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
