//! `antumbra info`: what is in a scene, and its trees.

use std::time::Instant;

use antumbra::recipe::Builder;
use antumbra::{Isa, Width};
use antumbra_lab::{Machine, count};
use antumbra_load::{Extent, IntegratorKind, Loaded, MemorySize};
use antumbra_render::World;
use antumbra_scene::{Geometry, Light, Material, Projection, Scene};
use serde::{Serialize, Serializer};

use crate::args::{InfoArgs, start_threads};
use crate::exit::Failure;
use crate::json::{self, Destination};
use crate::output::Files;
use crate::table::draw;
use crate::{scenes, version};

/// The JSON document.
#[derive(Serialize)]
struct Document {
    schema: &'static str,
    #[serde(flatten)]
    machine: Machine,
    scene: String,
    /// Shapes, triangles, spheres and curves in the world. An object counts once for every instance.
    shapes: usize,
    triangles: usize,
    spheres: usize,
    curves: usize,
    objects: usize,
    instances: usize,
    /// Every object counted once.
    stored_triangles: usize,
    primitives: usize,
    dropped_primitives: usize,
    materials: Counts,
    lights: Counts,
    /// Corners of the smallest box around everything, in the world.
    bounds: Option<[[f64; 3]; 2]>,
    /// Where positions are measured from, so that single precision holds them.
    origin: [f64; 3],
    /// Axis that points up, and what speaks for it.
    up: String,
    up_reason: &'static str,
    camera: CameraInfo,
    film: FilmInfo,
    sampler: String,
    spp: u32,
    integrator: &'static str,
    load_seconds: f64,
    /// Parts of `load_seconds`; `null` for other formats than .pbrt.
    load: Option<LoadTimes>,
    lower_seconds: f64,
    builder: &'static str,
    tree_seconds: f64,
    trees: Vec<TreeInfo>,
}

/// Numbers of things by kind, in the order of the document.
struct Counts(Vec<(&'static str, usize)>);

impl Serialize for Counts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().copied())
    }
}

