//! Renders a scene the way its reference picture was made and tells how far the two are apart.
//!
//!     cargo run --release --example reference -- SCENES_DIR REFERENCES_DIR NAME [SPP]

use std::path::PathBuf;

use antumbra_image::{Image, compare};
use antumbra_render::{Options, World, render};
use antumbra_scene::Filter;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut next = |what: &str| arguments.next().ok_or_else(|| format!("missing {what}"));
    let scenes = PathBuf::from(next("folder of scenes")?);
    let references = PathBuf::from(next("folder of references")?);
    let name = next("name of a scene")?;
    let spp = arguments.next().map_or(Ok(64), |text| text.parse())?;

    let path = scenes.join(&name).join(format!("{name}.pbrt"));
    let mut scene = antumbra_pbrt::load(&path, &Default::default())?.scene;
    let reference = Image::read(references.join(format!("{name}.exr")))?;
    let reference_error = Image::read(references.join(format!("{name}.stderr.exr")))?;
    scene.film.resolution = [reference.width() as u32, reference.height() as u32];
    scene.film.filter = Filter::default();

    let world = World::new(&scene)?;
    let options = Options {
        spp: Some(spp),
        standard_error: true,
        ..Options::default()
    };
    let rendering = render(&world, &options, &())?;
    println!("{:#?}", rendering.stats);
    let errors = compare::StandardErrors {
        image: rendering.standard_error.as_ref(),
        reference: Some(&reference_error),
    };
    let limits = compare::Options {
        rounding: 1e-5,
        ..Default::default()
    };
    let found = compare::compare(&rendering.image, &reference, errors, &limits)?;
    println!("{found:#?}");
    Ok(())
}
