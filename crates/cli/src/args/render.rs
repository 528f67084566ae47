//! Flags of `render`.

use std::path::PathBuf;

use antumbra::{Builder, Collapse, Order, Preset};
use antumbra_render::Shard;
use clap::Args;

use super::names::{self, help_one, one_of};
use super::values::{self, Interval, PrefetchChoice, WidthChoice};
use super::{MachineArgs, PictureArgs, SCENE, SCENE_LONG, heading};
use crate::json::Destination;

/// Flags of `render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Image to write; - is the standard output
    ///
    /// If absent: the name that the scene gives its film, or the scene's name, in the current directory, with the
    /// extension .exr if it has none of these. A file of that name is then replaced only if antumbra wrote it. Devices
    /// and pipes get an .exr, and have no checkpoints.
    #[arg(short, long, value_name = "FILE|-", value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Option<PathBuf>,
    /// Replace any file of the scene's own name
    ///
    /// Without --output, the scene decides the name of the image. Files that antumbra did not write are then refused.
    #[arg(long, conflicts_with = "output", help_heading = heading::OUTPUT)]
    pub overwrite: bool,
    /// Standard error of every pixel's mean, as .exr
    ///
    /// For `image compare`. With --shard, the image covers the shard's own pixels; `merge` can write all of them then.
    #[arg(long, value_name = "FILE", value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub stderr_image: Option<PathBuf>,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[arg(
        long,
        value_name = "P",
        value_parser = one_of::<Preset>(names::presets()),
        hide_possible_values = true,
        default_value_t = Preset::default(),
        help_heading = heading::TREE,
        help = "Named recipe of the tree",
        long_help = help_one("Builder, collapse and order by one name", &names::presets(),
            "Other flags choose one of the three apart.")
    )]
    pub preset: Preset,
    #[arg(
        long,
        value_name = "O",
        value_parser = one_of::<Order>(names::orders()),
        hide_possible_values = true,
        help_heading = heading::TREE,
        help = "Child order, see `antumbra list orders`",
        long_help = help_one("Child order of shadow rays", &names::orders(),
            "If absent: what the scene asks for, or that of the preset.")
    )]
    pub order: Option<Order>,
    #[arg(
        long,
        value_name = "B",
        value_parser = one_of::<Builder>(names::builders()),
        hide_possible_values = true,
        help_heading = heading::TREE,
        help = "Builder of the binary tree",
        long_help = help_one("Builder of the binary tree", &names::builders(),
            "Builders that are driven by rays are given the scene's own shadow rays. If absent: that of the preset.")
    )]
    pub builder: Option<Builder>,
    #[arg(
        long,
        value_name = "C",
        value_parser = one_of::<Collapse>(names::collapses()),
        hide_possible_values = true,
        help_heading = heading::TREE,
        help = "Collapse of the binary tree",
        long_help = help_one("How the binary tree is made wide", &names::collapses(),
            "Collapses that learn are given surface rays and the scene's own shadow rays. If absent: that of the preset.")
    )]
    pub collapse: Option<Collapse>,
    #[arg(
        long,
        value_name = "W",
        value_parser = one_of::<WidthChoice>(names::widths()),
        hide_possible_values = true,
        help_heading = heading::TREE,
        help = "Children per node",
        long_help = help_one("Children per node", &names::widths(),
            "auto is what suits the instruction set. If absent: what the scene asks for, or auto.")
    )]
    pub width: Option<WidthChoice>,
    /// Prefetching of nodes: auto, on, off
    ///
    /// Leaves are prefetched, too. auto is what is faster on the training rays. Where nothing is learned, auto is on.
    #[arg(long, value_name = "P", default_value = "auto", help_heading = heading::TREE)]
    pub prefetch: PrefetchChoice,
    /// File for the training rays of this rendering
    ///
    /// The file is written as soon as they are known. --load-order reads it.
    #[arg(long, value_name = "FILE", help_heading = heading::LEARNING)]
    pub save_order: Option<PathBuf>,
    /// Training rays of an earlier rendering
    ///
    /// A file that --save-order wrote: nothing is traced to learn then. Order, width and camera may differ, but the
    /// geometry must be the same.
    #[arg(long, value_name = "FILE", help_heading = heading::LEARNING)]
    pub load_order: Option<PathBuf>,
    /// Go on from the checkpoint: the default
    ///
    /// The image gets the same bits as without the interruption. Without a checkpoint the rendering starts afresh. A
    /// checkpoint of another picture is refused.
    #[arg(long, help_heading = heading::CHECKPOINTS)]
    pub resume: bool,
    /// Forget the checkpoint beside the image
    ///
    /// The rendering starts afresh, and replaces the checkpoint or part of an earlier one.
    #[arg(long, conflicts_with = "resume", help_heading = heading::CHECKPOINTS)]
    pub restart: bool,
    /// Keep the samples beside the finished image
    ///
    /// Rendering again with a larger --spp then adds samples to them. The image has the bits that all samples at once
    /// give. The file, FILE.checkpoint, takes 26 bytes per pixel, 50 with --stderr-image, and more with another filter
    /// than a box of one pixel.
    #[arg(long, conflicts_with = "shard", help_heading = heading::CHECKPOINTS)]
    pub keep_samples: bool,
    /// Picture so far, with every checkpoint
    ///
    /// The file is a PNG beside the image, FILE.preview.png. An interruption writes one, too. The preview is removed
    /// when the image is complete.
    #[arg(long, help_heading = heading::CHECKPOINTS)]
    pub preview: bool,
    /// Time between checkpoints, as 90s
    ///
    /// Also as 10m or 1h30m. Checkpoints are written beside the image, as FILE.checkpoint. SIGINT and SIGTERM write
    /// one and end the rendering with exit code 75; SIGUSR1 writes one and goes on. The same command continues from the
    /// checkpoint, which is removed when the image is complete.
    #[arg(long, value_name = "T", default_value = "10m", help_heading = heading::CHECKPOINTS)]
    pub checkpoint_every: Interval,
    /// Render one of N shares of the picture to a .part
    ///
    /// I runs from 0 to N - 1. `merge` joins the parts. If --output is absent, the name ends in .I-of-N.part.
    #[arg(long, value_name = "I/N", help_heading = heading::CHECKPOINTS)]
    pub shard: Option<Shard>,
    #[command(flatten)]
    pub machine: MachineArgs,
}
