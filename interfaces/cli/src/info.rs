//! `antumbra info`: what is in a scene, and its trees.

use std::time::Instant;

use antumbra::recipe::Builder;
use antumbra::{Isa, Width};
use antumbra_lab::{Machine, count};
use antumbra_load::{Extent, IntegratorKind, Loaded, MemorySize};
use antumbra_scene::{Geometry, Light, Material, Projection, Scene};
use serde::{Serialize, Serializer};

use crate::args::{InfoArgs, start_threads};
use crate::exit::Failure;
use crate::json;
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
    materials: Materials,
    lights: Lights,
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

/// Materials by family; one with a bump map counts as what it is without.
struct Materials(Vec<(&'static str, usize)>);

impl Serialize for Materials {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().copied())
    }
}

/// Lights by kind; an area light is a shape that emits.
#[derive(Default, Serialize)]
struct Lights {
    point: usize,
    spot: usize,
    distant: usize,
    goniometric: usize,
    projection: usize,
    infinite: usize,
    area: usize,
    /// Triangles and spheres of the area lights.
    area_primitives: usize,
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
    if let Some(json) = &args.json {
        files.writes("--json", json.path())?;
    }
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
    let mut trees = Vec::new();
    let (mut dropped, mut primitives) = (0, 0);
    for width in Width::ALL {
        let start = Instant::now();
        let bvh = world.bvh(antumbra_trees::engine(isa, width));
        let seconds = start.elapsed().as_secs_f64();
        let report = bvh.report();
        (dropped, primitives) = (report.dropped, report.primitives);
        trees.push(TreeInfo {
            width: width.lanes(),
            nodes: report.nodes,
            leaves: report.leaves,
            depth: report.depth,
            bytes: report.bytes,
            build_seconds: world.tree_seconds() + seconds,
        });
    }
    let to_world = scene.camera.world_from_camera;
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
        primitives,
        dropped_primitives: dropped,
        materials: materials(scene),
        lights: lights(scene),
        bounds: extent.map(|Extent { low, high }| [low, high].map(|at| (at + scene.origin).into())),
        origin: scene.origin.into(),
        up: loaded.up.axis.to_string(),
        up_reason: loaded.up.reason,
        camera: CameraInfo {
            position: (to_world.w_axis.truncate().as_dvec3() + scene.origin).into(),
            direction: to_world.z_axis.truncate().normalize_or_zero().into(),
            projection: match scene.camera.projection {
                Projection::Perspective => "perspective",
                Projection::Orthographic => "orthographic",
                Projection::Spherical => "spherical",
                Projection::EqualArea => "equalarea",
                Projection::Realistic => "realistic",
            },
            fov_degrees: (scene.camera.projection == Projection::Perspective)
                .then_some(scene.camera.fov),
            lens_radius: scene.camera.lens_radius,
        },
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

fn materials(scene: &Scene) -> Materials {
    let mut counts: Vec<_> = Material::FAMILIES.iter().map(|name| (*name, 0)).collect();
    counts.dedup();
    for material in &scene.materials {
        let family = match material {
            Material::Bumped(bumped) => bumped.material.family(),
            Material::NormalMapped(mapped) => mapped.material.family(),
            material => material.family(),
        };
        let found = counts.iter_mut().filter(|(name, _)| *name == family);
        found.for_each(|(_, count)| *count += 1);
    }
    Materials(counts)
}

fn lights(scene: &Scene) -> Lights {
    let mut counts = Lights::default();
    for light in &scene.lights {
        *match light {
            Light::Point { .. } => &mut counts.point,
            Light::Spot { .. } => &mut counts.spot,
            Light::Distant { .. } => &mut counts.distant,
            Light::Goniometric { .. } => &mut counts.goniometric,
            Light::Projection { .. } => &mut counts.projection,
            Light::Infinite { .. } => &mut counts.infinite,
        } += 1;
    }
    for shape in scene
        .standing_shapes()
        .filter(|shape| shape.area_light.is_some())
    {
        counts.area += 1;
        counts.area_primitives += match &shape.geometry {
            Geometry::Mesh(mesh) => mesh.indices.len(),
            Geometry::Sphere(_) => 1,
            Geometry::Curves(curves) => curves.first.len(),
        };
    }
    counts
}

impl CameraInfo {
    fn view(&self) -> String {
        match self.fov_degrees {
            Some(fov) => format!("field of view {fov} degrees"),
            None => format!("{} projection", self.projection),
        }
    }
}

impl Materials {
    /// Counts of the first families, which most scenes have, and of others that are present.
    fn text(&self) -> String {
        let (common, others) = self.0.split_at(4);
        let common = common.iter().map(|(name, count)| format!("{count} {name}"));
        let others: Vec<_> = others.iter().map(|(name, count)| (*count, *name)).collect();
        common.collect::<Vec<_>>().join(", ") + &present(&others)
    }
}

impl Lights {
    fn text(&self) -> String {
        let others = [
            (self.goniometric, "goniometric"),
            (self.projection, "projection"),
        ];
        let Self {
            point,
            spot,
            distant,
            infinite,
            ..
        } = self;
        format!(
            "{point} point, {spot} spot, {distant} distant, {infinite} infinite{}",
            present(&others)
        )
    }
}

/// The rarer kinds that are there, each after a comma.
fn present(kinds: &[(usize, &str)]) -> String {
    let present = kinds.iter().filter(|(count, _)| *count > 0);
    present
        .map(|(count, kind)| format!(", {count} {kind}"))
        .collect()
}

fn text(document: &Document) -> String {
    let Document {
        materials,
        lights,
        camera,
        film,
        ..
    } = document;
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
    let rows: Vec<_> = document
        .trees
        .iter()
        .map(|tree| {
            vec![
                tree.width.to_string(),
                count(tree.nodes as u64),
                count(tree.leaves as u64),
                tree.depth.to_string(),
                format!("{:.1}", tree.bytes as f64 / 1e6),
                format!("{:.3}", tree.build_seconds),
            ]
        })
        .collect();
    let header = ["width", "nodes", "leaves", "depth", "MB", "build s"];
    let trees = draw(&header, &rows);
    format!(
        "{}\n\
         shapes       {} with {} triangles, {} spheres and {} curves; {} degenerate primitives left out\n\
         objects      {} with {} instances; {} triangles are stored\n\
         bounds       {bounds}\n\
         materials    {}\n\
         lights       {}, {} area with {} primitives\n\
         camera       at {:?} towards {:?}, {}, lens radius {}\n\
         film         {} x {} pixels, of them x {} to {} and y {} to {}\n\
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
        materials.text(),
        lights.text(),
        lights.area,
        count(lights.area_primitives as u64),
        camera.position,
        camera.direction,
        camera.view(),
        camera.lens_radius,
        film.resolution[0],
        film.resolution[1],
        film.pixel_bounds[0],
        film.pixel_bounds[1],
        film.pixel_bounds[2],
        film.pixel_bounds[3],
        document.integrator,
        document.spp,
        document.sampler,
        document.load_seconds,
        document.lower_seconds,
        document.tree_seconds,
        document.builder,
    )
}