impl Counts {
    fn new(kinds: &[&'static str], found: impl Iterator<Item = &'static str> + Clone) -> Self {
        let count = |&kind: &&'static str| (kind, found.clone().filter(|k| *k == kind).count());
        Self(kinds.iter().map(count).collect())
    }

    fn get(&self, kind: &str) -> usize {
        let count = self.0.iter().find(|(name, _)| *name == kind);
        count.map_or(0, |(_, count)| *count)
    }

    /// The numbers of usual kinds, and of rare ones that are there.
    fn text(&self, usual: &[&str], rare: &[&str]) -> String {
        let rare = rare.iter().filter(|kind| self.get(kind) > 0);
        let all = usual.iter().chain(rare);
        let all: Vec<String> = all
            .map(|kind| format!("{} {kind}", self.get(kind)))
            .collect();
        all.join(", ")
    }
}

/// Seconds of the clock: the text of the scene, its meshes, its images.
#[derive(Serialize)]
struct LoadTimes {
    parse_seconds: f64,
    meshes_seconds: f64,
    images_seconds: f64,
}

#[derive(Serialize)]
struct CameraInfo {
    position: [f64; 3],
    direction: [f32; 3],
    projection: &'static str,
    /// `null` if the projection is not perspective.
    fov_degrees: Option<f32>,
    lens_radius: f32,
}

#[derive(Serialize)]
struct FilmInfo {
    resolution: [u32; 2],
    pixel_bounds: [u32; 4],
    file_name: Option<String>,
}

#[derive(Serialize)]
struct TreeInfo {
    width: usize,
    nodes: usize,
    leaves: usize,
    depth: usize,
    bytes: usize,
    /// Time of the binary tree, which all widths share, and of its collapse.
    build_seconds: f64,
}

/// Runs the command.
pub fn run(args: &InfoArgs, memory: MemorySize) -> Result<(), Failure> {
    let mut files = Files::default();
    files.reads("the scene", &args.scene)?;
    files.writes_some([("--json", args.json.as_ref().map(Destination::path))])?;
    files.check()?;
    start_threads(None)?;
    let mut loaded = scenes::load_with_looks(&args.scene, memory)?;
    scenes::apply_pose(&mut loaded, &args.pose)?;
    scenes::tell_read(&loaded, args.pose.up);
    files.reads_all(&loaded.inputs)?;
    let document = describe(&loaded, args.builder.builder.unwrap_or_default())?;
    json::write(&document, args.json.as_ref())?;
    json::print_beside(args.json.as_ref(), &text(&document))
}

fn describe(loaded: &Loaded, builder: Builder) -> Result<Document, Failure> {
    let scene = &loaded.scene;
    let world = scenes::world(scene, builder)?;
    let extent = Extent::of(scene);
    let isa = Isa::best();
    let (trees, primitives) = trees(&world, isa);
    Ok(Document {
        schema: "antumbra.info/1",
        machine: version::machine(isa),
        scene: scene.name.clone(),
        shapes: scene.standing_shapes().count(),
        triangles: scene.triangle_count(),
        spheres: scene
            .standing_shapes()
            .filter(|shape| matches!(shape.geometry, Geometry::Sphere(_)))
            .count(),
        curves: scene.curve_count(),
        objects: scene.objects.len(),
        instances: scene.instances.len(),
        stored_triangles: scene.stored_triangle_count(),
        primitives: primitives[0],
        dropped_primitives: primitives[1],
        materials: Counts::new(&Material::families(), scene.materials.iter().map(family)),
        lights: lights(scene),
        bounds: extent.map(|Extent { low, high }| [low, high].map(|at| (at + scene.origin).into())),
        origin: scene.origin.into(),
        up: loaded.up.axis.to_string(),
        up_reason: loaded.up.reason,
        camera: CameraInfo::new(scene),
        film: FilmInfo {
            resolution: scene.film.resolution,
            pixel_bounds: scene.film.pixel_bounds(),
            file_name: scene.film.file_name.clone(),
        },
        sampler: scene.sampler.kind.name().to_owned(),
        spp: scene.sampler.pixel_samples,
        integrator: IntegratorKind::of(&scene.integrator).name(),
        load_seconds: loaded.seconds,
        load: loaded.times.map(|times| LoadTimes {
            parse_seconds: times.parse.as_secs_f64(),
            meshes_seconds: times.meshes.as_secs_f64(),
            images_seconds: times.images.as_secs_f64(),
        }),
        lower_seconds: world.lower_seconds(),
        builder: builder.name(),
        tree_seconds: world.tree_seconds(),
        trees,
    })
}

/// Trees of every width, and how many primitives they hold and have left out.
fn trees(world: &World, isa: Isa) -> (Vec<TreeInfo>, [usize; 2]) {
    let (mut trees, mut primitives) = (Vec::new(), [0, 0]);
    for width in Width::ALL {
        let start = Instant::now();
        let bvh = world.bvh(antumbra_trees::engine(isa, width));
        let seconds = start.elapsed().as_secs_f64();
        let report = bvh.report();
        primitives = [report.primitives, report.dropped];
        trees.push(TreeInfo {
            width: width.lanes(),
            nodes: report.nodes,
            leaves: report.leaves,
            depth: report.depth,
            bytes: report.bytes,
            build_seconds: world.tree_seconds() + seconds,
        });
    }
    (trees, primitives)
}

/// Family of a material; one with a bump map counts as what it is without.
fn family(material: &Material) -> &'static str {
    match material {
        Material::Bumped(bumped) => bumped.material.family(),
        Material::NormalMapped(mapped) => mapped.material.family(),
        material => material.family(),
    }
}

/// Kinds of lights, of which some are in every text.
const LIGHTS: [&str; 6] = [
    "point",
    "spot",
    "distant",
    "goniometric",
    "projection",
    "infinite",
];
const USUAL_LIGHTS: [&str; 4] = ["point", "spot", "distant", "infinite"];

fn kind_of_light(light: &Light) -> &'static str {
    match light {
        Light::Point { .. } => "point",
        Light::Spot { .. } => "spot",
        Light::Distant { .. } => "distant",
        Light::Goniometric { .. } => "goniometric",
        Light::Projection { .. } => "projection",
        Light::Infinite { .. } => "infinite",
    }
}

