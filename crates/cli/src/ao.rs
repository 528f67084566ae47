//! `antumbra ao`: ambient occlusion of the vertices of a mesh.

use std::path::Path;
use std::time::Instant;

use antumbra::{Builder, Isa, Width};
use antumbra_bake::{
    AmbientOcclusion, ShadedMesh, Weighting, ambient_occlusion, bent_normals, vertex_normals,
};
use antumbra_image::atomic_write;
use antumbra_lab::{Machine, count};
use antumbra_load::MemorySize;
use antumbra_scene::{Geometry, Scene, Shape, TriangleMesh};
use serde::Serialize;

use crate::args::AoArgs;
use crate::exit::{Failure, tell};
use crate::output::Files;
use crate::progress::Progress;
use crate::{interrupt, json, output, scenes, version};

/// Name of the value in the file.
const PROPERTY: &str = "ao";

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    #[serde(flatten)]
    machine: Machine,
    scene: &'a str,
    output: String,
    samples: u32,
    /// `null` for any distance.
    distance: Option<f32>,
    two_sided: bool,
    bent_normals: bool,
    weighting: &'static str,
    seed: u64,
    vertices: usize,
    triangles: usize,
    /// Vertices without a value: those without a normal, or with coordinates that are not finite.
    without_value: usize,
    rays: u64,
    /// `null` if no vertex has a value.
    mean: Option<f64>,
    min: Option<f32>,
    max: Option<f32>,
    load_seconds: f64,
    build_seconds: f64,
    bake_seconds: f64,
}

/// Runs the command.
pub fn run(args: &AoArgs, memory: MemorySize) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    check_name(&args.output)?;
    let mut files = Files::default();
    files.writes("--output", &args.output)?;
    if let Some(json) = &args.json {
        files.writes("--json", json.path())?;
    }
    files.reads("the scene", &args.scene)?;
    files.check()?;
    args.machine.start_threads()?;
    let loaded = scenes::load(&args.scene, memory)?;
    files.reads_all(&loaded.inputs)?;
    let scene = &loaded.scene;
    let vertices = Vertices::of(scene)?;
    interrupt::check()?;

    let start = Instant::now();
    let bvh = scenes::world(scene, Builder::default())?.bvh(Width::auto(isa.level()), isa);
    let build_seconds = start.elapsed().as_secs_f64();
    let options = AmbientOcclusion {
        samples: args.samples,
        distance: args.distance.unwrap_or(f32::INFINITY),
        two_sided: args.two_sided,
        weighting: match args.uniform {
            true => Weighting::Uniform,
            false => Weighting::Cosine,
        },
        seed: args.seed,
    };
    let start = Instant::now();
    let progress = Progress::new(&scene.name);
    let (positions, normals) = (&vertices.positions, &vertices.normals);
    let (values, bent_normals) = if args.bent_normals {
        let found = bent_normals(&bvh, positions, normals, &options, &progress)?;
        let pairs = found.iter().map(|point| (point.open, point.direction));
        pairs.unzip()
    } else {
        let values = ambient_occlusion(&bvh, positions, normals, &options, &progress)?;
        (values, Vec::new())
    };
    progress.finish();
    let bake_seconds = start.elapsed().as_secs_f64();

    let _writing = interrupt::writing();
    let mesh = ShadedMesh {
        positions,
        normals,
        values: &values,
        colours: &[],
        bent_normals: &bent_normals,
        indices: &vertices.indices,
    };
    output::check_room(&args.output, mesh.bytes())?;
    atomic_write(&args.output, |file| mesh.write(PROPERTY, file))?;
    let document = Document {
        load_seconds: loaded.seconds,
        build_seconds,
        bake_seconds,
        ..Document::new(args, isa, &scene.name, &mesh)
    };
    json::write(&document, args.json.as_ref())?;
    summarise(&document);
    Ok(())
}

/// Refuses a name that is not one of a PLY file.
fn check_name(path: &Path) -> Result<(), Failure> {
    let extension = path.extension().unwrap_or_default();
    if extension.eq_ignore_ascii_case("ply") || output::is_stream(path) {
        return Ok(());
    }
    let path = path.display();
    Err(Failure::Usage(format!("{path}: meshes are written as ply")))
}

