//! Samples of an earlier run to go on from.

use std::path::Path;

use antumbra_render::{Snapshot, World};

use super::checkpoint::Keeper;
use super::until::Until;
use crate::args::RenderArgs;
use crate::exit::{Failure, tell};

/// Work of an earlier run.
pub enum Earlier {
    /// The requested part is there.
    Complete,
    /// Samples to go on from, if there are any.
    Samples(Option<Box<Snapshot>>),
}

impl Earlier {
    /// Looks for work of an earlier run.
    pub fn find(
        args: &RenderArgs,
        until: Option<Until>,
        keeper: &Keeper<'_>,
        file: &Path,
        spp: u32,
    ) -> Result<Self, Failure> {
        if args.restart {
            return Ok(Self::Samples(None));
        }
        let shard = args.shard.unwrap_or_default();
        if until.is_some() {
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
            Some(shard) => keeper.finished_part(file, shard)?,
            None => None,
        };
        let has_more =
            args.json.is_some() || args.stderr_image.is_some() || args.save_order.is_some();
        if part.as_ref().is_some_and(|part| part.spp() == spp) && (args.resume || !has_more) {
            return Ok(Self::Complete);
        }
        Ok(Self::Samples(keeper.resume(shard)?.or(part).map(Box::new)))
    }
}

/// The state to go on from: a finished picture of fewer samples is extended. `None` if it cannot be.
pub fn extended(found: Snapshot, world: &World, spp: u32) -> Option<Snapshot> {
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
