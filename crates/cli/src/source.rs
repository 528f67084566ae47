//! From what a scene is called on the command line to a scene that can be rendered.

use std::path::{Path, PathBuf};
use std::time::Instant;

use antumbra::{Builder, Isa, Order, Width};
use antumbra_mesh::{load_gltf, load_obj};
use antumbra_pbrt::Times;
use antumbra_render::{Options, World};
use antumbra_scene::{DirectStrategy, Integrator, Light, Sampler, Scene, builtin};

use crate::args::{IntegratorName, RenderingArgs, Resolution};
use crate::exit::{Failure, say};
use crate::{interrupt, memory, mesh_scene};

/// A scene, and how long it took to read or generate it.
pub struct Loaded {
    pub scene: Scene,
    pub seconds: f64,
    /// What a .pbrt file took its time for.
    pub times: Option<Times>,
    /// The .pbrt files that it was read from, without links and dots.
    files: Vec<PathBuf>,
}

/// The formats a scene may have.
const KNOWN: &str = ".pbrt, .ply, .obj, .gltf, .glb, or builtin:NAME";
/// Notes that are printed; a scene may have thousands of the same kind.
const MOST_NOTES: usize = 5;

/// Reads or generates a scene.
pub fn load(name: &Path) -> Result<Loaded, Failure> {
    let start = Instant::now();
    let mut loaded = match name.to_str().and_then(|name| name.strip_prefix("builtin:")) {
        Some(name) => Loaded::plain(built_in(name)?),
        None if is_pbrt(name) => pbrt(name)?,
        None => Loaded::plain(file(name)?),
    };
    interrupt::check()?;
    memory::check(&loaded.scene)?;
    loaded.seconds = start.elapsed().as_secs_f64();
    Ok(loaded)
}

impl Loaded {
    /// A scene that was not read from .pbrt files.
    fn plain(scene: Scene) -> Self {
        Self {
            scene,
            seconds: 0.0,
            times: None,
            files: Vec::new(),
        }
    }
}

