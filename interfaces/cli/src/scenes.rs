//! Scenes that the command line names.

use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use antumbra::recipe::{Builder, Engine, Order};
use antumbra::{BuildMonitor, Isa, Ray};
use antumbra_image::{Allowance, Raster, Samples};
use antumbra_lab::count;
use antumbra_load::{
    Diagnostic, Extent, Heights, Loaded, MemorySize, Options, Severity, Sky, Stage, Tiles, Up,
    Upright, Warning, check_picture,
};
use antumbra_raster::{Crs, Grid, unit_name};
use antumbra_render::{Camera, World};
use antumbra_scene::{Image, Pixels, Projection, Sampler, Scene};
use antumbra_trees::ORDERS;
use glam::DVec3;

use crate::args::{CameraArgs, PictureArgs, PoseArgs};
use crate::exit::{self, Failure, say, tell};
use crate::{interrupt, output, progress};

/// Name of the standard input.
pub const STDIN: &str = "-";

/// Notes and warnings that are printed; a scene may have thousands of the same kind.
const MOST_NOTES: usize = 5;

/// Whether warnings about files are errors: `--strict`.
static STRICT: AtomicBool = AtomicBool::new(false);

/// Whether unsupported features of .pbrt files are left out: `--skip-unsupported`.
static SKIP: AtomicBool = AtomicBool::new(false);

/// Sets whether warnings about files are errors, and whether unsupported features are left out, for every scene that is read from
/// then on.
pub fn set_tolerance(strict: bool, skip_unsupported: bool) {
    STRICT.store(strict, Ordering::Relaxed);
    SKIP.store(skip_unsupported, Ordering::Relaxed);
}

/// Options of readers, with the tolerance that was set.
fn options(max_memory: MemorySize, looks: bool, origin: Option<DVec3>) -> Options {
    Options {
        origin,
        max_memory,
        looks,
        strict: STRICT.load(Ordering::Relaxed),
        skip_unsupported: SKIP.load(Ordering::Relaxed),
        orders: ORDERS.map(Order::name).to_vec(),
    }
}

/// Reads or generates a scene for a job that uses no materials, and prints the reader's warnings and notes.
pub fn load(name: &Path, max_memory: MemorySize) -> Result<Loaded, Failure> {
    load_one(&[name.to_path_buf()], max_memory, None)
}

/// As [`load`], perhaps of several height rasters that are one scene, perhaps with positions that are measured from here.
pub fn load_one(
    names: &[PathBuf],
    max_memory: MemorySize,
    origin: Option<DVec3>,
) -> Result<Loaded, Failure> {
    read(names, max_memory, (false, origin))
}

/// As [`load`], with positions that are measured from here, and without a word.
pub fn load_from(name: &Path, origin: DVec3, max_memory: MemorySize) -> Result<Loaded, Failure> {
    interrupt::check()?;
    let options = options(max_memory, false, Some(origin));
    Ok(antumbra_load::load(name, &options)?)
}

/// Reads or generates a scene with its materials, and prints the reader's warnings and notes.
pub fn load_with_looks(name: &Path, max_memory: MemorySize) -> Result<Loaded, Failure> {
    read(&[name.to_path_buf()], max_memory, (true, None))
}

fn read(
    names: &[PathBuf],
    max_memory: MemorySize,
    (looks, origin): (bool, Option<DVec3>),
) -> Result<Loaded, Failure> {
    let name = &names[0];
    let reading = progress::doing(&name.to_string_lossy(), "reading");
    let options = options(max_memory, looks, origin);
    let loaded = match name == Path::new(STDIN) {
        true => antumbra_load::load_text(standard_input(max_memory)?, &options),
        false => antumbra_load::load_all(names, &options),
    };
    drop(reading);
    interrupt::check()?;
    let loaded = loaded?;
    let most = match exit::is_verbose() {
        true => usize::MAX,
        false => MOST_NOTES,
    };
    for warning in loaded.warnings.iter().take(most) {
        tell(format_args!("{warning}"));
    }
    if loaded.warnings.len() > most {
        let more = loaded.warnings.len() - most;
        tell(format_args!("and {more} more warnings; -v shows all"));
    }
    // Every feature that is left out is named.
    let is_warning = |note: &&Diagnostic| note.severity == Severity::Warning;
    for warning in loaded.notes.iter().filter(is_warning) {
        tell(format_args!("{warning}"));
    }
    let notes = || loaded.notes.iter().filter(|note| !is_warning(note));
    for note in notes().take(most) {
        tell(format_args!("{note}"));
    }
    if notes().count() > most {
        let more = notes().count() - most;
        tell(format_args!("and {more} more notes; -v shows all"));
    }
    for feature in &loaded.left_out {
        tell(format_args!("note: {}: {feature}", name.display()));
    }
    let grid = loaded.raster.as_ref().map(|raster| &raster.grid);
    tell_tiles(name, loaded.tiles.zip(grid));
    Ok(loaded)
}

