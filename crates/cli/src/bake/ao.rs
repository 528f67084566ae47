//! `antumbra ao`: ambient occlusion of vertices, texels or pixels.

use std::path::Path;
use std::time::Instant;

use antumbra::Bvh;
use antumbra_bake::{
    AmbientOcclusion, Array, Entry, ShadedMesh, Weighting, ambient_occlusion, ambient_rays,
    bent_normals, write_glb, write_npz,
};
use antumbra_image::{Image, Rgb8Image, Window, atomic_write};
use antumbra_lab::{Machine, count};
use antumbra_load::{MemorySize, set_resolution};
use serde::Serialize;

use super::chunks::{self, Part, Work};
use super::hash::Key;
use super::learn::{self, Learned};
use super::mesh::Ground;
use super::texels::Atlas;
use super::view::View;
use crate::args::AoArgs;
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::progress::Progress;
use crate::{json, output, scenes, version};

/// Name of the value in files.
const PROPERTY: &str = "ao";

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    #[serde(flatten)]
    machine: Machine,
    scene: &'a str,
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
    /// Points that were looked from: vertices, texels with a triangle, or points of pixels.
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

/// What values are made of.
enum Target {
    Vertices,
    Texels(Atlas),
    Pixels(View),
}

/// Formats, by extension.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Ply,
    Glb,
    Picture,
    Npz,
}

fn format(path: &Path) -> Result<Format, Failure> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    match extension.to_str() {
        Some("ply") => Ok(Format::Ply),
        Some("glb") => Ok(Format::Glb),
        Some("png" | "exr") => Ok(Format::Picture),
        Some("npz") => Ok(Format::Npz),
        _ if output::is_stream(path) => Ok(Format::Ply),
        _ => Err(Failure::Usage(format!(
            "{}: meshes are written as ply, glb or npz, pictures and textures as png or exr",
            path.display()
        ))),
    }
}

