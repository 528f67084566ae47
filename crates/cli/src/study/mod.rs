//! `antumbra study`: the laboratory. The same pictures and rays by several orders, widths, trees and
//! collapses, and what each cost: the tables 2 and 3 of Ogaki and Derouet-Jourdan (2016), for any scene, and
//! more.
//!
//! - `plan`: what is to be done, as a list;  `cameras`: where rays to learn from may come from
//! - `pictures`: renderings;  `replay`: samples of rays instead, for the many combinations
//! - `row`: what was found out about one of them
//! - `journal`: what is finished, so that an interrupted study continues;  `fingerprint`: whether it is the same

mod cameras;
mod fingerprint;
mod journal;
mod pictures;
mod plan;
mod replay;
mod row;

use std::collections::HashMap;

use antumbra::Builder;
use antumbra_render::Grove;
use serde::Serialize;

use crate::args::{LogSize, StudyArgs};
use crate::exit::{Failure, say};
use crate::json::{self, Destination};
use crate::machine::Machine;
use crate::progress::{Progress, Step};
use crate::source::Loaded;
use crate::{interrupt, output, report, source};

use cameras::Chosen;
use journal::{Header, Journal};
use replay::Bench;
use row::Common;

pub use pictures::{Files, exr, png};
pub use plan::{Combination, Plan, Rendering, Subject};
pub use row::{By, Kind, Part, Row, Trained};

/// Rays that are replayed by a laboratory that does not say how many.
const REPLAY: u32 = 100_000;

/// The JSON document.
#[derive(Serialize)]
pub struct Document<'a> {
    pub schema: &'static str,
    #[serde(flatten)]
    pub machine: Machine,
    pub seed: u64,
    /// Whether there is a row for everything that was asked for, timed as often; if not, the study was
    /// interrupted.
    pub complete: bool,
    pub rows: Vec<&'a Row>,
}

/// Runs the command.
pub fn run(args: &StudyArgs) -> Result<(), Failure> {
    let isa = args.rendering.isa()?;
    if let Some(path) = args.json.as_ref().and_then(Destination::file) {
        output::check_file(path)?;
    }
    args.rendering.start_threads()?;
    let laboratory = args.trees.is_some()
        || args.collapses.is_some()
        || args.train_camera.is_some()
        || args.rays_from.is_some()
        || args.log_size.is_some();
    let replay = args.replay.unwrap_or(if laboratory { REPLAY } else { 0 });
    let chosen = |camera: &Option<_>| camera.as_ref().map(Chosen::new).transpose();
    let (test, train) = (chosen(&args.test_camera)?, chosen(&args.train_camera)?);
    let mut loaded = source::load_all(&args.scenes, &args.rendering)?;
    if let Some(test) = &test {
        for Loaded { scene, .. } in &mut loaded {
            scene.camera = test.camera(scene)?;
        }
    }
    let trees = args.trees.as_ref().map(|trees| trees.0.clone());
    let collapses = args.collapses.as_ref().map(|list| list.0.clone());
    let plan = Plan {
        scenes: subjects(loaded, train.as_ref())?,
        orders: args.orders.0.clone(),
        widths: args.widths.on(isa),
        trees: trees.unwrap_or_else(|| vec![Builder::default()]),
        collapses: collapses.unwrap_or_else(|| vec![args.rendering.collapse]),
        spp: args.rendering.spp,
        repeat: args.repeat,
        seed: args.rendering.seed,
        isa,
        replay: replay as usize,
        log_size: args.log_size.unwrap_or(LogSize::Share(0.01)),
        rays_from: args.rays_from.unwrap_or_default(),
        out: args.out.clone(),
        restart: args.restart,
        json: args.json.clone(),
    };
    execute(&plan)
}

/// The scenes with names and cameras.
pub fn subjects(loaded: Vec<Loaded>, train: Option<&Chosen>) -> Result<Vec<Subject>, Failure> {
    let mut stems = Vec::new();
    let subject = |Loaded { scene, .. }| {
        let train = train.map(|train| train.camera(&scene)).transpose()?;
        Ok(Subject {
            stem: unused(output::file_stem(&scene.name), &mut stems),
            scene,
            train,
        })
    };
    loaded.into_iter().map(subject).collect()
}

/// Does everything that is not finished yet, reports it, and fails if two images or answers of a scene differ. If
/// interrupted, reports what was finished.
pub fn execute(plan: &Plan) -> Result<(), Failure> {
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
        progress: Progress::new(""),
        log_rays: HashMap::new(),
    };
    if study.journal.found > 0 {
        let found = study.journal.found;
        say(format_args!(
            "{found} renderings and replays were finished before; --restart would do them again"
        ));
    }
    let complete = match study.run() {
        Ok(()) => true,
        Err(Failure::Interrupted) if study.has_rows() => false,
        Err(failure) => return Err(failure),
    };
    study.progress.finish();
    let rows = study.rows();
    let document = Document {
        schema: "antumbra.study/1",
        machine: Machine::new(plan.isa),
        seed: plan.seed,
        complete,
        rows: rows.iter().map(|(_, row)| row).collect(),
    };
    report::show(plan, &document, plan.json == Some(Destination::Stdout))?;
    json::write(&document, plan.json.as_ref())?;
    if let Some(folder) = &plan.out {
        report::write(plan, &rows, &document, folder)?;
        let report = folder.join("report.html");
        say(format_args!("wrote {}", report.display()));
    }
    verdict(&rows)?;
    match (&plan.out, complete) {
        (_, true) => Ok(()),
        (Some(folder), false) => Err(Failure::Continuable(folder.join(journal::FILE))),
        (None, false) => Err(Failure::Interrupted),
    }
}

