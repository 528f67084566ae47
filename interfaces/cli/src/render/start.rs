//! What a rendering begins with: a picture with its options, and training rays.

use std::path::PathBuf;

use antumbra::recipe::{Builder, Order};
use antumbra::{Isa, Recipe};
use antumbra_load::{Loaded, MemorySize};
use antumbra_render::{Lesson, Options, Place};
use antumbra_scene::Scene;

use super::names;
use super::until::{self, Until};
use crate::args::RenderArgs;
use crate::exit::Failure;
use crate::output::{self, Files};
use crate::{archive, scenes};

/// A picture that is to be rendered.
pub struct Picture {
    pub scene: Scene,
    /// Seconds of reading the scene.
    pub load_seconds: f64,
    /// Whether a warning about the file says that nothing can be seen.
    pub is_invisible: bool,
    /// The image, or the part of a shard.
    pub file: PathBuf,
    pub options: Options,
    pub until: Option<Until>,
}

impl Picture {
    /// Reads the scene, and checks that the picture can be written.
    pub fn new(
        args: &RenderArgs,
        isa: Isa,
        memory: MemorySize,
        mut files: Files,
    ) -> Result<Self, Failure> {
        let loaded = scenes::load_picture(&args.scene, &args.picture, &args.camera, memory)?;
        let file = names::settle(args, &loaded, memory, &mut files)?;
        let Loaded {
            scene,
            seconds,
            is_invisible,
            ..
        } = loaded;
        output::check_room(&file, room(&scene, args))?;
        let until = Until::of(&args.until);
        Ok(Self {
            options: options(args, args.tree.recipe(&scene, isa), until),
            scene,
            load_seconds: seconds,
            is_invisible,
            file,
            until,
        })
    }

    /// Samples per pixel of a picture whose end is known.
    pub fn spp(&self) -> u32 {
        let own = self.scene.sampler.pixel_samples;
        self.options.spp.unwrap_or(own)
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
