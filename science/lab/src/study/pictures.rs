//! The pictures of a study: trees that are compared on one, whole ones for their times, and their files.

use antumbra_trees::engine;
use std::path::{Path, PathBuf};

use antumbra::Recipe;
use antumbra::recipe::Order;
use antumbra_image::{Image, Window};
use antumbra_render::{Options, World, render};

use super::plan::{Combination, Plan, Subject};
use super::row::{Common, Row};
use crate::{Error, Watcher, compare};

/// Plan, scene and rendering that all pictures of a scene share.
pub struct Studio<'a> {
    pub plan: &'a Plan,
    pub subject: &'a Subject,
    pub world: &'a World,
    pub common: &'a Common,
    /// Share of the samples that is learned from.
    pub log_share: f64,
}

impl Studio<'_> {
    /// Compares trees on the queries of one picture. If the study has a folder, the pictures are written.
    pub fn compare(
        &self,
        combinations: &[Combination],
        watcher: &dyn Watcher,
    ) -> Result<Vec<Row>, Error> {
        let Self { plan, common, .. } = self;
        let options = Options {
            cost_map: plan.out.is_some(),
            ..self.options()
        };
        let recipes: Vec<_> = combinations.iter().map(|c| self.recipe(c)).collect();
        let rounds = plan.repeat.max(1) as usize;
        let picture = compare(self.world, &options, &recipes, rounds, watcher)?;
        let mut rows = Vec::new();
        for (combination, tree) in combinations.iter().zip(&picture.trees) {
            if let Some(folder) = &plan.out {
                let files = Files::new(plan, self.subject, combination);
                write(&picture.image, tree.cost_map.as_deref(), &files, folder)?;
            }
            rows.push(Row::of_picture(common, combination, &picture, tree));
        }
        Ok(rows)
    }

    /// Renders a whole picture with one tree, for its time.
    pub fn measure(&self, combination: &Combination, watcher: &dyn Watcher) -> Result<Row, Error> {
        let options = Options {
            recipe: self.recipe(combination),
            ..self.options()
        };
        let rendered = render(self.world, &options, watcher)?;
        Ok(Row::of_rendering(self.common, combination, &rendered.stats))
    }

    fn options(&self) -> Options {
        Options {
            spp: self.plan.spp,
            seed: self.plan.seed,
            log_share: self.log_share,
            ..Options::default()
        }
    }

    fn recipe(&self, combination: &Combination) -> Recipe {
        Recipe::default()
            .engine(engine(self.plan.isa, combination.width))
            .order(combination.order)
            .builder(combination.tree)
            .collapse(combination.collapse)
            .costs(match combination.prim_cost {
                Some(prim) => self.plan.costs.prim(prim),
                None => self.plan.costs,
            })
    }
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
        let Combination { tree, collapse, .. } = combination;
        let width = combination.width;
        let picture = format!("{}-w{width}", subject.stem);
        let mut order = order_stem(combination.order);
        if let Some(cost) = combination.prim_cost {
            order.push_str(&format!("-cp{cost}"));
        }
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

/// Writes the picture, unless another tree's is there, and the tests of its pixels.
fn write(image: &Image, tests: Option<&[f32]>, files: &Files, folder: &Path) -> Result<(), Error> {
    let path = png(folder, &files.picture);
    if !path.exists() {
        image.write(exr(folder, &files.picture))?;
        image.write(path)?;
    }
    if let Some(map) = tests {
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
