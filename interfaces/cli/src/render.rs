//! `antumbra render`: one scene, one image.

mod document;

use std::path::{Path, PathBuf};

use antumbra::recipe::{Builder, Order};
use antumbra::{Isa, Recipe};
use antumbra_load::{Loaded, MemorySize, check_picture, file_stem};
use antumbra_render::{Error, Lesson, Options, Place, Shard, Snapshot, Task, World, render_task};
use antumbra_scene::Scene;
use document::{Document, summarise};

use crate::args::{RenderArgs, usual};
use crate::checkpoint::{KEEP, Keeper};
use crate::exit::{Failure, tell};
use crate::json::Destination;
use crate::looks::{self, Looks};
use crate::output::Files;
use crate::until::{self, Grown, Until};
use crate::{archive, checkpoint, interrupt, json, layers, output, scenes};

pub use document::hash_text;

/// Extension of the parts of a picture.
const PART: &str = "part";

/// Runs the command.
pub fn run(args: &RenderArgs, memory: MemorySize) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    check_names(args)?;
    let mut files = Files::default();
    for (flag, path) in named_files(args) {
        files.writes(flag, path)?;
    }
    if let Some(path) = &args.output {
        declare_beside(path, args, &mut files)?;
    }
    files.reads("the scene", &args.scene)?;
    if let Some(path) = &args.load_order {
        files.reads("the order", path)?;
    }
    files.check()?;
    args.machine.start_threads()?;
    let checkpoint = args.output.as_deref().and_then(checkpoint::beside);
    let checkpoint = checkpoint.filter(|path| !args.restart && path.exists());
    if let Some(path) = &checkpoint {
        interrupt::goes_on_from(path);
    }
    match attempt(args, isa, memory, files) {
        // Before the rendering itself began: what earlier runs did is still there.
        Err(Failure::Interrupted) => {
            Err(checkpoint.map_or(Failure::Interrupted, Failure::Continuable))
        }
        outcome => outcome,
    }
}

fn attempt(
    args: &RenderArgs,
    isa: Isa,
    memory: MemorySize,
    mut files: Files,
) -> Result<(), Failure> {
    let (loaded, file) = read(args, memory, &mut files)?;
    let (scene, seconds, is_invisible) = (loaded.scene, loaded.seconds, loaded.is_invisible);
    let recipe = args.tree.recipe(&scene, isa);
    let (order, builder) = (recipe.order, recipe.builder);
    let until = Until::of(&args.until);
    let mut options = options(args, recipe, until);
    output::check_room(&file, room(&scene, args))?;
    let looks = Looks::begin(args, &scene, &file)?;
    let asked = options.clone();
    let every = args.checkpoint_every.0;
    let keeper = Keeper::new(&scene, &asked, &file, every, args.save_order.as_deref());
    let keeper = keeper.with_looks(looks).growing(until.is_some());
    let lesson = lesson(args, &scene, order)?;
    let spp = options.spp.unwrap_or(scene.sampler.pixel_samples);
    let earlier = earlier(args, until, &keeper, &file, spp)?;
    if earlier.is_complete {
        tell(format_args!("{} is complete already", file.display()));
        return keeper.ended(keeper.discard());
    }
    let mut resume = earlier.samples;
    // A tree for the scene's own rays has to wait for them.
    let first = if builder.needs_rays() {
        Builder::BinnedSah
    } else {
        builder
    };
    let world = scenes::world(&scene, first)?;
    if until.is_none() {
        resume = resume.and_then(|found| extended(found, &world, spp));
    }
    let resumed = resume.as_ref().map(Snapshot::finished);
    let task = Task {
        shard: args.shard.unwrap_or_default(),
        resume,
        lesson,
        extendable: args.keep_samples,
    };
    let grown = match grown(args, until, &world, &mut options, task, &keeper) {
        Err(Error::Cancelled) => return keeper.ended(Err(keeper.interrupted())),
        grown => grown?,
    };
    // Surfaces that light reaches send shadow rays. A warning about the file says enough.
    if grown.rendering.stats.shadow_rays == 0 && args.shard.is_none() && !is_invisible {
        scenes::warn_of_nothing(&scene, &world, isa);
    }
    let document = Document {
        resumed_tiles: resumed,
        noise: until::noise(&grown.rendering),
        render_seconds: grown.seconds,
        ..Document::new(
            args,
            &scene,
            &world,
            &grown.rendering,
            &options,
            &file,
            seconds,
        )
    };
    let of = (&scene, &world, &options);
    keeper.ended(complete(args, of, &grown, &document, (&file, &keeper)))
}