/// Lights by kind, then area lights, which are shapes that emit, and their triangles and spheres.
fn lights(scene: &Scene) -> Counts {
    let mut counts = Counts::new(&LIGHTS, scene.lights.iter().map(kind_of_light));
    let shapes = scene.standing_shapes();
    let primitives = shapes.filter(|shape| shape.area_light.is_some());
    let primitives = primitives.map(|shape| match &shape.geometry {
        Geometry::Mesh(mesh) => mesh.indices.len(),
        Geometry::Sphere(_) => 1,
        Geometry::Curves(curves) => curves.first.len(),
    });
    let primitives: Vec<usize> = primitives.collect();
    counts.0.push(("area", primitives.len()));
    counts.0.push(("area_primitives", primitives.iter().sum()));
    counts
}

impl CameraInfo {
    fn new(scene: &Scene) -> Self {
        let camera = &scene.camera;
        let to_world = camera.world_from_camera;
        Self {
            position: (to_world.w_axis.truncate().as_dvec3() + scene.origin).into(),
            direction: to_world.z_axis.truncate().normalize_or_zero().into(),
            projection: match camera.projection {
                Projection::Perspective => "perspective",
                Projection::Orthographic => "orthographic",
                Projection::Spherical => "spherical",
                Projection::EqualArea => "equalarea",
                Projection::Realistic => "realistic",
            },
            fov_degrees: (camera.projection == Projection::Perspective).then_some(camera.fov),
            lens_radius: camera.lens_radius,
        }
    }

    fn view(&self) -> String {
        match self.fov_degrees {
            Some(fov) => format!("field of view {fov} degrees"),
            None => format!("{} projection", self.projection),
        }
    }
}

/// A line for each tree.
fn table(trees: &[TreeInfo]) -> String {
    let row = |tree: &TreeInfo| {
        vec![
            tree.width.to_string(),
            count(tree.nodes as u64),
            count(tree.leaves as u64),
            tree.depth.to_string(),
            format!("{:.1}", tree.bytes as f64 / 1e6),
            format!("{:.3}", tree.build_seconds),
        ]
    };
    let rows: Vec<_> = trees.iter().map(row).collect();
    draw(
        &["width", "nodes", "leaves", "depth", "MB", "build s"],
        &rows,
    )
}

fn text(document: &Document) -> String {
    let families = Material::families();
    let (usual, rare) = families.split_at(4);
    let (materials, lights) = (&document.materials, &document.lights);
    let (camera, film) = (&document.camera, &document.film);
    let ([width, height], [x0, x1, y0, y1]) = (film.resolution, film.pixel_bounds);
    let load = document.load.as_ref().map_or(String::new(), |load| {
        format!(
            " ({:.3} s text, {:.3} s meshes, {:.3} s images)",
            load.parse_seconds, load.meshes_seconds, load.images_seconds
        )
    });
    let bounds = match document.bounds {
        Some([low, high]) => format!("{low:?} to {high:?}"),
        None => "none".to_owned(),
    };
    let trees = table(&document.trees);
    format!(
        "{}\n\
         shapes       {} with {} triangles, {} spheres and {} curves; {} degenerate primitives left out\n\
         objects      {} with {} instances; {} triangles are stored\n\
         bounds       {bounds}\n\
         materials    {}\n\
         lights       {}, {} area with {} primitives\n\
         camera       at {:?} towards {:?}, {}, lens radius {}\n\
         film         {width} x {height} pixels, of them x {x0} to {x1} and y {y0} to {y1}\n\
         integrator   {}, {} samples per pixel of the sampler {}\n\
         times        {:.3} s to load{load}, {:.3} s to lower, {:.3} s to build the binary tree ({})\n\
         {trees}",
        document.scene,
        count(document.shapes as u64),
        count(document.triangles as u64),
        count(document.spheres as u64),
        count(document.curves as u64),
        count(document.dropped_primitives as u64),
        count(document.objects as u64),
        count(document.instances as u64),
        count(document.stored_triangles as u64),
        materials.text(usual, rare),
        lights.text(&USUAL_LIGHTS, &LIGHTS[3..5]),
        lights.get("area"),
        count(lights.get("area_primitives") as u64),
        camera.position,
        camera.direction,
        camera.view(),
        camera.lens_radius,
        document.integrator,
        document.spp,
        document.sampler,
        document.load_seconds,
        document.lower_seconds,
        document.tree_seconds,
        document.builder,
    )
}
