//! Studies: the same pictures and rays by several orders, widths, builders and collapses, and what each cost.
//!
//! The tables 2 and 3 of Ogaki and Derouet-Jourdan (2016), for any scene, and more. [`run`] does what a [`Plan`]
//! says and returns [`Results`].
//!
//! - `plan`: the list of work;  `kinds`, `log_size`: its words;  `cameras`: other cameras than the scene's
//! - `pictures`: renderings;  `replay`: samples of rays, for the many combinations
//! - `row`: the figures of one combination;  `results`: all of them
//! - `journal`: finished work, from which an interrupted study continues;  `fingerprint`: whether a scene is unchanged

mod cameras;
mod fingerprint;
mod journal;
mod kinds;
mod log_size;
mod pictures;
mod plan;
mod replay;
mod results;
mod row;

use std::collections::HashMap;

use antumbra::Recipe;
use antumbra_load::file_stem;
use antumbra_render::World;
use antumbra_scene::Scene;

use crate::watch::{self, Step, Watcher};
use crate::{Error, output};

use journal::{Header, Journal};
use replay::Bench;
use row::Common;

pub use cameras::Viewpoint;
pub use journal::FILE as JOURNAL;
pub use kinds::{By, Kind, Part, Trained};
pub use log_size::LogSize;
pub use plan::{Combination, Plan, Subject};
pub use results::{Document, Results};
pub use row::Row;

pub(crate) use pictures::{Files, exr, png};
pub(crate) use plan::Rendering;

/// Scenes with names for their files, and the camera of their training rays.
///
/// # Errors
/// [`Error::LookAt`] if the viewpoint is no camera.
pub fn subjects(scenes: Vec<Scene>, train: Option<&Viewpoint>) -> Result<Vec<Subject>, Error> {
    let mut stems = Vec::new();
    let subject = |scene: Scene| {
        let train = train.map(|train| train.camera(&scene)).transpose()?;
        Ok(Subject {
            stem: unused(file_stem(&scene.name), &mut stems),
            scene,
            train,
        })
    };
    scenes.into_iter().map(subject).collect()
}

/// Does everything in the plan that is not finished yet. An interrupted study returns what is finished.
///
/// With [`Plan::out`], every finished piece of work is kept there in a journal, and the pictures are written.
/// [`Results::write`] writes the report.
///
/// # Errors
/// [`Error::Interrupted`] if nothing was finished; [`Error::OtherStudy`] if the directory is of another study; what
/// fails in between. Results that differ are found by [`Results::verdict`].
pub fn run<'a>(plan: &'a Plan, watcher: &dyn Watcher) -> Result<Results<'a>, Error> {
    let journal = match &plan.out {
        Some(folder) => {
            output::make_directory(folder)?;
            Journal::open(folder, &header(plan), plan.restart)?
        }
        None => Journal::in_memory(),
    };
    let mut study = Study {
        plan,
        journal,
        watcher,
        log_rays: HashMap::new(),
    };
    if study.journal.found > 0 {
        watcher.continued(study.journal.found);
    }
    let end = study.run();
    let rows = study.rows();
    let complete = match end {
        Ok(()) => true,
        Err(Error::Interrupted) if !rows.is_empty() => false,
        Err(error) => return Err(error),
    };
    Ok(Results::new(plan, rows, complete))
}

/// Identity of the study: everything that decides what is done.
fn header(plan: &Plan) -> Header {
    let list = |names: Vec<String>| names.join(",");
    let Plan {
        orders,
        widths,
        trees,
        collapses,
        ..
    } = plan;
    let words = [
        format!(
            "--order {}",
            list(orders.iter().map(ToString::to_string).collect())
        ),
        format!(
            "--width {}",
            list(widths.iter().map(ToString::to_string).collect())
        ),
        format!(
            "--builder {}",
            list(trees.iter().map(ToString::to_string).collect())
        ),
        format!(
            "--collapse {}",
            list(collapses.iter().map(ToString::to_string).collect())
        ),
        plan.spp
            .map_or_else(String::new, |spp| format!("--spp {spp}")),
        format!("--repeat {} --seed {}", plan.repeat, plan.seed),
        format!("--level {}", plan.isa.level()),
        format!("--threads {}", rayon::current_num_threads()),
        format!("--replay {} --training-rays {}", plan.replay, plan.log_size),
        format!("--rays-from {}", plan.rays_from.name()),
        match plan.costs == antumbra::CostModel::default() {
            true => String::new(),
            false => format!("{:?}", plan.costs),
        },
    ];
    let words: Vec<String> = words.into_iter().filter(|word| !word.is_empty()).collect();
    let scene = |subject: &Subject| {
        let mut print = fingerprint::of_scene(&subject.scene);
        if let Some(train) = &subject.train {
            print.push_str(&format!(" {train:?}"));
        }
        (subject.scene.name.clone(), print)
    };
    Header {
        schema: "antumbra.study.journal/1".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        plan: words.join(" "),
        scenes: plan.scenes.iter().map(scene).collect(),
    }
}

/// A study under way.
struct Study<'a> {
    plan: &'a Plan,
    journal: Journal,
    watcher: &'a dyn Watcher,
    /// Number of training rays of a scene, by its stem, as far as known.
    log_rays: HashMap<&'a str, usize>,
}

