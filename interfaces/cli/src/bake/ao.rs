//! `antumbra ao`: ambient occlusion of vertices, texels or pixels.

use std::path::Path;
use std::slice;

use antumbra::{Bvh, Isa, Recipe};
use antumbra_bake::{
    AmbientOcclusion, Array, Atlas, Entry, Job as _, Learned, OcclusionJob, Openness, ShadedMesh,
    Weighting, inside_edges, learn_when_it_pays, write_glb,
};
use antumbra_image::{Image, Rgb8Image, Window, atomic_write};
use antumbra_lab::{count, thread_seconds};
use antumbra_load::{MemorySize, set_resolution};
use antumbra_raster::Quantity;
use serde::Serialize;

use super::chunks::{self, PartFile};
use super::command::{Bake, Head, text};
use super::files::{self, Format};
use super::ground::Ground;
use super::raster;
use super::view::View;
use crate::args::AoArgs;
use crate::exit::{Failure, tell};
use crate::{interrupt, json, output, scenes};

/// Name of the value in files.
const PROPERTY: &str = "ao";

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    head: Head<'a>,
    output: String,
    shard: Option<String>,
    /// `vertices`, `texels` or `pixels`.
    of: &'static str,
    samples: u32,
    /// `null` for any distance.
    distance: Option<f32>,
    two_sided: bool,
    bent_normals: bool,
    weighting: &'static str,
    seed: u64,
    vertices: usize,
    triangles: usize,
    /// Points that have rays: vertices, texels with a triangle, or points of pixels.
    points: usize,
    /// Points without a value: those without a normal, or with coordinates that are not finite.
    without_value: usize,
    rays: u64,
    /// `null` if no point has a value.
    mean: Option<f64>,
    min: Option<f32>,
    max: Option<f32>,
    load_seconds: f64,
    build_seconds: f64,
    learned: Option<Learned>,
    bake_seconds: f64,
}

/// Points whose values are computed.
enum Target {
    /// Vertices of the mesh, moved a little into their surfaces.
    Vertices(Vec<[f32; 3]>),
    Texels(Atlas),
    Pixels(View),
}

/// Refuses outputs that cannot be made, before anything is read.
pub fn check(args: &AoArgs) -> Result<Format, Failure> {
    let pose = args.pose.given();
    if let (Some(_), Some(flag)) = (args.atlas, pose) {
        return Err(Failure::Usage(format!(
            "{flag} does not go with --atlas: a texture has no camera"
        )));
    }
    if args.chunks.shard.is_some() {
        let is_picture = args.atlas.is_some() || args.resolution.is_some() || pose.is_some();
        return Ok(match is_picture {
            true => Format::Picture,
            false => Format::Ply,
        });
    }
    let known = [
        "ply", "glb", "npz", "png", "exr", "tif", "tiff", "asc", "npy",
    ];
    let sentence = "meshes are written as ply, glb or npz, pictures and textures as png or exr, rasters as tif, asc or npy";
    let format = Format::of(&args.output, &known, sentence)?;
    if format == Format::Raster && (!raster::is_raster(&args.scene) || args.bent_normals) {
        return Err(Failure::Usage(format!(
            "{}: a raster needs a scene that is one, and holds no --bent-normals",
            args.output.display()
        )));
    }
    let flag = match (args.atlas, args.resolution) {
        (Some(_), _) => Some("--atlas"),
        (None, Some(_)) => Some("--resolution"),
        (None, None) => pose,
    };
    match flag {
        Some(flag) if format != Format::Picture => Err(Failure::Usage(format!(
            "{flag} makes a png or exr, not {}",
            args.output.display()
        ))),
        _ => Ok(format),
    }
}

