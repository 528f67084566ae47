//! Flags of `study`.

use std::path::PathBuf;

use antumbra_lab::RaysFrom;
use antumbra_lab::study::LogSize;
use antumbra_trees::{BUILDERS, ORDERS};
use clap::Args;

use super::names::{self, help_list, help_one};
use super::tree::{CollapsesArgs, PresetArgs, WidthsArgs};
use super::values::{self, CameraChoice, Orders, Trees};
use super::{MachineArgs, PictureArgs, SCENE, SCENE_LONG, heading};
use crate::json::Destination;

/// Note on trees and collapses.
const BASE: &str = "The default one, or else the first, renders all orders.";

/// Flags of `study`.
#[derive(Debug, Args)]
pub struct StudyArgs {
    #[arg(required = true, value_name = "SCENE", help = SCENE, long_help = SCENE_LONG)]
    pub scenes: Vec<PathBuf>,
    /// Directory of the report, images and heat maps
    ///
    /// Holds report.html, report.md, results.json, results.csv, images, and heat maps of the tests per shadow ray.
    /// Finished work is kept there at once, in journal.jsonl; the same command continues after it.
    #[arg(long, value_name = "DIR", help_heading = heading::OUTPUT)]
    pub out: Option<PathBuf>,
    /// Go on in the directory of --out: the default
    ///
    /// Work that an interrupted study of the same command has finished there is not done again.
    #[arg(long, requires = "out", conflicts_with = "restart", help_heading = heading::OUTPUT)]
    pub resume: bool,
    /// Begin again in the directory of --out
    ///
    /// Work that an interrupted study has finished there is forgotten.
    #[arg(long, requires = "out", help_heading = heading::OUTPUT)]
    pub restart: bool,
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
        help = "Child orders, see `antumbra list` [all]",
        long_help = help_list("Child orders of shadow rays", &names::all(&ORDERS), "all is every one, and the default but for preset paper, which has the six of the paper.")
    )]
    pub orders: Option<Orders>,
    #[arg(
        long = "builder",
        alias = "trees",
        value_name = "LIST",
        help_heading = heading::TREE,
        help = "Builders of the binary tree, or all",
        long_help = help_list("Builders of the binary tree", &names::all(&BUILDERS), &format!("all is every one. {BASE}"))
    )]
    pub trees: Option<Trees>,
    #[command(flatten)]
    pub collapses: CollapsesArgs,
    #[command(flatten)]
    pub widths: WidthsArgs,
    /// Cost of a primitive test; a node test costs 1
    ///
    /// Orders and collapses learn by it, and combinations are ranked by it.
    #[arg(long, value_name = "C", value_parser = values::cost, help_heading = heading::LEARNING)]
    pub prim_cost: Option<f32>,
    /// Cost of a test of a cut-out, in node tests
    #[arg(long, value_name = "C", value_parser = values::cost, help_heading = heading::LEARNING)]
    pub cutout_cost: Option<f32>,
    /// Cost of entering an instance, in node tests
    #[arg(long, value_name = "C", value_parser = values::cost, help_heading = heading::LEARNING)]
    pub entry_cost: Option<f32>,
    /// Replay N shadow rays by every combination
    ///
    /// As many ambient occlusion rays are replayed, by every combination of order, tree, collapse and width. All of
    /// these rays are held out: none is learned from. If absent: 100000 if any of --builder,
    /// --train-camera, --rays-from and --training-rays is given, or several collapses, otherwise none.
    #[arg(
        long, value_name = "N", help_heading = heading::WORK,
        value_parser = clap::value_parser!(u32).range(..=1 << 24)
    )]
    pub replay: Option<u32>,
    /// Rounds of timing, and pictures rendered apart [0]
    ///
    /// Shadow rays of all trees are timed interleaved, N times and once at least. The whole-picture time of a tree is
    /// composed of its own queries and learning and of the shading that all trees share. With N, whole pictures of the
    /// default and of the paper's unsorted trees are also rendered separately N times, interleaved. Preset paper has 3 unless
    /// flags say otherwise.
    #[arg(
        long, value_name = "N", help_heading = heading::WORK,
        value_parser = clap::value_parser!(u32).range(..=1000)
    )]
    pub repeat: Option<u32>,
    /// Camera of pictures and replayed rays
    ///
    /// "EX,EY,EZ AX,AY,AZ UX,UY,UZ" (as LookAt) or a scene file. If absent: the scene's own.
    #[arg(long, value_name = "CAM", help_heading = heading::WORK)]
    pub test_camera: Option<CameraChoice>,
    /// Number of training rays: 1%, or 4096
    ///
    /// A count, or a percentage of the shadow rays (clamped to 4096..16384).
    #[arg(long = "training-rays", alias = "log-size", value_name = "SIZE", help_heading = heading::LEARNING)]
    pub log_size: Option<LogSize>,
    /// Camera of the training rays of replays
    ///
    /// "EX,EY,EZ AX,AY,AZ UX,UY,UZ" (as LookAt) or a scene file. If absent: the test camera. Renderings always learn
    /// from their own rays.
    #[arg(long, value_name = "CAM", help_heading = heading::LEARNING)]
    pub train_camera: Option<CameraChoice>,
    #[arg(
        long,
        value_name = "FROM",
        value_parser = values::rays_from,
        help_heading = heading::LEARNING,
        help = "Training rays: camera, surfaces, both",
        long_help = help_one("Training rays of replays", &names::named(&RaysFrom::ALL, RaysFrom::name),
            "camera: shadow rays of the camera; surfaces: synthetic rays; both, as renderings do.")
    )]
    pub rays_from: Option<RaysFrom>,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub machine: MachineArgs,
}
