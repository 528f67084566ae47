//! Studies: the same pictures and rays by several orders, widths, builders and collapses, and what each cost.
//!
//! The tables 2 and 3 of Ogaki and Derouet-Jourdan (2016), for any scene, and more. [`run`] does what a [`Plan`]
//! says and returns [`Results`].
//!
//! - `plan`: the list of work;  `kinds`, `log_size`: its words;  `cameras`: other cameras than the scene's
//! - `pictures`: pictures, on whose rays trees are compared;  `replay`: samples of rays, for the many combinations
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

use antumbra_trees::engine;
use std::collections::HashMap;

use antumbra::Recipe;
use antumbra_load::file_stem;
use antumbra_scene::Scene;

use crate::still::still_world;
use crate::watch::{self, Step, Watcher, Work};
use crate::{Error, output};

use journal::{Header, Journal};
use pictures::Studio;
use replay::Bench;
use row::Common;

pub use cameras::Viewpoint;
pub use journal::FILE as JOURNAL;
pub use kinds::{By, Kind, Part, Trained};
pub use log_size::LogSize;
pub use plan::{Combination, Plan, Subject};
pub use results::{Document, Results};
pub use row::{RenderTime, Row};

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
    fn list<T: ToString>(flag: &str, all: &[T]) -> String {
        let names: Vec<String> = all.iter().map(ToString::to_string).collect();
        format!("--{flag} {}", names.join(","))
    }
    let words = [
        list("order", &plan.orders),
        list("width", &plan.widths),
        list("builder", &plan.trees),
        list("collapse", &plan.collapses),
        plan.spp
            .map_or_else(String::new, |spp| format!("--spp {spp}")),
        format!("--repeat {} --seed {}", plan.repeat, plan.seed),
        format!("--level {}", plan.isa.level()),
        format!("--threads {}", rayon::current_num_threads()),
        format!("--replay {} --training-rays {}", plan.replay, plan.log_size),
        format!("--rays-from {}", plan.rays_from.name()),
        match plan.costs == antumbra::recipe::CostModel::default() {
            true => String::new(),
            false => format!("{:?}", plan.costs),
        },
        match &*plan.more_prim_costs {
            [] => String::new(),
            more => format!("and C_p {more:?}"),
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
        schema: "antumbra.study.journal/3".to_owned(),
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
        for place in 0..self.plan.scenes.len() {
            self.expect(place, None);
            self.scene(place)?;
        }
        Ok(())
    }

    /// Announces the work of this scene and all that follow. The number of replays is known exactly when the training
    /// rays of the scene are.
    fn expect(&self, from: usize, log_rays: Option<usize>) {
        let plan = self.plan;
        let (compared, whole) = (plan.compared().len(), plan.renderings().len());
        let mut left = Vec::new();
        for (place, subject) in plan.scenes.iter().enumerate().skip(from) {
            let log_rays = log_rays.filter(|_| place == from).unwrap_or(1 << 14);
            let [x0, x1, y0, y1] = subject.scene.film.pixel_bounds().map(f64::from);
            let samples = (x1 - x0) * (y1 - y0) * f64::from(plan.spp_of(subject));
            let triangles = subject.scene.triangle_count() as f64;
            // Microseconds, as they were on one machine: no more than a guess.
            let works = [
                (Step::Comparison, compared, 1.5 * samples + 1.5 * triangles),
                (Step::Rendering, whole, 4.5 * samples + 1.5 * triangles),
                (
                    Step::Replay,
                    plan.replays(subject, log_rays).len(),
                    4.0 * plan.replay as f64 + 0.3 * triangles,
                ),
            ];
            left.extend(works.map(|(step, count, weight)| Work {
                step,
                count,
                weight: 1e-6 * weight,
            }));
        }
        self.watcher.expect(&left);
    }

    /// Does everything with one scene.
    fn scene(&mut self, place: usize) -> Result<(), Error> {
        let plan = self.plan;
        let subject = &plan.scenes[place];
        let name = &subject.scene.name;
        self.watcher.begin(name);
        let world = still_world(&subject.scene, plan.base().0)?;
        watch::check(self.watcher)?;
        let mut bench = Bench::new(plan, subject, &world);
        self.log_rays.insert(&subject.stem, bench.log_rays);
        self.expect(place, Some(bench.log_rays));
        let common = Common {
            scene: name.clone(),
            triangles: world.triangle_count(),
            two_levels: !subject.scene.instances.is_empty(),
            level: plan.isa.level().to_string(),
            threads: rayon::current_num_threads(),
            spp: plan.spp_of(subject),
            prim_cost: plan.costs.prim,
        };
        let studio = Studio {
            plan,
            subject,
            world: &world,
            common: &common,
            log_share: bench.log_share(),
        };
        self.compare(&studio, bench.trees_at_once())?;
        self.measure(&studio)?;
        self.replay(subject, &mut bench, &common)
    }

    /// Compares trees on the queries of one picture, or of several if there is no room for all trees.
    fn compare(&mut self, studio: &Studio, at_once: usize) -> Result<(), Error> {
        let key = |combination: &Combination| {
            let combination = *combination;
            let rendering = Rendering {
                combination,
                round: 0,
            };
            rendering.key(studio.subject)
        };
        let all = studio.plan.compared();
        let is_left = |c: &Combination| self.journal.get(&key(c)).is_none();
        let left: Vec<_> = all.iter().filter(|c| is_left(c)).copied().collect();
        for _ in left.len()..all.len() {
            self.watcher.finished(Step::Comparison, false);
        }
        for group in left.chunks(at_once) {
            watch::check(self.watcher)?;
            let title = format!("{}, {} trees", studio.common.scene, group.len());
            self.watcher.begin(&title);
            self.watcher.together(group.len());
            let rows = studio.compare(group, self.watcher)?;
            for (combination, row) in group.iter().zip(rows) {
                self.journal.add(key(combination), row)?;
                self.watcher.finished(Step::Comparison, true);
            }
        }
        Ok(())
    }

    /// Renders the whole pictures of the headline, for their times.
    fn measure(&mut self, studio: &Studio) -> Result<(), Error> {
        for rendering in studio.plan.renderings() {
            let key = rendering.key(studio.subject);
            let is_left = self.journal.get(&key).is_none();
            if is_left {
                watch::check(self.watcher)?;
                let Combination { width, order, .. } = rendering.combination;
                let title = format!("{}, width {width}, {order}", studio.common.scene);
                self.watcher.begin(&title);
                let row = studio.measure(&rendering.combination, self.watcher)?;
                self.journal.add(key, row)?;
            }
            self.watcher.finished(Step::Rendering, is_left);
        }
        Ok(())
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
            for same_collapse in left.chunk_by(|a, b| a.shares_collapse(b)) {
                watch::check(self.watcher)?;
                let plan::Combination {
                    width, collapse, ..
                } = same_collapse[0].combination;
                let recipe = Recipe::default()
                    .engine(engine(self.plan.isa, width))
                    .collapse(collapse)
                    .costs(self.plan.costs);
                let mut collapsed = trained.collapse(&recipe);
                for replay in same_collapse {
                    watch::check(self.watcher)?;
                    let Combination { tree, order, .. } = replay.combination;
                    let title =
                        format!("{}, width {width}, {tree} {collapse} {order}", common.scene);
                    self.watcher.begin(&title);
                    let row = bench.measure(common, replay, &mut collapsed)?;
                    self.journal.add(replay.key(subject), row)?;
                    self.watcher.finished(Step::Replay, true);
                }
            }
        }
        Ok(())
    }

    /// The finished rows in the order of the plan, each with its scene's place. Whole pictures count in the rounds that
    /// all of a width had.
    fn rows(&self) -> Vec<(usize, Row)> {
        let plan = self.plan;
        let mut rows = Vec::new();
        for (place, subject) in plan.scenes.iter().enumerate() {
            for &width in &plan.widths {
                let get = |combination: &Combination, round| {
                    let rendering = Rendering {
                        combination: *combination,
                        round,
                    };
                    self.journal.get(&rendering.key(subject))
                };
                let pair = plan.headline(width);
                let whole = |round: &u32| pair.iter().all(|c| get(c, *round).is_some());
                let rounds: Vec<u32> = (1..=plan.repeat).take_while(whole).collect();
                for combination in plan.rendered(width) {
                    let Some(mut row) = get(&combination, 0).cloned() else {
                        continue;
                    };
                    let pictures = rounds.iter().filter_map(|round| get(&combination, *round));
                    row.measured(&pictures.collect::<Vec<_>>());
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