/// Says what several files are that are one raster.
fn tell_tiles(name: &Path, found: Option<(Tiles, &Grid)>) {
    let Some((tiles, grid)) = found else {
        return;
    };
    let (name, width, height) = (name.display(), grid.width, grid.height);
    let mut text = format!(
        "{name}: {} files are one raster of {width} x {height} cells",
        tiles.files
    );
    if tiles.differing > 0 {
        let which = if tiles.is_last_above { "last" } else { "first" };
        let cells = count(tiles.differing);
        text += &format!("; in {cells} of them files differ, and the {which} one has them");
    }
    if tiles.empty > 0 {
        text += &format!("; in {} of them no file has data", count(tiles.empty));
    }
    tell(format_args!("{text}"));
}

/// Prints warnings about a file, which are errors if tolerance says so.
pub fn tell_warnings(warnings: &[Warning]) -> Result<(), Failure> {
    if STRICT.load(Ordering::Relaxed) && !warnings.is_empty() {
        return Err(antumbra_load::Error::Strict(warnings.to_vec()).into());
    }
    for warning in warnings {
        tell(format_args!("{warning}"));
    }
    Ok(())
}

/// Reads height rasters as one without making a mesh of it, and prints the reader's warnings.
pub fn load_heights(names: &[PathBuf], max_memory: MemorySize) -> Result<Heights, Failure> {
    let reading = progress::doing(&names[0].to_string_lossy(), "reading");
    let heights = antumbra_load::load_heights(names, &options(max_memory, false, None));
    drop(reading);
    interrupt::check()?;
    let heights = heights?;
    tell_warnings(&heights.warnings)?;
    tell_tiles(&names[0], heights.tiles.zip(Some(&heights.raster.grid)));
    Ok(heights)
}

/// The standard input, as far as memory allows.
fn standard_input(max_memory: MemorySize) -> Result<Vec<u8>, Failure> {
    let mut text = Vec::new();
    let limit = max_memory.bytes() / 2;
    let read = io::stdin().lock().take(limit + 1).read_to_end(&mut text);
    read.map_err(|error| Failure::Data(format!("cannot read the standard input: {error}")))?;
    match text.len() as u64 > limit {
        true => Err(Failure::Data(format!(
            "the standard input is longer than memory allows: {max_memory}; allow more with --max-memory"
        ))),
        false => Ok(text),
    }
}

/// Reads all scenes, so that a bad one is found before any work is done.
///
/// A file that is no scene but a part of another one of them is left out with a note: all scenes of a folder can be
/// given as `*.pbrt`.
pub fn load_each(names: &[PathBuf], max_memory: MemorySize) -> Result<Vec<Loaded>, Failure> {
    let mut all = Vec::<Loaded>::new();
    let mut refused = Vec::new();
    for name in names {
        match load_with_looks(name, max_memory) {
            Ok(loaded) => all.push(loaded),
            Err(Failure::Scene(text)) => refused.push((name, text)),
            Err(failure) => return Err(failure),
        }
    }
    let mut mistakes = Vec::new();
    for (name, text) in refused {
        let path = name.canonicalize();
        let whole = all.iter().find(|loaded| {
            let path = path.as_ref();
            path.is_ok_and(|path| loaded.files.contains(path))
        });
        match whole {
            Some(loaded) => tell(format_args!(
                "note: {} is a part of {} and no scene by itself; left out",
                name.display(),
                loaded.scene.name
            )),
            None => mistakes.push(text),
        }
    }
    if mistakes.is_empty() {
        Ok(all)
    } else {
        Err(Failure::Scene(mistakes.join("\n")))
    }
}

