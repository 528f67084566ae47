//! Flags about camera, film and light of a picture, of `render` and `view`; flags of the camera only are also in `ao` and
//! `info`.

use std::path::PathBuf;

use antumbra_load::{Crop, FilterKind, LookAt, SamplerName, Sun, Up};
use clap::Args;

use super::names::{named, one_of};
use super::{heading, values};

/// Flags about the camera: its place, and what part of its picture is wanted.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::CAMERA)]
pub struct PoseArgs {
    /// Camera, as "LookAt ex ey ez ax ay az ux uy uz"
    ///
    /// Eye, point looked at and up vector, as in a .pbrt file. The word LookAt may be left out. The scene's angle
    /// of view stays, see --fov.
    #[arg(long, value_name = "LOOKAT", allow_hyphen_values = true)]
    pub camera: Option<LookAt>,
    /// Angle of view over the shorter side, in degrees
    ///
    /// Refused for scenes whose camera has no perspective.
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true, value_parser = values::angle_of_view)]
    pub fov: Option<f32>,
    /// Axis of a mesh that points up: x, y, z, -x, -y, -z
    ///
    /// Turns the automatic camera, the sun and the sky. By default y. Refused for scenes that bring their own camera.
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub up: Option<Up>,
    /// Part of the picture in pixels, as X,Y,WxH
    ///
    /// X and Y name the upper left corner. The image keeps its place in the whole picture.
    #[arg(long, value_name = "X,Y,WxH", allow_hyphen_values = true)]
    pub crop: Option<Crop>,
}

/// Flags about camera, film and light.
#[derive(Debug, Args)]
#[command(next_help_heading = heading::CAMERA)]
pub struct CameraArgs {
    #[command(flatten)]
    pub pose: PoseArgs,
    /// Most times that light is scattered
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// Filter: box, triangle, gaussian, mitchell, sinc
    ///
    /// With the radius and the constants that pbrt-v3 has by default.
    #[arg(long, value_name = "F", value_parser = one_of::<FilterKind>(named(&FilterKind::ALL, FilterKind::name)), hide_possible_values = true)]
    pub filter: Option<FilterKind>,
    /// Sampler: 02sequence, sobol, halton, maxmindist, random
    #[arg(long, value_name = "S", value_parser = one_of::<SamplerName>(named(&SamplerName::ALL, SamplerName::name)), hide_possible_values = true)]
    pub sampler: Option<SamplerName>,
    /// Image around a mesh: .exr, .hdr or none
    ///
    /// The image is by longitude and latitude: its upper edge is up, and its middle is at -z where y is up, at y where z
    /// is up. The image replaces the sky and, unless --sun is given, the sun. Only for meshes.
    #[arg(long, value_name = "FILE", help_heading = heading::LIGHT)]
    pub environment: Option<PathBuf>,
    /// Sun on meshes: AZIMUTH,ELEVATION[,STRENGTH], none
    ///
    /// Angles in degrees. Azimuth 0 is the direction of the middle of --environment, 90 is right of it. Only for
    /// meshes.
    #[arg(long, value_name = "SUN", allow_hyphen_values = true, help_heading = heading::LIGHT)]
    pub sun: Option<Sun>,
    /// Wide ground just below a mesh
    ///
    /// A matt grey plane below the mesh takes its shadow. Only for meshes.
    #[arg(long, help_heading = heading::LIGHT)]
    pub ground: bool,
}

impl PoseArgs {
    /// The first flag that is given.
    pub fn given(&self) -> Option<&'static str> {
        let flags = [
            ("--camera", self.camera.is_some()),
            ("--fov", self.fov.is_some()),
            ("--up", self.up.is_some()),
            ("--crop", self.crop.is_some()),
        ];
        flags
            .into_iter()
            .find_map(|(flag, given)| given.then_some(flag))
    }
}