/// Refuses outputs that cannot be made, before anything is read.
fn check(args: &AoArgs) -> Result<Format, Failure> {
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
    let format = format(&args.output)?;
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
pub fn run(args: &AoArgs, memory: MemorySize, parts: Option<&[Part]>) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    let format = check(args)?;
    let mut files = Files::default();
    let outputs = [args.output.clone()];
    chunks::declare(&outputs, args.chunks.shard, &mut files)?;
    if let Some(json) = &args.json {
        files.writes("--json", json.path())?;
    }
    chunks::reads(parts, &mut files)?;
    files.reads("the scene", &args.scene)?;
    files.check()?;
    args.machine.start_threads()?;
    let mut ground = Ground::load(&args.scene, isa, memory, &mut files)?;
    if let Some(resolution) = args.resolution {
        set_resolution(&mut ground.loaded.scene, resolution.0)?;
    }
    scenes::apply_pose(&mut ground.loaded, &args.pose)?;
    let ground = ground;
    let target = match (format, args.atlas) {
        (Format::Picture, Some(size)) => Target::Texels(Atlas::new(&ground.vertices, size)?),
        (Format::Picture, None) => Target::Pixels(View::new(&ground)?),
        _ => Target::Vertices,
    };
    let (points, normals) = match &target {
        Target::Vertices => (&ground.vertices.positions, &ground.vertices.normals),
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
    let sides = if args.two_sided { 2 } else { 1 };
    let rays_per_item = sides * u64::from(options.samples);
    let total_rays = rays_per_item * points.len() as u64;
    let learned = match parts {
        None => learn::when_it_pays(&ground, isa, total_rays, |count, per_point| {
            ambient_rays(&ground.bvh, (points, normals), &options, count, per_point)
        }),
        Some(_) => None,
    };
    let own = learned.as_ref().and_then(|(bvh, _)| bvh.as_ref());
    let bvh = own.unwrap_or(&ground.bvh);

    let mut key = Key::new("ao/1", &ground.loaded.scene)?;
    key.text(&format!("{options:?} {}", args.bent_normals));
    for list in [points, normals] {
        key.floats(list.as_flattened());
    }
    let work = Work {
        key: key.value(),
        items: points.len(),
        rays_per_item,
        shard: args.chunks.shard,
        output: &args.output,
        restart: args.chunks.restart,
        parts,
    };
    let start = Instant::now();
    let progress = Progress::new(&ground.loaded.scene.name);
    let chunks = work.run(&progress, |range, monitor| {
        let (points, normals) = (&points[range.clone()], &normals[range]);
        bake(bvh, (points, normals), &options, args.bent_normals, monitor)
    })?;
    progress.finish();
    let bake_seconds = start.elapsed().as_secs_f64();
    let mut document = Document {
        schema: "antumbra.ao/1",
        machine: version::machine(isa),
        scene: &ground.loaded.scene.name,
        output: args.output.to_string_lossy().into_owned(),
        shard: args.chunks.shard.map(|shard| shard.to_string()),
        of: match target {
            Target::Vertices => "vertices",
            Target::Texels(_) => "texels",
            Target::Pixels(_) => "pixels",
        },
        samples: args.samples,
        distance: args.distance.filter(|distance| distance.is_finite()),
        two_sided: args.two_sided,
        bent_normals: args.bent_normals,
        weighting: if args.uniform { "uniform" } else { "cosine" },
        seed: args.seed,
        vertices: ground.vertices.positions.len(),
        triangles: ground.vertices.indices.len(),
        points: points.len(),
        without_value: 0,
        rays: 0,
        mean: None,
        min: None,
        max: None,
        load_seconds: ground.loaded.seconds,
        build_seconds: ground.build_seconds,
        learned: learned.as_ref().map(|(_, learned)| *learned),
        bake_seconds,
    };
    let Some(found) = chunks else {
        json::write(&document, args.json.as_ref())?;
        tell(format_args!("wrote {}, for merge", document.output));
        return Ok(());
    };
    let values = Values::new(&found, points.len(), args.bent_normals)?;
    document.fill(&values.open, rays_per_item);
    let _writing = crate::interrupt::writing();
    match &target {
        Target::Vertices => write_mesh(args, format, &ground, &values)?,
        Target::Texels(atlas) => write_atlas(args, atlas, &values)?,
        Target::Pixels(view) => view
            .picture(&values.open, &values.bent)?
            .write(&args.output)?,
    }
    json::write(&document, args.json.as_ref())?;
    summarise(&document, parts);
    Ok(())
}

/// Bytes of some points: the value of each, and its bent normal if it is asked for.
fn bake(
    bvh: &Bvh,
    (points, normals): (&[[f32; 3]], &[[f32; 3]]),
    options: &AmbientOcclusion,
    with_directions: bool,
    monitor: &dyn antumbra_bake::Monitor,
) -> Result<Vec<u8>, Failure> {
    if with_directions {
        let found = bent_normals(bvh, points, normals, options, monitor)?;
        let floats = found.iter().flat_map(|point| {
            let [x, y, z] = point.direction;
            [point.open, x, y, z]
        });
        Ok(floats.flat_map(f32::to_le_bytes).collect())
    } else {
        let values = ambient_occlusion(bvh, points, normals, options, monitor)?;
        Ok(values.into_iter().flat_map(f32::to_le_bytes).collect())
    }
}

/// Values of all points.
struct Values {
    open: Vec<f32>,
    bent: Vec<[f32; 3]>,
}

impl Values {
    fn new(chunks: &[Vec<u8>], points: usize, with_directions: bool) -> Result<Self, Failure> {
        let bytes = chunks.iter().flat_map(|chunk| chunk.as_chunks::<4>().0);
        let floats: Vec<f32> = bytes.map(|bytes| f32::from_le_bytes(*bytes)).collect();
        let width = if with_directions { 4 } else { 1 };
        if floats.len() != width * points {
            return Err(Failure::Data(
                "the chunks of an earlier run do not fit".into(),
            ));
        }
        if !with_directions {
            let bent = Vec::new();
            return Ok(Self { open: floats, bent });
        }
        let (fours, _) = floats.as_chunks::<4>();
        Ok(Self {
            open: fours.iter().map(|four| four[0]).collect(),
            bent: fours
                .iter()
                .map(|four| [four[1], four[2], four[3]])
                .collect(),
        })
    }
}

fn write_mesh(
    args: &AoArgs,
    format: Format,
    ground: &Ground,
    values: &Values,
) -> Result<(), Failure> {
    let vertices = &ground.vertices;
    let mesh = ShadedMesh {
        positions: &vertices.positions,
        normals: &vertices.normals,
        values: &values.open,
        colours: &[],
        bent_normals: &values.bent,
        indices: &vertices.indices,
    };
    let path = &args.output;
    match format {
        Format::Glb => {
            output::check_room(path, mesh.bytes())?;
            atomic_write(path, |file| write_glb(&mesh, file))?;
        }
        Format::Npz => {
            let mut entries = vec![
                Entry::new("points", Array::Points(&vertices.positions)),
                Entry::new("normals", Array::Points(&vertices.normals)),
                Entry::new(PROPERTY, Array::F32(&values.open)),
            ];
            if args.bent_normals {
                entries.push(Entry::new("bent_normals", Array::Points(&values.bent)));
            }
            output::check_room(path, antumbra_bake::npz_bytes(&entries))?;
            atomic_write(path, |file| write_npz(&entries, file))?;
        }
        Format::Ply | Format::Picture => {
            output::check_room(path, mesh.bytes())?;
            atomic_write(path, |file| mesh.write(PROPERTY, file))?;
        }
    }
    Ok(())
}

fn write_atlas(args: &AoArgs, atlas: &Atlas, values: &Values) -> Result<(), Failure> {
    let is_exr = args
        .output
        .extension()
        .is_some_and(|name| name.eq_ignore_ascii_case("exr"));
    let pixel = |index: usize| match values.bent.get(index) {
        None => [values.open[index]; 3],
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

impl Document<'_> {
    /// Fills in what values tell.
    fn fill(&mut self, values: &[f32], rays_per_item: u64) {
        let known = || values.iter().copied().filter(|value| !value.is_nan());
        let with_value = known().count();
        self.without_value = values.len() - with_value;
        self.rays = rays_per_item * with_value as u64;
        let sum: f64 = known().map(f64::from).sum();
        self.mean = (with_value > 0).then(|| sum / with_value as f64);
        self.min = known().reduce(f32::min);
        self.max = known().reduce(f32::max);
    }
}

fn summarise(document: &Document<'_>, parts: Option<&[Part]>) {
    tell(format_args!(
        "{}: {} vertices, {} triangles, loaded in {:.2} s, tree built in {:.2} s",
        document.scene,
        count(document.vertices as u64),
        count(document.triangles as u64),
        document.load_seconds,
        document.build_seconds,
    ));
    if let Some(learned) = &document.learned {
        tell(format_args!("{learned}"));
    }
    if document.without_value > 0 {
        tell(format_args!(
            "{} {} without a normal have the value NaN",
            count(document.without_value as u64),
            document.of,
        ));
    }
    if let (Some(mean), Some(min), Some(max)) = (document.mean, document.min, document.max) {
        tell(format_args!(
            "ambient occlusion {mean:.3} on average, {min:.3} to {max:.3}"
        ));
    }
    tell(format_args!(
        "{}; wrote {}",
        chunks::work_done("rays", document.rays, document.bake_seconds, parts),
        document.output,
    ));
}