/// Reads all scenes, and applies what the command line says about their pictures.
pub fn load_all(
    names: &[PathBuf],
    args: &PictureArgs,
    max_memory: MemorySize,
) -> Result<Vec<Loaded>, Failure> {
    if let Some(samples) = args.spp.filter(|&samples| samples > Sampler::MAX_SAMPLES) {
        let most = Sampler::MAX_SAMPLES;
        return Err(Failure::Usage(format!(
            "--spp {samples} is more than the {most} samples that a pixel may have"
        )));
    }
    let mut all = load_each(names, max_memory)?;
    for Loaded {
        scene,
        stage,
        up,
        inputs,
        ..
    } in &mut all
    {
        if let Some(resolution) = args.resolution {
            antumbra_load::set_resolution(scene, resolution.0)?;
            if let Some(own) = stage {
                // Another shape of picture is filled by another camera.
                let stage = Stage {
                    up: up.axis,
                    ..Stage::default()
                };
                antumbra_load::set_stage(scene, *own, &stage);
            }
        }
        if let Some(kind) = args.integrator {
            antumbra_load::choose_integrator(scene, kind);
        }
        // Scenes of pbrt keep its scale, which goes to pi.
        let is_pbrt = |path: &PathBuf| path.extension().is_some_and(|name| name == "pbrt");
        let is_mesh = !inputs.is_empty() && !inputs.iter().any(is_pbrt);
        antumbra_load::set_ambient(scene, args.ao_distance, is_mesh.then_some(1.0))?;
        if let Some(samples) = args.samples {
            antumbra_load::set_samples(scene, samples)?;
        }
        check_picture(scene, args.spp, false, max_memory)?;
    }
    Ok(all)
}

/// Applies what the command line says about camera, film and light, and says what was read.
fn apply_camera(loaded: &mut Loaded, args: &CameraArgs) -> Result<(), Failure> {
    let asked = [
        ("--environment", args.environment.is_some()),
        ("--sun", args.sun.is_some()),
        ("--ground", args.ground),
    ];
    if let (None, Some((flag, _))) = (loaded.stage, asked.iter().find(|(_, given)| *given)) {
        return Err(only_for_meshes(&loaded.scene, flag));
    }
    let stage = Stage {
        sun: args.sun,
        sky: args.environment.as_deref().map(sky).transpose()?,
        ..Stage::default()
    };
    pose(loaded, &args.pose, stage)?;
    let environment = args.environment.iter().filter(|path| !is_none(path));
    loaded.inputs.extend(environment.cloned());
    let scene = &mut loaded.scene;
    if let Some(depth) = args.max_depth {
        antumbra_load::set_max_depth(scene, depth)?;
    }
    if let Some(filter) = args.filter {
        scene.film.filter = filter.filter();
    }
    if let Some(sampler) = args.sampler {
        scene.sampler.kind = sampler.kind();
    }
    // The ground is no part of what was read.
    tell_read(loaded, args.pose.up);
    if args.ground {
        let up = args.pose.up.unwrap_or(loaded.up.axis);
        antumbra_load::set_ground(&mut loaded.scene, up);
    }
    Ok(())
}

/// Reads one scene, and applies what the command line says about its picture, camera, film and light.
pub fn load_picture(
    name: &PathBuf,
    picture: &PictureArgs,
    camera: &CameraArgs,
    max_memory: MemorySize,
) -> Result<Loaded, Failure> {
    let all = load_all(std::slice::from_ref(name), picture, max_memory)?;
    let loaded = all.into_iter().next();
    let mut loaded = loaded.ok_or_else(|| Failure::work("no scene"))?;
    apply_camera(&mut loaded, camera)?;
    Ok(loaded)
}

/// Applies what the command line says about the camera.
pub fn apply_pose(loaded: &mut Loaded, args: &PoseArgs) -> Result<(), Failure> {
    pose(loaded, args, Stage::default())
}

/// Moves the camera. Meshes get the stage, turned and framed as the command line says.
fn pose(loaded: &mut Loaded, args: &PoseArgs, stage: Stage) -> Result<(), Failure> {
    let scene = &mut loaded.scene;
    match loaded.stage {
        Some(own) => {
            let stage = Stage {
                up: args.up.unwrap_or(loaded.up.axis),
                fov: args.fov,
                ..stage
            };
            antumbra_load::set_stage(scene, own, &stage);
        }
        None if args.up.is_some() => return Err(only_for_meshes(scene, "--up")),
        None => {}
    }
    if let Some(fov) = args.fov {
        if scene.camera.projection != Projection::Perspective {
            let name = &scene.name;
            let reason = format!("--fov is for perspective cameras: {name} has another one");
            return Err(Failure::Usage(reason));
        }
        scene.camera.fov = fov;
    }
    if let Some(look) = &args.camera {
        antumbra_load::set_camera(scene, look).map_err(wrong_flag)?;
    }
    if let Some(crop) = args.crop {
        antumbra_load::set_crop(scene, crop).map_err(wrong_flag)?;
    }
    Ok(())
}

/// A flag that fits no scene, or not this one, is no mistake in the scene.
fn wrong_flag(error: antumbra_load::Error) -> Failure {
    Failure::Usage(error.to_string())
}

fn only_for_meshes(scene: &Scene, flag: &str) -> Failure {
    let name = &scene.name;
    let reason = format!("{flag} is for meshes: {name} has its own camera and lights");
    Failure::Usage(reason)
}

