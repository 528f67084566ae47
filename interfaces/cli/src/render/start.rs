//! What a rendering begins with: its options, and training rays.

use antumbra::Recipe;
use antumbra::recipe::{Builder, Order};
use antumbra_render::{Lesson, Options, Place};
use antumbra_scene::Scene;

use super::until::{self, Until};
use crate::archive;
use crate::args::RenderArgs;
use crate::exit::Failure;

/// Options of the rendering.
pub fn options(args: &RenderArgs, recipe: Recipe, until: Option<Until>) -> Options {
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

/// Builder of the tree before there are rays: a tree for the scene's own rays has to wait for them.
pub fn first_builder(builder: Builder) -> Builder {
    match builder.needs_rays() {
        true => Builder::BinnedSah,
        false => builder,
    }
}

/// Training rays given in a file, if there is one.
pub fn lesson(args: &RenderArgs, scene: &Scene, order: Order) -> Result<Option<Lesson>, Failure> {
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
        Some(reason) => Err(Failure::name(path, reason)),
    }
}
