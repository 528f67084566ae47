//! Outputs of a rendering.

use std::path::Path;

use antumbra_render::{Options, World};
use antumbra_scene::Scene;

use super::checkpoint::Keeper;
use super::document::{Document, summarise};
use super::layers;
use super::until::Grown;
use crate::args::{RenderArgs, usual};
use crate::exit::Failure;
use crate::{interrupt, json};

/// Writes everything there is to write, during which no signal ends the program, and says how it went.
pub fn complete(
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

/// Bytes that the output may take: the size of an uncompressed image, or of the sums of a shard,
/// whose tiles overlap a little.
pub fn room(scene: &Scene, args: &RenderArgs) -> u64 {
    let [x0, x1, y0, y1] = scene.film.pixel_bounds().map(u64::from);
    let pixels = (x1 - x0) * (y1 - y0);
    match args.shard {
        None => 12 * pixels,
        Some(shard) if args.stderr_image.is_some() => 104 * pixels / u64::from(shard.count()),
        Some(shard) => 40 * pixels / u64::from(shard.count()),
    }
}
