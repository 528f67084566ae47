//! Flags of `render`.

use std::path::PathBuf;

use antumbra_render::Shard;
use clap::Args;

use super::tree::TreeArgs;
use super::values::{self, Interval, Noise};
use super::{
    AovNames, CameraArgs, DisplayArgs, MachineArgs, PictureArgs, SCENE, SCENE_LONG, heading,
};
use crate::json::Destination;

/// Flags that say when a picture is good enough.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::PICTURE)]
pub struct UntilArgs {
    /// Add samples for so long, as 90s, 5m or 1h
    ///
    /// Samples per pixel are doubled while the next step fits into the time, judged by the last one. --spp is the largest
    /// number then. The last step is always finished. Time before an interruption counts. Textures are averaged as for 64
    /// samples per pixel, whatever their number.
    #[arg(long, value_name = "T", conflicts_with_all = ["shard", "keep_samples", "load_order"])]
    pub time: Option<Interval>,
    /// Add samples until so much noise is left, as 1%
    ///
    /// Noise is the standard error of a pixel's mean, averaged over the pixels, relative to the mean of the picture.
    /// Samples are doubled until it is below. --spp is the largest number then. Textures are averaged as with --time.
    #[arg(long, value_name = "P", conflicts_with_all = ["shard", "keep_samples", "load_order"])]
    pub noise: Option<Noise>,
}

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
    /// Picture so far as a PNG, every few seconds
    ///
    /// The file lies beside the image, as FILE.preview.png. An interruption leaves the latest one there. The preview is
    /// removed when the image is complete.
    #[arg(long, help_heading = heading::OUTPUT)]
    pub preview: bool,
    /// Show the picture in tev while it is rendered
    ///
    /// HOST:PORT, or HOST for tev's own port, 14158. Changed parts of the picture are sent
    /// four times a second, by tev's protocol. A viewer that is absent, slow or gone never holds up the rendering. It is
    /// tried again every second.
    #[arg(long, value_name = "ADDR", help_heading = heading::OUTPUT)]
    pub display_server: Option<String>,
    /// Albedo, normals, position, depth in the .exr
    ///
    /// Layers Albedo, N (geometric) and Ns (shading normal), P, Z (depth), Variance and SampleCount, beside the colours.
    /// Layers are means over the first surfaces of up to 64 samples. Normals and positions are in world coordinates.
    #[arg(long, conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub layers: bool,
    /// Names of layers: pbrt or cycles
    #[arg(long, value_name = "NAMES", value_enum, default_value = "pbrt", hide_possible_values = true, help_heading = heading::OUTPUT)]
    pub aov_names: AovNames,
    /// Scene, camera, samples, seed, order in the .exr
    ///
    /// All of these are in the attribute comments, with the version of the program. --layers implies it. Without it, equal
    /// pictures are equal files.
    #[arg(long, conflicts_with = "shard", help_heading = heading::OUTPUT)]
    pub metadata: bool,
    #[command(flatten)]
    pub display: DisplayArgs,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    #[command(flatten)]
    pub picture: PictureArgs,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub until: UntilArgs,
    #[command(flatten)]
    pub tree: TreeArgs,
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
    /// The image gets the same bits as without the interruption. Without a checkpoint the rendering starts again. A
    /// checkpoint of another picture is refused.
    #[arg(long, help_heading = heading::CHECKPOINTS)]
    pub resume: bool,
    /// Forget the checkpoint beside the image
    ///
    /// The rendering starts again, and replaces the checkpoint or part of an earlier one.
    #[arg(long, conflicts_with = "resume", help_heading = heading::CHECKPOINTS)]
    pub restart: bool,
    /// Keep the samples beside the finished image
    ///
    /// Rendering again with a larger --spp then adds samples to them. The image has the bits that all samples at once
    /// give. The file, FILE.checkpoint, takes 26 bytes per pixel, 50 with --stderr-image, and more with another filter
    /// than a box of one pixel.
    #[arg(long, conflicts_with = "shard", help_heading = heading::CHECKPOINTS)]
    pub keep_samples: bool,
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
