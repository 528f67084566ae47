//! `antumbra ao`: ambient occlusion of vertices, texels or pixels.

use std::path::{Path, PathBuf};

use antumbra::{Bvh, Isa, Recipe};
use antumbra_bake::{
    AmbientOcclusion, Array, Atlas, Entry, Job as _, Learned, OcclusionJob, Openness, ShadedMesh,
    Weighting, inside_edges, learn_when_it_pays, write_glb,
};
use antumbra_image::{Image, Rgb8Image, Window, atomic_write};
use antumbra_lab::{count, thread_seconds};
use antumbra_load::set_resolution;
use antumbra_raster::Quantity;
use clap::{ArgAction, Args};

use super::command::{Bake, Baking, Done, Figure};
use super::files::{self, Format};
use super::ground::Ground;
use super::raster;
use super::view::View;
use crate::args::{ChunkArgs, PoseArgs, Resolution, SCENE, heading, rasters_long, values};
use crate::exit::{Failure, tell};
use crate::json::Destination;
use crate::output::{self, Files, text};
use crate::{interrupt, scenes};

/// Name of the value in files.
const PROPERTY: &str = "ao";

/// Points whose values are computed.
enum Target {
    /// Vertices of the mesh, moved a little into their surfaces.
    Vertices(Vec<[f32; 3]>),
    Texels(Atlas),
    Pixels(View),
}

/// Format of the output, if it can be made.
fn format(args: &AoArgs) -> Result<Format, Failure> {
    let pose = args.pose.given();
    if let (Some(_), Some(flag)) = (args.atlas, pose) {
        return Err(Failure::Usage(format!(
            "{flag} does not go with --atlas: a texture has no camera"
        )));
    }
    let flag = match (args.atlas, args.resolution) {
        (Some(_), _) => Some("--atlas"),
        (None, Some(_)) => Some("--resolution"),
        (None, None) => pose,
    };
    if args.chunks.shard.is_some() {
        return Ok(flag.map_or(Format::Ply, |_| Format::Picture));
    }
    let (path, name) = (&args.output[0], args.output[0].display());
    let known = [
        "ply", "glb", "npz", "png", "exr", "tif", "tiff", "asc", "npy",
    ];
    let sentence = "meshes are written as ply, glb or npz, pictures and textures as png or exr, rasters as tif, asc or npy";
    let format = Format::of(path, &known, sentence)?;
    let reason = match (format, flag) {
        (Format::Raster, _) if !raster::is_raster(&args.scene) || args.bent_normals => {
            format!("{name}: a raster needs a scene that is one, and holds no --bent-normals")
        }
        (Format::Picture, _) | (_, None) => return Ok(format),
        (_, Some(flag)) => format!("{flag} makes a png or exr, not {name}"),
    };
    Err(Failure::Usage(reason))
}

/// Flags of `ao`.
#[derive(Debug, Args)]
pub struct AoArgs {
    #[arg(required = true, help = SCENE, long_help = rasters_long())]
    pub scene: Vec<PathBuf>,
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

impl Baking for AoArgs {
    fn check(&self) -> Result<(), Failure> {
        format(self).map(drop)
    }

    fn is_picture(&self) -> bool {
        true
    }

