//! `antumbra render`: one scene, one image.
//!
//! The steps of the command, each in a file of its own: `names`: what is read and written, before anything is;  `start`: options and
//! training rays;  `earlier`: samples to go on from;  `until`: the rendering, in steps if its end is not known;  `finish`: outputs,
//! with `layers` and the `document`. `checkpoint` and `looks` are what is kept and shown of it meanwhile.

mod checkpoint;
mod document;
mod earlier;
mod finish;
mod layers;
mod looks;
mod names;
mod start;
mod until;

use antumbra::Isa;
use antumbra_load::MemorySize;
use antumbra_render::{Error, Snapshot, Task};

use crate::args::RenderArgs;
use crate::exit::{Failure, tell};
use crate::output::{self, Files};
use crate::{interrupt, scenes};
use checkpoint::Keeper;
use document::Document;
use earlier::Earlier;
use looks::Looks;
use until::Until;

pub use document::hash_text;
pub use names::check_image_names;

/// Runs the command.
pub fn run(args: &RenderArgs, memory: MemorySize) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    let files = names::declare(args)?;
    args.machine.start_threads()?;
    let checkpoint = args.output.as_deref().and_then(output::checkpoint);
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
    let loaded = scenes::load_picture(&args.scene, &args.picture, &args.camera, memory)?;
    let file = names::settle(args, &loaded, memory, &mut files)?;
    let (scene, seconds, is_invisible) = (loaded.scene, loaded.seconds, loaded.is_invisible);
    let recipe = args.tree.recipe(&scene, isa);
    let until = Until::of(&args.until);
    let mut options = start::options(args, recipe, until);
    output::check_room(&file, finish::room(&scene, args))?;
    let looks = Looks::begin(args, &scene, &file)?;
    let asked = options.clone();
    let keeper = Keeper::new(args, &scene, &asked, &file, looks);
    let lesson = start::lesson(args, &scene, recipe.order)?;
    let spp = options.spp.unwrap_or(scene.sampler.pixel_samples);
    let resume = match Earlier::find(args, until, &keeper, &file, spp)? {
        Earlier::Complete => {
            tell(format_args!("{} is complete already", file.display()));
            return keeper.ended(keeper.discard());
        }
        Earlier::Samples(samples) => samples,
    };
    let world = scenes::world(&scene, start::first_builder(recipe.builder))?;
    let resume = match until {
        None => resume.and_then(|found| earlier::extended(*found, &world, spp)),
        Some(_) => resume.map(|found| *found),
    };
    let resumed = resume.as_ref().map(Snapshot::finished);
    let task = Task {
        shard: args.shard.unwrap_or_default(),
        resume,
        lesson,
        extendable: args.keep_samples,
    };
    let most = args.picture.spp;
    let grown = match until::render(&world, &mut options, most, until, &keeper, task) {
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
    keeper.ended(finish::complete(
        args,
        of,
        &grown,
        &document,
        (&file, &keeper),
    ))
}