/// What decides what is done.
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
            "--orders {}",
            list(orders.iter().map(ToString::to_string).collect())
        ),
        format!(
            "--widths {}",
            list(widths.iter().map(ToString::to_string).collect())
        ),
        format!(
            "--trees {}",
            list(trees.iter().map(ToString::to_string).collect())
        ),
        format!(
            "--collapses {}",
            list(collapses.iter().map(ToString::to_string).collect())
        ),
        plan.spp
            .map_or_else(String::new, |spp| format!("--spp {spp}")),
        format!("--repeat {} --seed {}", plan.repeat, plan.seed),
        format!("--level {}", plan.isa.level()),
        format!("--threads {}", rayon::current_num_threads()),
        format!("--replay {} --log-size {}", plan.replay, plan.log_size),
        format!("--rays-from {}", plan.rays_from.name()),
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
    progress: Progress,
    /// What the log size means in a scene, by its stem, as far as it is known.
    log_rays: HashMap<&'a str, usize>,
}

impl<'a> Study<'a> {
    fn has_rows(&self) -> bool {
        !self.rows().is_empty()
    }

    /// Does everything.
    fn run(&mut self) -> Result<(), Failure> {
        let plan = self.plan;
        let renderings = plan.renderings();
        let mut left = [renderings.len() * plan.scenes.len(), 0];
        for subject in &plan.scenes {
            // The exact number of replays is known when the scene's rays are.
            left[1] += plan.replays(subject, 1 << 14).len();
        }
        self.progress.expect(left);
        for subject in &plan.scenes {
            self.scene(subject, &renderings)?;
        }
        Ok(())
    }

    /// Does everything with one scene.
    fn scene(&mut self, subject: &'a Subject, renderings: &[Rendering]) -> Result<(), Failure> {
        let plan = self.plan;
        let world = source::world(&subject.scene, plan.base().0)?;
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
                self.progress
                    .retitle(format!("{}, width {width}, {order}", common.scene));
                let row = pictures::render_one(
                    plan,
                    subject,
                    &world,
                    rendering,
                    log_share,
                    &common,
                    &self.progress,
                )?;
                self.journal.add(key, row)?;
                self.progress.finished(Step::Rendering);
            } else {
                self.progress.skipped(Step::Rendering);
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
    ) -> Result<(), Failure> {
        let replays = self.plan.replays(subject, bench.log_rays);
        for same_forest in replays.chunk_by(|a, b| a.shares_forest(b)) {
            let is_left = |replay: &plan::Replay| self.journal.get(&replay.key(subject)).is_none();
            let left: Vec<_> = same_forest.iter().filter(|r| is_left(r)).copied().collect();
            for _ in left.len()..same_forest.len() {
                self.progress.skipped(Step::Replay);
            }
            let Some(first) = left.first() else {
                continue;
            };
            if !bench.has_rays(first.kind) {
                continue;
            }
            let forest = bench.forest(first)?;
            for same_grove in left.chunk_by(|a, b| a.shares_grove(b)) {
                interrupt::check()?;
                let plan::Combination {
                    width, collapse, ..
                } = same_grove[0].combination;
                let mut grove: Grove = forest.collapse(collapse, width, self.plan.isa);
                for replay in same_grove {
                    interrupt::check()?;
                    let Combination { tree, order, .. } = replay.combination;
                    self.progress.retitle(format!(
                        "{}, width {width}, {tree} {collapse} {order}",
                        common.scene
                    ));
                    let found = bench.measure(replay, &mut grove)?;
                    let row = Row::of_replay(common, replay, &found);
                    self.journal.add(replay.key(subject), row)?;
                    self.progress.finished(Step::Replay);
                }
            }
        }
        Ok(())
    }

    /// The finished rows in the order of the plan, each with its scene's place. Times of renderings are the
    /// fastest of the rounds that all combinations of a width had; the counting round only if there is no other.
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
                    let seconds = |row: &&Row| row.render_seconds.unwrap_or(f64::INFINITY);
                    if let Some(fastest) = timed.min_by(|a, b| seconds(a).total_cmp(&seconds(b))) {
                        row.time(fastest);
                    }
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

/// Fails unless all images of a scene are the same, and all answers.
fn verdict(rows: &[(usize, Row)]) -> Result<(), Failure> {
    let mut first = HashMap::new();
    let mut differing = Vec::new();
    for (place, row) in rows {
        let image = row.image_hash.as_ref();
        let same = image.is_none_or(|hash| *first.entry(*place).or_insert(hash) == hash);
        if !same || row.equal_answers == Some(false) {
            differing.push(format!(
                "{}, width {}, {} {} {}, {:?} of {} rays",
                row.scene,
                row.width,
                row.tree,
                row.collapse,
                row.order,
                row.by,
                row.rays.name()
            ));
        }
    }
    if differing.is_empty() {
        return Ok(());
    }
    Err(Failure::Work(format!(
        "all images of a scene, and all answers to its rays, must be the same bit for bit, but these are not as the first ones:\n  {}",
        differing.join("\n  ")
    )))
}

/// The name, with a number if it is taken.
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
