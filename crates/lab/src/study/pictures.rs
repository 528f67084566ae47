//! The renderings of a study, and their pictures in its folder.

use std::path::{Path, PathBuf};

use antumbra::{Order, Recipe};
use antumbra_image::{Image, Window};
use antumbra_render::{Options, Rendering as Rendered, World, render};

use super::plan::{Combination, Plan, Rendering, Subject};
use super::row::{Common, Row};
use crate::{Error, Watcher};

/// Renders one picture. If it is the first with its combination, it is counted and, if the study has a folder, its
/// pictures are written.
pub fn render_one(
    plan: &Plan,
    subject: &Subject,
    world: &World,
    rendering: &Rendering,
    log_share: f64,
    common: &Common,
    watcher: &dyn Watcher,
) -> Result<Row, Error> {
    let Rendering { combination, round } = rendering;
    let counting = *round == 0;
    let options = Options {
        spp: plan.spp,
        seed: plan.seed,
        log_share,
        count: counting,
        cost_map: counting && plan.out.is_some(),
        recipe: Recipe::default()
            .isa(plan.isa)
            .order(combination.order)
            .builder(combination.tree)
            .collapse(combination.collapse)
            .width(combination.width)
            .costs(plan.costs),
        ..Options::default()
    };
    let rendered = render(world, &options, watcher)?;
    if let (Some(folder), true) = (&plan.out, counting) {
        write(&rendered, &Files::new(plan, subject, combination), folder)?;
    }
    Ok(Row::of_rendering(common, combination, &rendered.stats))
}

/// Names of the pictures of a rendering, without extensions.
pub struct Files {
    /// The picture, which is the same for all of a width.
    pub picture: String,
    /// Tests per shadow ray.
    pub tests: String,
}

impl Files {
    /// The names that a combination has.
    pub fn new(plan: &Plan, subject: &Subject, combination: &Combination) -> Self {
        let Combination {
            width,
            tree,
            collapse,
            order,
        } = combination;
        let picture = format!("{}-w{width}", subject.stem);
        let order = order_stem(*order);
        let tests = if (*tree, *collapse) == plan.base() {
            format!("{picture}-tests-{order}")
        } else {
            format!("{picture}-tests-{tree}-{collapse}-{order}")
        };
        Self { picture, tests }
    }
}

/// An order's name as part of a file's name: signs are spelled out.
fn order_stem(order: Order) -> String {
    let name = order.name();
    match name.split_at(name.len() - 1) {
        (stem, "+") => format!("{stem}-plus"),
        (stem, "-") => format!("{stem}-minus"),
        _ => name.to_owned(),
    }
}

/// The file of a picture of linear values.
pub fn exr(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.exr"))
}

/// The file of a picture for people.
pub fn png(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.png"))
}

/// Writes the picture, unless another rendering has, and the tests of its pixels.
fn write(rendered: &Rendered, files: &Files, folder: &Path) -> Result<(), Error> {
    let image = &rendered.image;
    let path = png(folder, &files.picture);
    if !path.exists() {
        image.write(exr(folder, &files.picture))?;
        image.write(path)?;
    }
    if let Some(map) = &rendered.cost_map {
        let field = values(map, image, image.window())?;
        field.write(exr(folder, &files.tests))?;
    }
    Ok(())
}

/// A field as a grey image.
fn values(map: &[f32], image: &Image, window: Window) -> Result<Image, Error> {
    let pixels = map.iter().map(|&value| [value; 3]).collect();
    Ok(Image::new(image.width(), image.height(), window, pixels)?)
}