/// Whether a name stands for no image.
fn is_none(path: &Path) -> bool {
    path.as_os_str() == "none"
}

/// Sky by an image, or darkness.
fn sky(path: &Path) -> Result<Sky, Failure> {
    if is_none(path) {
        return Ok(Sky::None);
    }
    let raster = Raster::read_within(path, &Allowance::new(antumbra_guard::limit()))?;
    let (width, height) = (raster.width(), raster.height());
    let pixels = match raster.into_samples() {
        Samples::Grey8(values) => Pixels::Grey8(values),
        Samples::Rgb8(values) => Pixels::Rgb8(values),
        Samples::Rgb32(mut values) => {
            clear_impossible(&mut values, path);
            Pixels::Rgb32(values)
        }
    };
    let name = output::text(path);
    Ok(Sky::Image(Arc::new(Image {
        name,
        width,
        height,
        pixels,
    })))
}

/// Makes texels black that are no light. Lossy formats leave negative ones around small suns.
fn clear_impossible(values: &mut [[f32; 3]], path: &Path) {
    let mut count = 0;
    for value in values.iter_mut() {
        let good = |x: &f32| x.is_finite() && *x >= 0.0;
        if !value.iter().all(good) {
            count += 1;
            *value = value.map(|x| if good(&x) { x } else { 0.0 });
        }
    }
    if count > 0 {
        let path = path.display();
        say(format_args!(
            "warning: {path}: {count} texels have values that are negative or not finite; they count as 0"
        ));
    }
}

/// Says what was read: how large it is, which way is up and why, and where it lies. `asked` is the axis that the user wants.
pub fn tell_read(loaded: &Loaded, asked: Option<Up>) {
    let scene = &loaded.scene;
    let Some(extent) = Extent::of(scene) else {
        return;
    };
    let up = asked.map_or(loaded.up, |axis| Upright {
        axis,
        reason: "as --up has it",
    });
    let [x, y, z] = extent.size().to_array().map(rounded);
    let place = match scene.origin.to_array() {
        [0.0, 0.0, 0.0] => String::new(),
        [x, y, z] => format!("; measured from {x} {y} {z}"),
    };
    let raster = loaded.raster.as_ref();
    let unit = unit(raster.and_then(|raster| raster.grid.crs.as_ref()));
    tell(format_args!(
        "{}: {x} x {y} x {z} {unit} (x, y, z); {} is up, {}; {} triangles{place}",
        scene.name,
        up.axis,
        up.reason,
        count(scene.triangle_count() as u64),
    ));
    if let Some(other) = up.doubt(&extent).filter(|_| loaded.stage.is_some()) {
        say(format_args!(
            "warning: {}: {other} is by far the shortest side; if that is up, say --up {other}",
            scene.name
        ));
    }
}

/// Name of the unit of a coordinate system.
pub fn unit(crs: Option<&Crs>) -> String {
    crs.and_then(Crs::metres)
        .map_or("units".to_owned(), unit_name)
}

/// A length with four digits.
pub fn rounded(length: f64) -> f64 {
    format!("{length:.3e}").parse().unwrap_or(length)
}

/// Makes a scene ready for rendering, with the tree of a builder.
pub fn world(scene: &Scene, builder: Builder) -> Result<World, Failure> {
    let building = progress::doing(&scene.name, "building the tree");
    let world = World::with_builder_monitored(scene, builder, &UntilInterrupted);
    drop(building);
    interrupt::check()?;
    world.map_err(|error| Failure::scene(&scene.name, error))
}

/// Warns if the camera sees no surface. `world` is the one of the scene.
pub fn warn_of_nothing(scene: &Scene, world: &World, isa: Isa) {
    let Ok(camera) = Camera::new(&scene.camera, &scene.film) else {
        return;
    };
    let bvh = world.bvh(Engine::of(isa));
    let [x0, x1, y0, y1] = scene.film.pixel_bounds().map(|edge| edge as i32);
    let sees = (y0..y1).any(|y| {
        let row = (x0..x1).map(|x| camera.ray([x as f32 + 0.5, y as f32 + 0.5], [0.5; 2]));
        let rays: Vec<Ray> = row.collect();
        let hits = bvh.batch(&rays).intersect();
        hits.iter().any(Option::is_some)
    });
    if !sees {
        say(format_args!(
            "warning: {}: the camera sees no surface, so the picture is all background",
            scene.name
        ));
    }
}

/// Stops a build after a signal.
struct UntilInterrupted;

impl BuildMonitor for UntilInterrupted {
    fn cancelled(&self) -> bool {
        interrupt::requested()
    }
}
