//! Commands and flags. Each flag is defined here once, together with its help text.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::str::FromStr;

use antumbra::{Builder, Isa, Level, Order, Width};
use antumbra_scene::Film;
use clap::builder::RangedU64ValueParser;
use clap::{Args, Parser, Subcommand};

use crate::exit::Failure;
use crate::json::Destination;

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
    /// Spheres are traced as meshes. Close other programs first.
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
    /// Rays that learned orders learn from, half shadow, half diffuse; none of them is timed
    #[arg(long, value_name = "N", default_value_t = 4000, value_parser = clap::value_parser!(u32).range(..=1 << 26))]
    pub log_rays: u32,
    /// Visiting orders, separated by commas: simple, ftob, sato, embree, sort-, sort, sort+; or all
    #[arg(long, value_name = "LIST", default_value = "sort+")]
    pub orders: Orders,
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

/// An instruction set or the best there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LevelChoice {
    Auto,
    Fixed(Level),
}

impl FromStr for LevelChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            name => name
                .parse()
                .map(Self::Fixed)
                .map_err(|error: antumbra::UnknownLevel| format!("{error} auto")),
        }
    }
}

impl LevelChoice {
    /// The instruction set, checked against this CPU.
    pub fn isa(self) -> Result<Isa, Failure> {
        match self {
            Self::Auto => Ok(Isa::best()),
            Self::Fixed(level) => Isa::new(level).map_err(Failure::usage),
        }
    }
}

/// Several instruction sets, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Levels(pub Vec<LevelChoice>);

impl Levels {
    /// The instruction sets, each once and checked against this CPU.
    pub fn isas(&self) -> Result<Vec<Isa>, Failure> {
        let mut isas: Vec<Isa> = Vec::new();
        for choice in &self.0 {
            let isa = choice.isa()?;
            if isas.iter().all(|other| other.level() != isa.level()) {
                isas.push(isa);
            }
        }
        Ok(isas)
    }
}

impl FromStr for Levels {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        list(text, str::parse).map(Self)
    }
}

/// Several numbers of threads; `None` is one per CPU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ThreadCounts(Vec<Option<NonZeroUsize>>);

impl ThreadCounts {
    /// Most threads that can be asked for.
    const MOST: usize = 1024;

    /// The numbers, each once; `all` is how many threads there are in the current pool.
    pub fn counts(&self) -> Vec<NonZeroUsize> {
        let all = NonZeroUsize::new(rayon::current_num_threads()).unwrap_or(NonZeroUsize::MIN);
        let mut counts = Vec::new();
        for count in &self.0 {
            let count = count.unwrap_or(all);
            if !counts.contains(&count) {
                counts.push(count);
            }
        }
        counts
    }
}

impl FromStr for ThreadCounts {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |name: &str| match name {
            "all" => Ok(None),
            number => match number.parse() {
                Ok(count) if count <= Self::MOST => NonZeroUsize::new(count).map(Some),
                _ => None,
            }
            .ok_or_else(|| format!("`{number}` is not all or a number from 1 to {}", Self::MOST)),
        };
        list(text, parse).map(Self)
    }
}

/// A width or what suits the instruction set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WidthChoice {
    Auto,
    Fixed(Width),
}

impl WidthChoice {
    /// The width on an instruction set.
    pub fn on(self, isa: Isa) -> Width {
        match self {
            Self::Auto => Width::auto(isa.level()),
            Self::Fixed(width) => width,
        }
    }
}

impl FromStr for WidthChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            name => name
                .parse()
                .map(Self::Fixed)
                .map_err(|error: antumbra::UnknownWidth| format!("{error}, auto")),
        }
    }
}

/// Several orders, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Orders(pub Vec<Order>);

impl FromStr for Orders {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "all" {
            return Ok(Self(Order::ALL.to_vec()));
        }
        let parse = |name: &str| {
            name.parse()
                .map_err(|error: antumbra::UnknownOrder| format!("{error}; or all"))
        };
        list(text, parse).map(Self)
    }
}

/// Several widths, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Widths(pub Vec<WidthChoice>);

impl Widths {
    /// The widths on an instruction set, each once: `auto` may be one that is also listed.
    pub fn on(&self, isa: Isa) -> Vec<Width> {
        let mut widths = Vec::new();
        for choice in &self.0 {
            let width = choice.on(isa);
            if !widths.contains(&width) {
                widths.push(width);
            }
        }
        widths
    }
}

impl FromStr for Widths {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        list(text, str::parse).map(Self)
    }
}

/// The parts of a list separated by commas; an error names the part that occurs twice.
fn list<T: PartialEq>(
    text: &str,
    parse: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<T>, String> {
    let mut items = Vec::new();
    for name in text.split(',') {
        let item = parse(name)?;
        if items.contains(&item) {
            return Err(format!("`{name}` is listed twice"));
        }
        items.push(item);
    }
    Ok(items)
}

/// Size of a picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resolution(pub [u32; 2]);

impl FromStr for Resolution {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides = text
            .split_once('x')
            .and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]))
            .ok_or("expected two whole numbers such as 640x360")?;
        let pixels = u64::from(sides[0]) * u64::from(sides[1]);
        if (1..=Film::MAX_PIXELS).contains(&pixels) {
            Ok(Self(sides))
        } else {
            Err(format!(
                "{pixels} pixels are not between 1 and {}",
                Film::MAX_PIXELS
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn lists_hold_each_item_once() {
        assert_eq!("all".parse(), Ok(Orders(Order::ALL.to_vec())));
        assert_eq!(
            "sort-,sort+".parse(),
            Ok(Orders(vec![Order::SortMinus, Order::SortPlus]))
        );
        for bad in ["", "sort,", "sort,sort", "best", "all,sort"] {
            assert!(bad.parse::<Orders>().is_err(), "{bad}");
        }
        for bad in ["", "5", "4,4", "4;8"] {
            assert!(bad.parse::<Widths>().is_err(), "{bad}");
        }
        for bad in ["", "0", "2,2", "1025", "-1", "many", "all,all"] {
            assert!(bad.parse::<ThreadCounts>().is_err(), "{bad}");
        }
        for bad in ["", "mmx", "auto,auto", "avx2;sse41"] {
            assert!(bad.parse::<Levels>().is_err(), "{bad}");
        }
        let threads: ThreadCounts = "3,all,1".parse().expect("a list");
        assert!(
            threads
                .counts()
                .starts_with(&[NonZeroUsize::MIN.saturating_add(2)])
        );
        let levels: Levels = "auto,scalar".parse().expect("a list");
        let isas = levels.isas().expect("scalar code runs everywhere");
        assert_eq!(isas.last().map(|isa| isa.level()), Some(Level::Scalar));
        let widths: Widths = "16,auto,8,4".parse().expect("a list");
        assert_eq!(widths.on(Isa::best()).len(), 3);
    }

    #[test]
    fn resolutions_are_two_numbers() {
        assert_eq!("640x360".parse(), Ok(Resolution([640, 360])));
        for bad in [
            "",
            "640",
            "0x5",
            "5x0",
            "-1x4",
            "1x2x3",
            "99999x99999",
            "axb",
        ] {
            assert!(bad.parse::<Resolution>().is_err(), "{bad}");
        }
    }
}