/// Runs the command, or merges parts of it.
pub fn run(args: &AoArgs, memory: MemorySize, parts: Option<&[PartFile]>) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    let format = check(args)?;
    let bake = Bake {
        scene: &args.scene,
        outputs: slice::from_ref(&args.output),
        json: args.json.as_ref(),
        chunks: &args.chunks,
        machine: &args.machine,
        parts,
        earth: None,
    };
    let mut files = bake.declare(&[], &[])?;
    let mut ground = bake.ground(isa, memory, &mut files)?;
    if let Some(resolution) = args.resolution {
        set_resolution(&mut ground.loaded.scene, resolution.0)?;
    }
    scenes::apply_pose(&mut ground.loaded, &args.pose)?;
    scenes::tell_read(&ground.loaded, args.pose.up);
    ground.split_at_creases()?;
    let target = match (format, args.atlas) {
        (Format::Picture, Some(size)) => Target::Texels(atlas(&ground, size)?),
        (Format::Picture, None) => Target::Pixels(View::new(&ground)?),
        _ => {
            let offset = |point: [f32; 3]| ground.bvh.origin_offset(point);
            Target::Vertices(inside_edges(&ground.mesh, offset))
        }
    };
    let job = job(args, &ground, &target)?;
    let learned = match parts {
        None => learn_when_it_pays(&job, &ground.bvh, learn(&ground, isa), thread_seconds),
        Some(_) => None,
    };
    let own = learned.as_ref().and_then(|(bvh, _)| bvh.as_ref());
    let done = bake.compute(&job, &ground, own.unwrap_or(&ground.bvh))?;
    let mut document = Document {
        learned: learned.as_ref().map(|(_, learned)| *learned),
        bake_seconds: done.seconds,
        ..Document::new(
            args,
            &bake,
            bake.head("antumbra.ao/1", isa, &ground.loaded.scene.name),
            &ground,
        )
    };
    document.of = target.name();
    document.points = job.items();
    let Some(found) = done.found else {
        json::write(&document, args.json.as_ref())?;
        tell(format_args!("wrote {}, for merge", document.output));
        return Ok(());
    };
    document.fill(&found.open, &job);
    let _writing = interrupt::writing();
    match &target {
        Target::Vertices(_) => write_mesh(&args.output, format, &ground, &found)?,
        Target::Texels(atlas) => write_atlas(args, atlas, &found)?,
        Target::Pixels(view) => {
            let picture = view.picture(&found.open, &found.bent_normals)?;
            picture.write(&args.output)?;
        }
    }
    json::write(&document, args.json.as_ref())?;
    document.tell(&ground);
    bake.tell_done("rays", document.rays, document.bake_seconds);
    chunks::forget(done.checkpoint.as_deref());
    Ok(())
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
    if atlas.left_out > 0 {
        let left_out = atlas.left_out;
        tell(format_args!(
            "note: {left_out} triangles have no texture coordinates and are left out"
        ));
    }
    if atlas.overlaps > 0 {
        let overlaps = atlas.overlaps;
        tell(format_args!(
            "note: {overlaps} texels are covered more than once; the first triangle has them"
        ));
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
            let cells = ground.loaded.raster.as_ref().ok_or_else(|| {
                Failure::Usage(format!("{}: the scene is no raster", path.display()))
            })?;
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
    let extension = args.output.extension().unwrap_or_default();
    let is_exr = extension.eq_ignore_ascii_case("exr");
    let pixel = |index: usize| match found.bent_normals.get(index) {
        None => [found.open[index]; 3],
        Some(bent) if is_exr => *bent,
        Some(bent) => bent.map(|x| 0.5 + 0.5 * x),
    };
    let pixels = atlas.picture(pixel, args.dilate);
    let size = atlas.size as usize;
    if is_exr {
        let image = Image::new(size, size, Window::full(size, size), pixels)?;
        return Ok(image.write(&args.output)?);
    }
    // Textures of occlusion are linear, so that no display curve is applied. NaN becomes 0.
    let byte = |x: f32| (x * 255.0).round() as u8;
    let pixels = pixels.into_iter().map(|pixel| pixel.map(byte)).collect();
    Ok(Rgb8Image::new(size, size, pixels)?.write(&args.output)?)
}

impl<'a> Document<'a> {
    /// A document of what is known before anything is computed.
    fn new(args: &AoArgs, bake: &Bake<'_>, head: Head<'a>, ground: &Ground) -> Self {
        Self {
            head,
            output: text(&args.output),
            shard: bake.shard(),
            of: "",
            samples: args.samples,
            distance: args.distance.filter(|distance| distance.is_finite()),
            two_sided: args.two_sided,
            bent_normals: args.bent_normals,
            weighting: if args.uniform { "uniform" } else { "cosine" },
            seed: args.seed,
            vertices: ground.mesh.positions.len(),
            triangles: ground.mesh.indices.len(),
            points: 0,
            without_value: 0,
            rays: 0,
            mean: None,
            min: None,
            max: None,
            load_seconds: ground.loaded.seconds,
            build_seconds: ground.build_seconds,
            learned: None,
            bake_seconds: 0.0,
        }
    }

    /// Fills in figures about the values.
    fn fill(&mut self, values: &[f32], job: &OcclusionJob) {
        let known = || values.iter().copied().filter(|value| !value.is_nan());
        let with_value = known().count();
        self.without_value = values.len() - with_value;
        self.rays = job.rays_per_item() * with_value as u64;
        let sum: f64 = known().map(f64::from).sum();
        self.mean = (with_value > 0).then(|| sum / with_value as f64);
        self.min = known().reduce(f32::min);
        self.max = known().reduce(f32::max);
    }

    fn tell(&self, ground: &Ground) {
        ground.tell(&format!("{} vertices, ", count(self.vertices as u64)));
        if let Some(learned) = &self.learned {
            tell(format_args!("{learned}"));
        }
        if self.without_value > 0 {
            tell(format_args!(
                "{} {} without a normal have the value NaN",
                count(self.without_value as u64),
                self.of,
            ));
        }
        if let (Some(mean), Some(min), Some(max)) = (self.mean, self.min, self.max) {
            tell(format_args!(
                "ambient occlusion {mean:.3} on average, {min:.3} to {max:.3}"
            ));
        }
    }
}
