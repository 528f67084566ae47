//! Outputs of a rendering.

use antumbra_render::World;

use super::checkpoint::Keeper;
use super::document::{Document, summarise};
use super::layers;
use super::start::Picture;
use super::until::Grown;
use crate::args::{RenderArgs, usual};
use crate::exit::Failure;
use crate::{interrupt, json, scenes};

/// Writes everything there is to write, during which no signal ends the program, and says how it went.
pub fn complete(
    args: &RenderArgs,
    of: (&Picture, &World),
    grown: &Grown,
    resumed_tiles: Option<[usize; 2]>,
    keeper: &Keeper<'_>,
) -> Result<(), Failure> {
    let (picture, world) = of;
    // Surfaces that light reaches send shadow rays. A warning about the file says enough.
    let is_dark = grown.rendering.stats.shadow_rays == 0 && args.shard.is_none();
    if is_dark && !picture.is_invisible {
        let isa = picture.options.recipe.engine.isa();
        scenes::warn_of_nothing(&picture.scene, world, isa);
    }
    let document = Document::new(args, of, grown, resumed_tiles);
    let _writing = interrupt::writing();
    keeper.finish();
    keeper.keep_finished(&grown.snapshot);
    write(args, of, grown, &document, keeper)?;
    let outcome = if grown.interrupted {
        Err(keeper.interrupted_after(&grown.snapshot))
    } else if args.keep_samples {
        keeper.keep(&grown.snapshot)
    } else {
        keeper.discard()
    };
    if outcome.is_ok() || grown.interrupted {
        summarise(&document, &grown.rendering.stats.split);
    }
    outcome
}

/// Writes all outputs. If that fails, the samples are kept.
fn write(
    args: &RenderArgs,
    (picture, world): (&Picture, &World),
    grown: &Grown,
    document: &Document<'_>,
    keeper: &Keeper<'_>,
) -> Result<(), Failure> {
    let (rendering, snapshot) = (&grown.rendering, &grown.snapshot);
    let written = match args.shard {
        None if args.layers || args.metadata => layers::write(args, picture, world, rendering),
        None => {
            let usual = usual(picture.scene.integrator.is_light());
            let file = &picture.file;
            args.display.write(&rendering.image, file, usual)
        }
        Some(_) => keeper.write_part(&picture.file, snapshot),
    };
    let written = written.and_then(|()| {
        if let (Some(path), Some(image)) = (&args.stderr_image, &rendering.standard_error) {
            image.write(path)?;
        }
        json::write(document, args.json.as_ref())
    });
    written.map_err(|failure| keeper.rescue(snapshot, failure))
}