impl<'a> Study<'a> {
    /// Does everything.
    fn run(&mut self) -> Result<(), Error> {
        let plan = self.plan;
        let renderings = plan.renderings();
        // The exact number of replays is known when the scene's rays are.
        let replays = |subject| plan.replays(subject, 1 << 14).len();
        let replays = plan.scenes.iter().map(replays).sum();
        self.watcher
            .expect(renderings.len() * plan.scenes.len(), replays);
        for subject in &plan.scenes {
            self.scene(subject, &renderings)?;
        }
        Ok(())
    }

    /// Does everything with one scene.
    fn scene(&mut self, subject: &'a Subject, renderings: &[Rendering]) -> Result<(), Error> {
        let plan = self.plan;
        let name = &subject.scene.name;
        let world = World::with_builder(&subject.scene, plan.base().0);
        let world = world.map_err(Error::scene(name))?;
        watch::check(self.watcher)?;
        let mut bench = Bench::new(plan, subject, &world);
        self.log_rays.insert(&subject.stem, bench.log_rays);
        let common = Common {
            scene: subject.scene.name.clone(),
            triangles: world.triangle_count(),
            two_levels: !subject.scene.instances.is_empty(),
            level: plan.isa.level().to_string(),
            threads: rayon::current_num_threads(),
            spp: plan.spp_of(subject),
        };
        let log_share = bench.log_share();
        for rendering in renderings {
            let key = rendering.key(subject);
            if self.journal.get(&key).is_none() {
                let Combination { width, order, .. } = rendering.combination;
                self.watcher
                    .begin(&format!("{name}, width {width}, {order}"));
                let row = pictures::render_one(
                    plan,
                    subject,
                    &world,
                    rendering,
                    log_share,
                    &common,
                    self.watcher,
                )?;
                self.journal.add(key, row)?;
                self.watcher.finished(Step::Rendering, true);
            } else {
                self.watcher.finished(Step::Rendering, false);
            }
        }
        self.replay(subject, &mut bench, &common)
    }

    /// Replays one scene.
    fn replay(
        &mut self,
        subject: &Subject,
        bench: &mut Bench,
        common: &Common,
    ) -> Result<(), Error> {
        let replays = self.plan.replays(subject, bench.log_rays);
        for same_tree in replays.chunk_by(|a, b| a.shares_tree(b)) {
            let is_left = |replay: &plan::Replay| self.journal.get(&replay.key(subject)).is_none();
            let left: Vec<_> = same_tree.iter().filter(|r| is_left(r)).copied().collect();
            for _ in left.len()..same_tree.len() {
                self.watcher.finished(Step::Replay, false);
            }
            let Some(first) = left.first() else {
                continue;
            };
            if !bench.has_rays(first.kind) {
                continue;
            }
            let trained = bench.trained_tree(first)?;
            let trained_recipe = Recipe::default().isa(self.plan.isa);
            for same_collapse in left.chunk_by(|a, b| a.shares_collapse(b)) {
                watch::check(self.watcher)?;
                let plan::Combination {
                    width, collapse, ..
                } = same_collapse[0].combination;
                let recipe = trained_recipe
                    .collapse(collapse)
                    .width(width)
                    .costs(self.plan.costs);
                let mut collapsed = trained.collapse(&recipe);
                for replay in same_collapse {
                    watch::check(self.watcher)?;
                    let Combination { tree, order, .. } = replay.combination;
                    self.watcher.begin(&format!(
                        "{}, width {width}, {tree} {collapse} {order}",
                        common.scene
                    ));
                    let found = bench.measure(replay, &mut collapsed)?;
                    let row = Row::of_replay(common, replay, &found);
                    self.journal.add(replay.key(subject), row)?;
                    self.watcher.finished(Step::Replay, true);
                }
            }
        }
        Ok(())
    }

    /// The finished rows in the order of the plan, each with its scene's place. Times of renderings are those of the
    /// median of the rounds that all combinations of a width had; of the counting round only if there is no other.
    fn rows(&self) -> Vec<(usize, Row)> {
        let plan = self.plan;
        let mut rows = Vec::new();
        for (place, subject) in plan.scenes.iter().enumerate() {
            for &width in &plan.widths {
                let rendered = plan.rendered(width);
                let get = |combination: &Combination, round| {
                    let rendering = Rendering {
                        combination: *combination,
                        round,
                    };
                    self.journal.get(&rendering.key(subject))
                };
                let whole = |round: &u32| rendered.iter().all(|c| get(c, *round).is_some());
                let rounds: Vec<u32> = (1..=plan.repeat).take_while(whole).collect();
                for combination in &rendered {
                    let Some(mut row) = get(combination, 0).cloned() else {
                        continue;
                    };
                    let timed = rounds.iter().filter_map(|round| get(combination, *round));
                    row.time(timed.collect());
                    rows.push((place, row));
                }
            }
            let log_rays = self.log_rays.get(&*subject.stem).copied().unwrap_or(0);
            for replay in plan.replays(subject, log_rays) {
                if let Some(row) = self.journal.get(&replay.key(subject)) {
                    rows.push((place, row.clone()));
                }
            }
        }
        rows
    }
}

/// A free name: this one, with a number if it is taken.
fn unused(stem: String, taken: &mut Vec<String>) -> String {
    let candidates = (2..).map(|number| format!("{stem}-{number}"));
    let free = std::iter::once(stem.clone())
        .chain(candidates)
        .find(|name| !taken.contains(name))
        .unwrap_or(stem);
    taken.push(free.clone());
    free
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_of_one_name_get_files_of_their_own() {
        let mut taken = Vec::new();
        let names = ["a", "b", "a", "a"].map(|name| unused(name.into(), &mut taken));
        assert_eq!(names, ["a", "b", "a-2", "a-3"]);
    }
}
