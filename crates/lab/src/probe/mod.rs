//! Probes: what might become a default, measured in counts and in time on held-out rays.
//!
//! A study compares trees and orders that are there. A probe tries what goes beyond a static order, one file each:
//!
//! - `ways`: per node, the static order, near first or far first
//! - `splits`: spatial splits for occlusion only
//! - `model`: cost models for events that are not independent
//! - `moving`: a tree that learns while the camera moves
//! - `rays`: training rays and held-out rays;  `turns`: interleaved timing on one thread;  `row`: figures
//!
//! Everything is compared on the trees of the paper (`binned-sah`, collapsed by area) and on the default trees.

mod model;
mod moving;
mod rays;
mod row;
mod splits;
mod turns;
mod ways;

use antumbra::recipe::{Builder, Collapse};
use antumbra::{Isa, Recipe, Width};
use antumbra_render::World;
use antumbra_scene::Scene;

use crate::still::still_world;
use crate::study::Kind;
use crate::watch;
use crate::{Error, RaysFrom, TrainedTree, Watcher};

use rays::Lots;

pub use row::{Row, csv};

/// An experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Part {
    /// A way of picking for each node.
    Ways,
    /// Spatial splits.
    Splits,
    /// Cost models.
    Model,
    /// Learning while running.
    Moving,
}

impl Part {
    /// Everything.
    pub const ALL: [Self; 4] = [Self::Ways, Self::Splits, Self::Model, Self::Moving];

    /// Name on the command line and in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ways => "ways",
            Self::Splits => "splits",
            Self::Model => "model",
            Self::Moving => "moving",
        }
    }
}

/// Choices of a probe.
#[derive(Clone, Debug)]
pub struct Options {
    /// Experiments to run.
    pub parts: Vec<Part>,
    /// Children per node.
    pub width: Width,
    /// Instruction set.
    pub isa: Isa,
    /// Training rays of each kind.
    pub log_rays: usize,
    /// Held-out rays of each kind.
    pub rays: usize,
    /// Rounds in which everything is timed once; 0 for counts only.
    pub rounds: usize,
    /// Frames of the moving camera.
    pub frames: usize,
    /// Seed of all random values.
    pub seed: u64,
}

/// The trees that everything is tried on: the paper's and the default.
const TREES: [(Builder, Collapse); 2] = [
    (Builder::BinnedSah, Collapse::Area),
    (Builder::Reinsertion, Collapse::Learned),
];

/// Tries everything on every scene. `show` gets the rows of each part as soon as they are there.
///
/// # Errors
/// A scene that cannot be rendered; [`Error::Interrupted`]; [`Error::Differ`] if any answer differs.
pub fn run(
    scenes: Vec<Scene>,
    options: &Options,
    watcher: &dyn Watcher,
    mut show: impl FnMut(&[Row]) -> Result<(), Error>,
) -> Result<Vec<Row>, Error> {
    let mut rows = Vec::new();
    for scene in scenes {
        watch::check(watcher)?;
        let name = scene.name.clone();
        watcher.begin(&name);
        let world = still_world(&scene, Builder::BinnedSah)?;
        let recipe = Recipe::default()
            .isa(options.isa)
            .width(options.width)
            .seed(options.seed);
        let lots = Lots::new(&world, &scene, options);
        for part in &options.parts {
            watcher.begin(&format!("{name}, {}", part.name()));
            watch::check(watcher)?;
            let subject = Subject {
                scene: &scene,
                world: &world,
                lots: &lots,
                recipe,
                options,
            };
            let found = match part {
                Part::Ways => ways::probe(&subject)?,
                Part::Splits => splits::probe(&subject)?,
                Part::Model => model::probe(&subject)?,
                Part::Moving => moving::probe(&subject)?,
            };
            show(&found)?;
            rows.extend(found);
        }
    }
    Ok(rows)
}

/// A scene and how it is probed.
struct Subject<'a> {
    scene: &'a Scene,
    world: &'a World,
    lots: &'a Lots,
    recipe: Recipe,
    options: &'a Options,
}

impl Subject<'_> {
    /// The rows of each kind of rays that the scene has, on each of the [`TREES`].
    fn on_all_trees(
        &self,
        probe: impl Fn(Kind, &Recipe) -> Result<Vec<Row>, Error>,
    ) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        for kind in Kind::ALL {
            if self.lots.test(kind).is_empty() {
                continue;
            }
            for (tree, collapse) in TREES {
                let found = probe(kind, &self.recipe.builder(tree).collapse(collapse))?;
                rows.extend(found.into_iter().map(|row| Row {
                    tree: tree.name(),
                    collapse: collapse.name(),
                    ..row
                }));
            }
        }
        Ok(rows)
    }

    /// The tree of a recipe, taught by the training rays of a kind.
    fn trained(&self, kind: Kind, recipe: &Recipe) -> TrainedTree {
        TrainedTree::new(self.world, recipe, self.lots.train(kind), RaysFrom::Both)
    }
}

/// Fails unless the answers are equal.
fn check_equal(scene: &str, what: &str, found: &[bool], expected: &[bool]) -> Result<(), Error> {
    if found == expected {
        return Ok(());
    }
    let count = found.iter().zip(expected).filter(|(a, b)| a != b).count();
    Err(Error::Differ {
        rule: "all answers to a list of rays must be the same",
        found: vec![format!("{scene}, {what}: {count} rays")],
    })
}
