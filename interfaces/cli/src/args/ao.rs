//! Flags of `ao`.

use std::path::PathBuf;

use antumbra_bake::AmbientOcclusion;
use clap::{ArgAction, Args};

use super::values::Resolution;
use super::{ChunkArgs, PoseArgs, SCENE, SCENE_LONG, heading, values};
use crate::json::Destination;

/// Flags of `ao`.
#[derive(Debug, Args)]
pub struct AoArgs {
    #[arg(help = SCENE, long_help = SCENE_LONG)]
    pub scene: PathBuf,
    /// Mesh, picture or texture; - is the standard output
    ///
    /// A .ply, .glb or .npz holds a mesh, a .png or .exr a picture or texture. A .ply or .glb has the triangles of all meshes in world space, with normals.
    /// Vertices that are split at creases are in it several times. In a .ply, every vertex has the value
    /// as the float property ao, and as a grey colour of 8 bits; in a .glb, as COLOR_0. A .png or .exr is a picture from the
    /// camera, which frames a mesh without a camera, or with --atlas a texture. A .tif (GeoTIFF), .asc or .npy has the values in
    /// the cells of a scene that is a raster. A shard is a .part.
    #[arg(short, long, value_name = "FILE|-", required = true, num_args = 1, action = ArgAction::Set, value_parser = values::output_file(), help_heading = heading::OUTPUT)]
    pub output: Vec<PathBuf>,
    /// Texture of N x N texels by texture coordinates
    ///
    /// All meshes share one texture, for coordinates from 0 to 1.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16384), help_heading = heading::OUTPUT)]
    pub atlas: Option<u32>,
    /// Texels grown over the seams of a texture
    #[arg(long, value_name = "N", default_value_t = 4, requires = "atlas", value_parser = clap::value_parser!(u32).range(0..=64), help_heading = heading::OUTPUT)]
    pub dilate: u32,
    /// Size of a picture [default: of the scene]
    #[arg(long, value_name = "WxH", conflicts_with = "atlas", help_heading = heading::OUTPUT)]
    pub resolution: Option<Resolution>,
    #[command(flatten)]
    pub pose: PoseArgs,
    /// Figures as JSON; - is the standard output
    #[arg(long, value_name = "FILE|-", help_heading = heading::OUTPUT)]
    pub json: Option<Destination>,
    /// Rays per vertex, texel or pixel
    ///
    /// Powers of two are spread most evenly. Pixels divide them among four points. With --two-sided, each side has as many.
    #[arg(
        long, value_name = "N", default_value_t = AmbientOcclusion::default().samples,
        help_heading = heading::WORK, value_parser = clap::value_parser!(u32).range(1..=1 << 20)
    )]
    pub samples: u32,
    /// Distance up to which surfaces occlude [default: any]
    ///
    /// In units of the scene.
    #[arg(long, value_name = "D", value_parser = values::distance, help_heading = heading::WORK)]
    pub distance: Option<f32>,
    /// Look to both sides, and keep the more open one
    ///
    /// For meshes whose triangles face anywhere.
    #[arg(long, help_heading = heading::WORK)]
    pub two_sided: bool,
    /// Also write the mean direction of the open sky
    ///
    /// In a .ply as the float properties bent_x, bent_y and bent_z, in a .glb as _BENT_NORMAL, of length 1. Pictures and
    /// textures hold it instead of the value: a .exr as it is, a .png by halves around 1/2.
    #[arg(long, help_heading = heading::WORK)]
    pub bent_normals: bool,
    /// Count all parts of the sky alike
    ///
    /// If absent: by the cosine of the angle to the normal, as an even sky lights a matt surface.
    #[arg(long, help_heading = heading::WORK)]
    pub uniform: bool,
    /// Seed of all directions
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = heading::WORK)]
    pub seed: u64,
    #[command(flatten)]
    pub chunks: ChunkArgs,
}