    fn bake(&self, bake: &Bake<'_>, mut files: Files) -> Result<(), Failure> {
        let (format, output) = (format(self)?, &self.output[0]);
        bake.tell_neighbours(&self.scene);
        let mut ground = bake.ground(&mut files, None)?;
        if let Some(resolution) = self.resolution {
            set_resolution(&mut ground.loaded.scene, resolution.0)?;
        }
        scenes::apply_pose(&mut ground.loaded, &self.pose)?;
        scenes::tell_read(&ground.loaded, self.pose.up);
        ground.split_at_creases()?;
        let target = match (format, self.atlas) {
            (Format::Picture, Some(size)) => Target::Texels(atlas(&ground, size)?),
            (Format::Picture, None) => Target::Pixels(View::new(&ground)?),
            _ => {
                let offset = |point: [f32; 3]| ground.bvh.origin_offset(point);
                Target::Vertices(inside_edges(&ground.mesh, offset))
            }
        };
        let job = job(self, &ground, &target)?;
        let learned = match bake.parts {
            None => learn_when_it_pays(&job, &ground.bvh, learn(&ground, bake.isa), thread_seconds),
            Some(_) => None,
        };
        let own = learned.as_ref().and_then(|(bvh, _)| bvh.as_ref());
        let learned = learned.as_ref().map(|(_, learned)| *learned);
        let done = bake.compute(&job, &ground, own.unwrap_or(&ground.bvh))?;
        if let Some(found) = &done.found {
            let _writing = interrupt::writing();
            match &target {
                Target::Vertices(_) => write_mesh(output, format, &ground, found)?,
                Target::Texels(atlas) => write_atlas(self, atlas, found)?,
                Target::Pixels(view) => {
                    let picture = view.picture(&found.open, &found.bent_normals)?;
                    picture.write(output)?;
                }
            }
        }
        report(self, bake, (&ground, &target), &job, learned, &done)
    }
}

/// Writes the document, and says what was done.
fn report(
    args: &AoArgs,
    bake: &Bake<'_>,
    (ground, target): (&Ground, &Target),
    job: &OcclusionJob,
    learned: Option<Learned>,
    done: &Done<Openness>,
) -> Result<(), Failure> {
    let values = done.found.as_ref().map_or(&[][..], |found| &found.open);
    let known = || values.iter().copied().filter(|value| !value.is_nan());
    let with_value = known().count();
    let without_value = values.len() - with_value;
    let size = job.size();
    let rays = size.rays * with_value as u64;
    let sum: f64 = known().map(f64::from).sum();
    let mean = (with_value > 0).then(|| sum / with_value as f64);
    let (min, max) = (known().reduce(f32::min), known().reduce(f32::max));
    let vertices = ground.mesh.positions.len();
    let figures: &[Figure<'_>] = &[
        ("output", &text(&args.output[0])),
        ("shard", &bake.shard()),
        ("of", &target.name()),
        ("samples", &args.samples),
        (
            "distance",
            &args.distance.filter(|distance| distance.is_finite()),
        ),
        ("two_sided", &args.two_sided),
        ("bent_normals", &args.bent_normals),
        (
            "weighting",
            &if args.uniform { "uniform" } else { "cosine" },
        ),
        ("seed", &args.seed),
        ("vertices", &vertices),
        ("triangles", &ground.mesh.indices.len()),
        ("points", &size.items),
        ("without_value", &without_value),
        ("rays", &rays),
        ("mean", &mean),
        ("min", &min),
        ("max", &max),
        ("load_seconds", &ground.loaded.seconds),
        ("build_seconds", &ground.build_seconds),
        ("learned", &learned),
        ("bake_seconds", &done.seconds),
    ];
    let name = ("antumbra.ao/1", &*ground.loaded.scene.name);
    if !bake.document(name, figures, (done, ""))? {
        return Ok(());
    }
    ground.tell(&format!("{} vertices, ", count(vertices as u64)));
    if let Some(learned) = &learned {
        tell(format_args!("{learned}"));
    }
    tell_values(target, without_value, mean.zip(min.zip(max)));
    bake.end("rays", rays, done);
    Ok(())
}

/// Says how much is open: on average, at least and at most.
fn tell_values(target: &Target, without_value: usize, found: Option<(f64, (f32, f32))>) {
    if without_value > 0 {
        tell(format_args!(
            "{} {} without a normal have the value NaN",
            count(without_value as u64),
            target.name(),
        ));
    }
    if let Some((mean, (min, max))) = found {
        tell(format_args!(
            "ambient occlusion {mean:.3} on average, {min:.3} to {max:.3}"
        ));
    }
}

/// Texels that triangles cover.
fn atlas(ground: &Ground, size: u32) -> Result<Atlas, Failure> {
    let atlas = Atlas::new(&ground.mesh, size).map_err(|error| {
        let of = match error {
            antumbra_bake::Error::NoTextureCoordinates => {
                "no triangle of the scene has texture coordinates".into()
            }
            _ => error.to_string(),
        };
        Failure::Usage(format!("--atlas: {of}"))
    })?;
    let left_out = "triangles have no texture coordinates and are left out";
    let overlaps = "texels are covered more than once; the first triangle has them";
    for (number, what) in [(atlas.left_out, left_out), (atlas.overlaps, overlaps)] {
        if number > 0 {
            tell(format_args!("note: {number} {what}"));
        }
    }
    Ok(atlas)
}

/// The job that the command line describes.
fn job(args: &AoArgs, ground: &Ground, target: &Target) -> Result<OcclusionJob, Failure> {
    let (points, normals) = match target {
        Target::Vertices(points) => (points, &ground.mesh.normals),
        Target::Texels(atlas) => (&atlas.points, &atlas.normals),
        Target::Pixels(view) => (&view.points, &view.normals),
    };
    let options = AmbientOcclusion {
        samples: match target {
            Target::Pixels(_) => args.samples.div_ceil(View::POINTS as u32),
            _ => args.samples,
        },
        distance: args.distance.unwrap_or(f32::INFINITY),
        two_sided: args.two_sided,
        weighting: match args.uniform {
            true => Weighting::Uniform,
            false => Weighting::Cosine,
        },
        seed: args.seed,
    };
    let job = OcclusionJob::new(points, normals, options, args.bent_normals)?;
    Ok(job)
}

/// Makes trees of the scene that learn from rays; none if a tree cannot be made.
fn learn(ground: &Ground, isa: Isa) -> impl Fn(&[antumbra::Ray]) -> Option<Bvh> {
    let recipe = Recipe::default().isa(isa);
    move |rays| Bvh::learn(ground.world.primitives(), rays, &recipe).ok()
}

impl Target {
    fn name(&self) -> &'static str {
        match self {
            Self::Vertices(_) => "vertices",
            Self::Texels(_) => "texels",
            Self::Pixels(_) => "pixels",
        }
    }
}