/// Writes everything there is to write, during which no signal ends the program, and says how it went.
fn complete(
    args: &RenderArgs,
    of: (&Scene, &World, &Options),
    grown: &Grown,
    document: &Document<'_>,
    (file, keeper): (&Path, &Keeper<'_>),
) -> Result<(), Failure> {
    let _writing = interrupt::writing();
    keeper.finish();
    keeper.keep_finished(&grown.snapshot);
    write(args, of, grown, document, (file, keeper))?;
    let outcome = if grown.interrupted {
        Err(keeper.interrupted_after(&grown.snapshot))
    } else if args.keep_samples {
        keeper.keep(&grown.snapshot)
    } else {
        keeper.discard()
    };
    if outcome.is_ok() || grown.interrupted {
        summarise(document, &grown.rendering.stats.split);
    }
    outcome
}

/// Reads the scene, and finds the name of the output.
fn read(
    args: &RenderArgs,
    memory: MemorySize,
    files: &mut Files,
) -> Result<(Loaded, PathBuf), Failure> {
    let mut loaded = scenes::load_one(&args.scene, &args.picture, memory)?;
    scenes::apply_camera(&mut loaded, &args.camera)?;
    let scene = &loaded.scene;
    if args.layers {
        check_picture(scene, args.picture.spp, true, memory)?;
    }
    let file = match &args.output {
        Some(path) => path.clone(),
        None => {
            let path = default_output(scene, args.shard);
            files.writes("the image", &path)?;
            declare_beside(&path, args, files)?;
            if !args.overwrite {
                output::check_own(&path, "name an output with -o, or give --overwrite")?;
            }
            path
        }
    };
    files.reads_all(&loaded.inputs)?;
    files.check()?;
    Ok((loaded, file))
}

/// Options of the rendering.
fn options(args: &RenderArgs, recipe: Recipe, until: Option<Until>) -> Options {
    Options {
        spp: args.picture.spp,
        seed: args.picture.seed,
        texture_spp: until.is_some().then_some(until::TEXTURES),
        standard_error: args.stderr_image.is_some()
            || args.layers
            || until.is_some_and(|until| until.needs_errors()),
        recipe,
        ..Options::default()
    }
}

/// Work of an earlier run.
#[derive(Default)]
struct Earlier {
    /// Whether the requested part is there.
    is_complete: bool,
    /// Samples to go on from, if there are any.
    samples: Option<Snapshot>,
}

/// Looks for work of an earlier run.
fn earlier(
    args: &RenderArgs,
    until: Option<Until>,
    keeper: &Keeper<'_>,
    file: &Path,
    spp: u32,
) -> Result<Earlier, Failure> {
    if args.restart {
        return Ok(Earlier::default());
    }
    let shard = args.shard.unwrap_or_default();
    if until.is_some() {
        let resume = keeper.resume(shard)?;
        let most = args.picture.spp.unwrap_or(u32::MAX);
        if let Some(found) = resume.as_ref().filter(|found| found.spp() > most) {
            return Err(Failure::Usage(format!(
                "the checkpoint has {} samples per pixel, more than --spp {most}; --restart forgets it",
                found.spp()
            )));
        }
        return Ok(Earlier {
            samples: resume,
            ..Earlier::default()
        });
    }
    let part = match args.shard {
        Some(shard) => keeper.finished_part(file, shard)?,
        None => None,
    };
    if part.as_ref().is_some_and(|part| part.spp() == spp)
        && (args.resume || !has_further_outputs(args))
    {
        return Ok(Earlier {
            is_complete: true,
            ..Earlier::default()
        });
    }
    Ok(Earlier {
        samples: keeper.resume(shard)?.or(part),
        ..Earlier::default()
    })
}

/// Renders a task, or until a limit is reached.
fn grown(
    args: &RenderArgs,
    until: Option<Until>,
    world: &World,
    options: &mut Options,
    task: Task,
    keeper: &Keeper<'_>,
) -> Result<Grown, Error> {
    if let Some(until) = until {
        return until::render(world, options, args.picture.spp, until, keeper, task.resume);
    }
    let before = task.resume.as_ref().map_or(0.0, Snapshot::seconds);
    let (rendering, snapshot) = render_task(world, options, task, keeper)?;
    Ok(Grown {
        seconds: before + rendering.stats.render_seconds,
        rendering,
        snapshot,
        interrupted: false,
    })
}

/// Writes all outputs. If that fails, the samples are kept.
fn write(
    args: &RenderArgs,
    (scene, world, options): (&Scene, &World, &Options),
    grown: &Grown,
    document: &Document<'_>,
    (file, keeper): (&Path, &Keeper<'_>),
) -> Result<(), Failure> {
    let (rendering, snapshot) = (&grown.rendering, &grown.snapshot);
    let written = match args.shard {
        None if args.layers || args.metadata => {
            layers::write(args, scene, world, rendering, options, file)
        }
        None => {
            let usual = usual(scene.integrator.is_light());
            args.display.write(&rendering.image, file, usual)
        }
        Some(_) => keeper.write_part(file, snapshot),
    };
    let written = written.and_then(|()| {
        if let (Some(path), Some(image)) = (&args.stderr_image, &rendering.standard_error) {
            image.write(path)?;
        }
        json::write(document, args.json.as_ref())
    });
    written.map_err(|failure| keeper.rescue(snapshot, failure))
}

/// Notes the files that a rendering writes beside its output.
fn declare_beside(output: &Path, args: &RenderArgs, files: &mut Files) -> Result<(), Failure> {
    checkpoint::declare(output, files)?;
    if args.keep_samples && checkpoint::beside(output).is_none() {
        let output = output.display();
        let reason = format!("{KEEP}: there is no place beside {output} for samples");
        return Err(Failure::Usage(reason));
    }
    if !args.preview {
        return Ok(());
    }
    let Some(path) = looks::preview(output) else {
        let output = output.display();
        let reason = format!("--preview: there is no place beside {output} for a preview");
        return Err(Failure::Usage(reason));
    };
    files.writes("--preview", &path)?;
    output::check_own(&path, "take --preview or the file away")
}

/// The state to go on from: a finished picture of fewer samples is extended. `None` if it cannot be.
fn extended(found: Snapshot, world: &World, spp: u32) -> Option<Snapshot> {
    let fewer = found.spp();
    if fewer == spp {
        return Some(found);
    }
    match found.extend(world, spp) {
        Ok(extended) => {
            tell(format_args!("goes on from {fewer} samples per pixel"));
            Some(extended)
        }
        Err(error) => {
            tell(format_args!(
                "note: the {fewer} samples per pixel that are there cannot be used: {error}; \
                 the rendering starts afresh"
            ));
            None
        }
    }
}

/// Training rays given in a file, if there is one.
fn lesson(args: &RenderArgs, scene: &Scene, order: Order) -> Result<Option<Lesson>, Failure> {
    let flags = [
        ("--save-order", &args.save_order),
        ("--load-order", &args.load_order),
    ];
    if let Some((flag, _)) = flags.iter().find(|(_, path)| path.is_some())
        && order.log_kind().is_none()
    {
        let reason = format!("{flag} does not go with order {order}, which learns nothing");
        return Err(Failure::Usage(reason));
    }
    let Some(path) = &args.load_order else {
        return Ok(None);
    };
    let Some(bytes) = archive::read(path)? else {
        return Err(Failure::Usage(format!("there is no {}", path.display())));
    };
    let (place, lesson) =
        Lesson::from_bytes(&bytes).map_err(|error| Failure::refused(path, &error))?;
    match place.difference(&Place::new(scene)) {
        None => Ok(Some(lesson)),
        Some(reason) => Err(Failure::Usage(format!("{}: {reason}", path.display()))),
    }
}

/// Bytes that the output may take: the size of an uncompressed image, or of the sums of a shard,
/// whose tiles overlap a little.
fn room(scene: &Scene, args: &RenderArgs) -> u64 {
    let [x0, x1, y0, y1] = scene.film.pixel_bounds().map(u64::from);
    let pixels = (x1 - x0) * (y1 - y0);
    match args.shard {
        None => 12 * pixels,
        Some(shard) if args.stderr_image.is_some() => 104 * pixels / u64::from(shard.count()),
        Some(shard) => 40 * pixels / u64::from(shard.count()),
    }
}

/// Refuses names that cannot be meant, before anything is read.
fn check_names(args: &RenderArgs) -> Result<(), Failure> {
    args.display.check()?;
    let is_exr = |path: &Path| {
        output::is_stream(path)
            || path
                .extension()
                .is_some_and(|name| name.eq_ignore_ascii_case("exr"))
    };
    if let Some(path) = args.output.as_deref().filter(|path| !is_exr(path))
        && (args.layers || args.metadata)
    {
        let flag = if args.layers {
            "--layers"
        } else {
            "--metadata"
        };
        let path = path.display();
        return Err(Failure::Usage(format!("{path}: {flag} needs an .exr")));
    }
    let is_part = |path: &Path| {
        let extension = path.extension();
        extension.is_some_and(|extension| extension.eq_ignore_ascii_case(PART))
            || output::is_stream(path)
    };
    if args.shard.is_some() {
        if let Some(path) = args.output.as_deref().filter(|path| !is_part(path)) {
            let path = path.display();
            let reason = format!("{path}: a shard is written as a .{PART}, for merge");
            return Err(Failure::Usage(reason));
        }
        check_image_names(None, args.stderr_image.as_deref())?;
    } else {
        check_image_names(args.output.as_deref(), args.stderr_image.as_deref())?;
    }
    Ok(())
}

/// Refuses names of images that cannot be written.
pub fn check_image_names(image: Option<&Path>, errors: Option<&Path>) -> Result<(), Failure> {
    if let Some(path) = image
        && !is_writable_format(path)
        && !output::is_stream(path)
    {
        let known: Vec<_> = antumbra_image::writable_extensions().collect();
        return Err(Failure::Usage(format!(
            "{}: images are written as {}",
            path.display(),
            known.join(" or ")
        )));
    }
    if let Some(path) = errors
        && path
            .extension()
            .is_none_or(|extension| !extension.eq_ignore_ascii_case("exr"))
        && !output::is_stream(path)
    {
        return Err(Failure::Usage(format!(
            "{}: standard errors are written as exr",
            path.display()
        )));
    }
    Ok(())
}

/// The outputs that the command line names, after their flags.
fn named_files(args: &RenderArgs) -> Vec<(&'static str, &Path)> {
    let named = [
        ("--output", args.output.as_deref()),
        ("--stderr-image", args.stderr_image.as_deref()),
        ("--save-order", args.save_order.as_deref()),
        ("--json", args.json.as_ref().map(Destination::path)),
    ];
    let named = named.into_iter();
    named
        .filter_map(|(flag, path)| Some((flag, path?)))
        .collect()
}

/// Whether more than a part is requested.
fn has_further_outputs(args: &RenderArgs) -> bool {
    args.json.is_some() || args.stderr_image.is_some() || args.save_order.is_some()
}

fn is_writable_format(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    antumbra_image::writable_extensions().any(|known| extension.eq_ignore_ascii_case(known))
}

/// The name that the scene gives its film, or the scene's own, in the current directory; the name of a shard says
/// which one it is.
fn default_output(scene: &Scene, shard: Option<Shard>) -> PathBuf {
    let image = default_image(scene);
    match shard {
        None => image,
        Some(shard) => {
            let mut name = image.file_stem().unwrap_or_default().to_owned();
            name.push(format!(".{}-of-{}.{PART}", shard.index(), shard.count()));
            name.into()
        }
    }
}

fn default_image(scene: &Scene) -> PathBuf {
    let film = scene.film.file_name.as_deref().map(Path::new);
    let path = film
        .and_then(Path::file_name)
        .map_or_else(|| file_stem(&scene.name).into(), PathBuf::from);
    if is_writable_format(&path) {
        path
    } else if film.is_some() {
        path.with_extension("exr")
    } else {
        // Not `with_extension`: a dot in a scene's name is no extension.
        let mut name = path.into_os_string();
        name.push(".exr");
        name.into()
    }
}
