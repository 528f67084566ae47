//! Commands and flags. Each flag is defined here once, together with its help text.
//!
//! - `values`: what flags may be set to

mod values;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use antumbra::{Builder, Collapse, Isa, Order};
use clap::builder::RangedU64ValueParser;
use clap::{Args, Parser, Subcommand};

use crate::exit::Failure;
use crate::json::Destination;

pub use values::{
    Collapses, IntegratorName, LevelChoice, Levels, Orders, Resolution, ThreadCounts, WidthChoice,
    Widths,
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
}

const AFTER_HELP: &str = "\
SCENE is a .pbrt file (version 3), a mesh (.ply, .obj, .gltf or .glb, shown under a clear sky), or
builtin:city.
Exit codes: 0 done, 1 failed while working, 2 wrong usage, 65 bad scene, 130 interrupted.";

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene to an image
    Render(RenderArgs),
    /// Render scenes with several orders and widths and compare the work of their shadow rays
    ///
    /// Every combination is rendered once, counting the tests of every shadow ray, and with --repeat again
    /// without counting, all orders in turn. All images of a scene must be the same, bit for bit; otherwise the exit
    /// code is 1.
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
    /// How the binary tree is made wide: learned, from synthetic rays and the scene's own, or by area
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
    /// Visiting order of shadow rays: simple, ftob, sato, embree, sort-, sort or sort+
    ///
    /// If absent: what the scene asks for, or sort+. Never changes the picture.
    #[arg(long, value_name = "O")]
    pub order: Option<Order>,
    /// Children per node: 4, 8, 16, or auto for what suits the instruction set
    ///
    /// If absent: what the scene asks for, or auto. Never changes the picture.
    #[arg(long, value_name = "W")]
    pub width: Option<WidthChoice>,
    #[command(flatten)]
    pub rendering: RenderingArgs,
    /// Also write the standard error of every pixel's mean, as .exr, for `image compare`
    #[arg(long, value_name = "FILE")]
    pub stderr_image: Option<PathBuf>,
    /// Write the figures of the rendering as JSON to a file, or to the standard output with -
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<Destination>,
}

/// Flags of `study`.
#[derive(Debug, Args)]
pub struct StudyArgs {
    /// The scenes: .pbrt, .ply, .obj, .gltf or .glb files, or builtin:NAME[:TRIANGLES]
    #[arg(required = true, value_name = "SCENE")]
    pub scenes: Vec<PathBuf>,
    /// Visiting orders, separated by commas: simple, ftob, sato, embree, sort-, sort, sort+; or all
    #[arg(long, value_name = "LIST", default_value = "all")]
    pub orders: Orders,
    /// Children per node, separated by commas: 4, 8, 16, auto
    #[arg(long, value_name = "LIST", default_value = "auto")]
    pub widths: Widths,
    #[command(flatten)]
    pub rendering: RenderingArgs,
    /// Render so often again, without counting, for the times; the fastest counts
    ///
    /// Counting takes a few per cent of a rendering, about the same for every order. Without repetitions the
    /// times are those of the rendering that counts.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=1000))]
    pub repeat: u32,
    /// Also write images, heat maps of the tests per shadow ray, study.json and report.md to a directory
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
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
    #[arg(long, value_name = "N", default_value_t = 4000, value_parser = clap::value_parser!(u32).range(..=1 << 26))]
    pub log_rays: u32,
    /// Visiting orders, separated by commas: simple, ftob, sato, embree, sort-, sort, sort+; or all
    #[arg(long, value_name = "LIST", default_value = "sort+")]
    pub orders: Orders,
    /// How binary trees are made wide, separated by commas: area, learned; or all
    ///
    /// Learned collapses learn from the same rays as orders and as many synthetic ones.
    #[arg(long, value_name = "LIST", default_value = "learned")]
    pub collapses: Collapses,
    /// Children per node, separated by commas: 4, 8, 16, auto
    #[arg(long, value_name = "LIST", default_value = "auto")]
    pub widths: Widths,
    /// Builder of the trees that are traced; build times are measured of all
    #[arg(long, value_name = "B", default_value_t = Builder::default())]
    pub builder: Builder,
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