/// Reads all scenes, so that a bad one is found before any work is done. A file that is no scene but a part of
/// another one of them is left out with a note: so all scenes of a folder can be given as `*.pbrt`.
pub fn load_each(names: &[PathBuf]) -> Result<Vec<Loaded>, Failure> {
    let mut all = Vec::<Loaded>::new();
    let mut refused = Vec::new();
    for name in names {
        match load(name) {
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
            Some(loaded) => say(format_args!(
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

/// The same, and applies what the command line says about all of them.
pub fn load_all(names: &[PathBuf], args: &RenderingArgs) -> Result<Vec<Loaded>, Failure> {
    if let Some(samples) = args.spp.filter(|&samples| samples > Sampler::MAX_SAMPLES) {
        let most = Sampler::MAX_SAMPLES;
        return Err(Failure::Usage(format!(
            "--spp {samples} is more than the {most} samples that a pixel may have"
        )));
    }
    let mut all = load_each(names)?;
    if let Some(resolution) = args.resolution {
        for loaded in &mut all {
            loaded.scene.film.resolution = resolution.0;
        }
    }
    if let Some(Resolution([x, y])) = args.resolution
        && let Some(loaded) = all.iter().find(|loaded| loaded.scene.film.is_empty())
    {
        // The scene is good: its readers refuse windows that are empty at its own resolution.
        return Err(Failure::Usage(format!(
            "with {x}x{y} pixels none is inside the crop window {:?} of {}",
            loaded.scene.film.crop_window, loaded.scene.name
        )));
    }
    for loaded in &mut all {
        if let Some(name) = args.integrator {
            choose_integrator(&mut loaded.scene, name);
        }
        if let Some(samples) = args.samples {
            set_samples(&mut loaded.scene, samples)?;
        }
        memory::check_picture(&loaded.scene, args.spp)?;
    }
    Ok(all)
}

/// Has the scene computed in another way, with the settings that pbrt-v3 has by default.
fn choose_integrator(scene: &mut Scene, name: IntegratorName) {
    if name == IntegratorName::of(&scene.integrator) {
        return;
    }
    scene.integrator = match name {
        IntegratorName::Path => Integrator::default(),
        IntegratorName::DirectLighting => Integrator::DirectLighting {
            strategy: DirectStrategy::All,
            max_depth: 5,
        },
        IntegratorName::AmbientOcclusion => Integrator::AmbientOcclusion {
            samples: 64,
            cosine_sampling: true,
        },
    };
}

/// Sets how many shadow rays a point asks for.
fn set_samples(scene: &mut Scene, number: u32) -> Result<(), Failure> {
    match &mut scene.integrator {
        Integrator::AmbientOcclusion { samples, .. } => *samples = number,
        Integrator::DirectLighting { strategy, .. } => {
            *strategy = DirectStrategy::All;
            for shape in &mut scene.shapes {
                if let Some(light) = &mut shape.area_light {
                    light.samples = number;
                }
            }
            for light in &mut scene.lights {
                if let Light::Infinite { samples, .. } = light {
                    *samples = number;
                }
            }
        }
        Integrator::Path { .. } => {
            return Err(Failure::Usage(format!(
                "--samples does not go with the integrator path of {}: it asks one light once at every vertex",
                scene.name
            )));
        }
    }
    Ok(())
}

/// Makes a scene ready for rendering, with the tree of a builder.
pub fn world(scene: &Scene, builder: Builder) -> Result<World, Failure> {
    let world = World::with_builder(scene, builder);
    let world = world.map_err(|error| Failure::scene(&scene.name, error))?;
    interrupt::check()?;
    Ok(world)
}

/// The width that a scene asks for, or what suits the instruction set.
pub fn default_width(scene: &Scene, isa: Isa) -> Width {
    let asked = scene.accelerator.width;
    asked
        .and_then(|width| Width::from_lanes(width.into()))
        .unwrap_or(Width::auto(isa.level()))
}

/// The order that a scene asks for, or the best one.
pub fn default_order(scene: &Scene) -> Order {
    let asked = scene.accelerator.order.as_deref();
    // The reader was given the names of all orders, so that there are no others.
    asked
        .and_then(|name| name.parse().ok())
        .unwrap_or(Options::default().order)
}

fn built_in(name: &str) -> Result<Scene, Failure> {
    builtin::by_name(name).ok_or_else(|| {
        let known: Vec<_> = builtin::ALL
            .iter()
            .map(|scene| format!("builtin:{}[:TRIANGLES]", scene.name))
            .collect();
        let known = known.join(", ");
        Failure::Usage(format!("there is no builtin:{name}; there is {known}"))
    })
}

fn is_pbrt(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("pbrt"))
}

/// A scene that is not written in pbrt's language.
fn file(path: &Path) -> Result<Scene, Failure> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    match extension.to_ascii_lowercase().as_str() {
        "ply" => {
            let mesh = antumbra_pbrt::load_ply(path).map_err(bad_file)?;
            Ok(mesh_scene::scene(stem(path), mesh))
        }
        "obj" => {
            let mesh = load_obj(path, memory::allowed()).map_err(bad_mesh)?;
            Ok(mesh_scene::scene(stem(path), mesh))
        }
        "gltf" | "glb" => {
            let (shapes, materials) = load_gltf(path, memory::allowed()).map_err(bad_mesh)?;
            Ok(mesh_scene::lit(stem(path), shapes, materials))
        }
        _ => Err(Failure::Usage(format!(
            "{}: unknown scene format `{extension}`; known are {KNOWN}",
            path.display()
        ))),
    }
}

fn pbrt(path: &Path) -> Result<Loaded, Failure> {
    let orders = Order::ALL.map(Order::name);
    let options = antumbra_pbrt::Options {
        orders: &orders,
        max_memory: Some(memory::allowed()),
    };
    let loaded = antumbra_pbrt::load(path, &options).map_err(bad_file)?;
    for note in loaded.notes.iter().take(MOST_NOTES) {
        say(format_args!("{note}"));
    }
    if loaded.notes.len() > MOST_NOTES {
        let more = loaded.notes.len() - MOST_NOTES;
        say(format_args!("and {more} more notes"));
    }
    Ok(Loaded {
        scene: loaded.scene,
        seconds: 0.0,
        times: Some(loaded.times),
        files: loaded.files,
    })
}

fn bad_file(error: antumbra_pbrt::Error) -> Failure {
    Failure::Scene(match &error {
        // Its text says `error` at every mistake.
        antumbra_pbrt::Error::Scene(mistakes) => mistakes.to_string(),
        _ => format!("error: {error}"),
    })
}

/// Its text says `error` at every mistake.
fn bad_mesh(error: antumbra_mesh::Error) -> Failure {
    Failure::Scene(error.to_string())
}

fn stem(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}