fn write_mesh(
    path: &Path,
    format: Format,
    ground: &Ground,
    found: &Openness,
) -> Result<(), Failure> {
    let vertices = &ground.mesh;
    let mesh = ShadedMesh {
        positions: &vertices.positions,
        local: ground.local,
        normals: &vertices.normals,
        values: &found.open,
        colours: &[],
        bent_normals: &found.bent_normals,
        indices: &vertices.indices,
    };
    match format {
        Format::Glb => {
            output::check_room(path, mesh.bytes())?;
            Ok(atomic_write(path, |file| write_glb(&mesh, file))?)
        }
        Format::Npz => {
            let mut entries = vec![
                Entry::new("points", Array::Places(mesh.positions, mesh.local)),
                Entry::new("normals", Array::Points(mesh.normals)),
                Entry::new(PROPERTY, Array::F32(mesh.values)),
            ];
            if !mesh.bent_normals.is_empty() {
                entries.push(Entry::new("bent_normals", Array::Points(mesh.bent_normals)));
            }
            files::npz(path, &entries)
        }
        Format::Raster => {
            let cells = ground.loaded.raster.as_ref();
            let cells = cells.ok_or_else(|| Failure::name(path, "the scene is no raster"))?;
            let quantity = Quantity {
                name: PROPERTY,
                unit: "",
            };
            raster::write_cells(path, cells, &found.open, quantity)
        }
        _ => files::ply(path, PROPERTY, &mesh),
    }
}

fn write_atlas(args: &AoArgs, atlas: &Atlas, found: &Openness) -> Result<(), Failure> {
    let is_exr = output::is_one_of(&args.output[0], &["exr"]);
    let pixel = |index: usize| match found.bent_normals.get(index) {
        None => [found.open[index]; 3],
        Some(bent) if is_exr => *bent,
        Some(bent) => bent.map(|x| 0.5 + 0.5 * x),
    };
    let pixels = atlas.picture(pixel, args.dilate);
    let size = atlas.size as usize;
    if is_exr {
        let image = Image::new(size, size, Window::full(size, size), pixels)?;
        return Ok(image.write(&args.output[0])?);
    }
    // Textures of occlusion are linear, so that no display curve is applied. NaN becomes 0.
    let byte = |x: f32| (x * 255.0).round() as u8;
    let pixels = pixels.into_iter().map(|pixel| pixel.map(byte)).collect();
    Ok(Rgb8Image::new(size, size, pixels)?.write(&args.output[0])?)
}
