//! What an earlier run has left to be done: samples to go on from.

use antumbra_render::{Snapshot, Task, World};

use super::checkpoint::Keeper;
use super::start::{self, Picture};
use crate::args::RenderArgs;
use crate::exit::{Failure, tell};
use crate::scenes;

/// The world of a picture, and what is left to be rendered; `None` if the picture is complete.
pub fn task_left(
    args: &RenderArgs,
    picture: &Picture,
    keeper: &Keeper<'_>,
) -> Result<Option<(World, Task)>, Failure> {
    let (scene, recipe) = (&picture.scene, &picture.options.recipe);
    let lesson = start::lesson(args, scene, recipe.order)?;
    let Earlier::Samples(found) = Earlier::find(args, picture, keeper)? else {
        return Ok(None);
    };
    let world = scenes::world(scene, start::first_builder(recipe.builder))?;
    let resume = found.and_then(|found| match picture.until {
        None => extended(*found, &world, picture.spp()),
        Some(_) => Some(*found),
    });
    let task = Task {
        shard: args.shard.unwrap_or_default(),
        resume,
        lesson,
        extendable: args.keep_samples,
    };
    Ok(Some((world, task)))
}

/// Work of an earlier run.
enum Earlier {
    /// The requested part is there.
    Complete,
    /// Samples to go on from, if there are any.
    Samples(Option<Box<Snapshot>>),
}

impl Earlier {
    /// Looks for work of an earlier run.
    fn find(args: &RenderArgs, picture: &Picture, keeper: &Keeper<'_>) -> Result<Self, Failure> {
        if args.restart {
            return Ok(Self::Samples(None));
        }
        let shard = args.shard.unwrap_or_default();
        if picture.until.is_some() {
            let resume = keeper.resume(shard)?;
            let most = args.picture.spp.unwrap_or(u32::MAX);
            return match resume.as_ref().map(Snapshot::spp) {
                Some(found) if found > most => Err(Failure::Usage(format!(
                    "the checkpoint has {found} samples per pixel, more than --spp {most}; --restart forgets it"
                ))),
                _ => Ok(Self::Samples(resume.map(Box::new))),
            };
        }
        let part = match args.shard {
            Some(shard) => keeper.finished_part(&picture.file, shard)?,
            None => None,
        };
        let has_more =
            args.json.is_some() || args.stderr_image.is_some() || args.save_order.is_some();
        let is_whole = part
            .as_ref()
            .is_some_and(|part| part.spp() == picture.spp());
        if is_whole && (args.resume || !has_more) {
            return Ok(Self::Complete);
        }
        Ok(Self::Samples(keeper.resume(shard)?.or(part).map(Box::new)))
    }
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