/// Vertices and triangles of all meshes of a scene, in world space.
#[derive(Default)]
struct Vertices {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    indices: Vec<[u32; 3]>,
}

impl Vertices {
    fn of(scene: &Scene) -> Result<Self, Failure> {
        let flat = scene.flattened();
        let flat = flat.map_err(|error| Failure::scene(&scene.name, error))?;
        let mut all = Self::default();
        let mut spheres = 0;
        for shape in &flat.shapes {
            match &shape.geometry {
                Geometry::Mesh(mesh) => all.push(shape, mesh),
                Geometry::Sphere(_) => spheres += 1,
            }
        }
        // Indices of PLY files are signed.
        if all.positions.len() > i32::MAX as usize {
            let reason = "it has more vertices than a PLY file can hold";
            return Err(Failure::scene(&scene.name, reason));
        }
        if all.positions.is_empty() {
            return Err(Failure::scene(
                &scene.name,
                "it has no mesh, so no vertices",
            ));
        }
        if spheres > 0 {
            tell(format_args!(
                "note: {spheres} spheres occlude, but have no vertices to write"
            ));
        }
        Ok(all)
    }

    /// Adds the mesh of a shape, with its normals turned as the shape says.
    fn push(&mut self, shape: &Shape, mesh: &TriangleMesh) {
        let first = self.positions.len() as u32;
        let own = !mesh.normals.is_empty();
        let turned = shape.reverse_orientation != (!own && shape.transform_swaps_handedness);
        let sign = if turned { -1.0 } else { 1.0 };
        let normals = match own {
            true => mesh
                .normals
                .iter()
                .map(|normal| normal.to_array())
                .collect(),
            false => vertex_normals(&mesh.positions, &mesh.indices),
        };
        let normals = normals.into_iter();
        self.normals
            .extend(normals.map(|normal: [f32; 3]| normal.map(|x| sign * x)));
        self.positions.extend(&mesh.positions);
        // More vertices than numbers are refused later.
        let moved = |corner: u32| corner.wrapping_add(first);
        self.indices
            .extend(mesh.indices.iter().map(|corners| corners.map(moved)));
    }
}

impl<'a> Document<'a> {
    /// A document without times.
    fn new(args: &AoArgs, isa: Isa, scene: &'a str, mesh: &ShadedMesh<'_>) -> Self {
        let known = || mesh.values.iter().copied().filter(|value| !value.is_nan());
        let vertices = mesh.values.len();
        let with_value = known().count();
        let sides = if args.two_sided { 2 } else { 1 };
        let sum: f64 = known().map(f64::from).sum();
        Self {
            schema: "antumbra.ao/1",
            machine: version::machine(isa),
            scene,
            output: args.output.to_string_lossy().into_owned(),
            samples: args.samples,
            distance: args.distance.filter(|distance| distance.is_finite()),
            two_sided: args.two_sided,
            bent_normals: args.bent_normals,
            weighting: if args.uniform { "uniform" } else { "cosine" },
            seed: args.seed,
            vertices,
            triangles: mesh.indices.len(),
            without_value: vertices - with_value,
            rays: sides * u64::from(args.samples) * with_value as u64,
            mean: (with_value > 0).then(|| sum / with_value as f64),
            min: known().reduce(f32::min),
            max: known().reduce(f32::max),
            load_seconds: 0.0,
            build_seconds: 0.0,
            bake_seconds: 0.0,
        }
    }
}

fn summarise(document: &Document<'_>) {
    tell(format_args!(
        "{}: {} vertices, {} triangles, loaded in {:.2} s, tree built in {:.2} s",
        document.scene,
        count(document.vertices as u64),
        count(document.triangles as u64),
        document.load_seconds,
        document.build_seconds,
    ));
    if document.without_value > 0 {
        tell(format_args!(
            "{} vertices without a normal have the value NaN",
            count(document.without_value as u64)
        ));
    }
    if let (Some(mean), Some(min), Some(max)) = (document.mean, document.min, document.max) {
        tell(format_args!(
            "ambient occlusion {mean:.3} on average, {min:.3} to {max:.3}"
        ));
    }
    tell(format_args!(
        "{} rays in {:.2} s, {:.1} million a second; wrote {}",
        count(document.rays),
        document.bake_seconds,
        document.rays as f64 / 1e6 / document.bake_seconds.max(1e-9),
        document.output,
    ));
}
