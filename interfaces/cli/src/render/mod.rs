//! `antumbra render`: one scene, one image.
//!
//! The steps of the command, each in a file of its own and each called once from here, in this order: `names`: what is read and
//! written, before anything is;  `start`: the picture, with its scene and options;  `earlier`: what is left to be done after an
//! earlier run;  `until`: the rendering, in steps if its end is not known;  `finish`: outputs, with `layers` and the `document`.
//! `checkpoint` and `looks` are what is kept and shown of it meanwhile.

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
use antumbra_render::{Error, Snapshot};

use crate::args::RenderArgs;
use crate::exit::{Failure, tell};
use crate::interrupt;
use crate::output::{self, Files};
use checkpoint::Keeper;
use start::Picture;

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

fn attempt(args: &RenderArgs, isa: Isa, memory: MemorySize, files: Files) -> Result<(), Failure> {
    let picture = Picture::new(args, isa, memory, files)?;
    let keeper = Keeper::new(args, &picture)?;
    let Some((world, task)) = earlier::task_left(args, &picture, &keeper)? else {
        tell(format_args!(
            "{} is complete already",
            picture.file.display()
        ));
        return keeper.ended(keeper.discard());
    };
    let resumed = task.resume.as_ref().map(Snapshot::finished);
    let grown = match until::render(&world, &picture.options, picture.until, &keeper, task) {
        Err(Error::Cancelled) => return keeper.ended(Err(keeper.interrupted())),
        grown => grown?,
    };
    let complete = finish::complete(args, (&picture, &world), &grown, resumed, &keeper);
    keeper.ended(complete)
}
