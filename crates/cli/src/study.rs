//! `antumbra study`: the same pictures by several orders and widths, and what each cost. These are the
//! tables 2 and 3 of Ogaki and Derouet-Jourdan (2016), for any scene.

use std::path::PathBuf;

use antumbra::{Collapse, Isa, Order, Width};
use antumbra_image::Image;
use antumbra_render::{Options, Stats, World, render};
use antumbra_scene::Scene;
use serde::Serialize;

use crate::args::StudyArgs;
use crate::exit::{Failure, say};
use crate::json::{self, Destination};
use crate::machine::Machine;
use crate::progress::Progress;
use crate::render::hash_text;
use crate::source::Loaded;
use crate::{output, report, source};

/// One rendering, summed up. "Before" is measured over the shadow rays that were learned from, "after"
/// over the others; tests are means per shadow ray.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub scene: String,
    pub triangles: usize,
    pub width: usize,
    pub order: &'static str,
    pub collapse: &'static str,
    pub level: String,
    pub threads: usize,
    pub spp: u32,
    pub shadow_rays: u64,
    pub shadow_share: f64,
    pub node_tests_before: Option<f64>,
    pub prim_tests_before: Option<f64>,
    pub node_tests_after: Option<f64>,
    pub prim_tests_after: Option<f64>,
    /// Node tests outside of instances; null in a scene without any.
    pub top_node_tests_before: Option<f64>,
    pub top_node_tests_after: Option<f64>,
    pub predicted_cost_before: Option<f64>,
    pub predicted_cost_after: Option<f64>,
    pub log_seconds: f64,
    pub sort_seconds: f64,
    pub build_seconds: f64,
    pub render_seconds: f64,
    pub image_hash: String,
}

impl Row {
    /// The row of a rendering that counted; its times include that.
    fn new(scene: &Scene, options: &Options, stats: &Stats) -> Self {
        let two_levels = !scene.instances.is_empty();
        Self {
            scene: scene.name.clone(),
            triangles: stats.triangles,
            width: options.width.lanes(),
            order: options.order.name(),
            collapse: options.collapse.name(),
            level: options.isa.level().to_string(),
            threads: stats.threads,
            spp: stats.spp,
            shadow_rays: stats.shadow_rays,
            shadow_share: stats.shadow_share(),
            node_tests_before: stats.node_tests_before,
            prim_tests_before: stats.prim_tests_before,
            node_tests_after: stats.node_tests_after,
            prim_tests_after: stats.prim_tests_after,
            top_node_tests_before: stats.top_node_tests[0].filter(|_| two_levels),
            top_node_tests_after: stats.top_node_tests[1].filter(|_| two_levels),
            predicted_cost_before: stats.predicted_cost_before,
            predicted_cost_after: stats.predicted_cost_after,
            log_seconds: stats.log_seconds,
            sort_seconds: stats.sort_seconds,
            build_seconds: stats.build_seconds,
            render_seconds: stats.render_seconds,
            image_hash: hash_text(stats.image_hash),
        }
    }
}

/// The renderings of one scene by one width.
pub struct Group {
    /// The scene's name as part of file names; no two scenes of a study share one.
    pub stem: String,
    pub scene: String,
    pub width: Width,
    pub entries: Vec<Entry>,
    /// The picture, kept only if it is to be written.
    pub image: Option<Image>,
}

/// One rendering of a group.
pub struct Entry {
    pub order: Order,
    pub row: Row,
    /// Seconds in shadow queries, summed over the threads.
    pub shadow_seconds: f64,
    /// Seconds in everything, summed over the threads.
    pub busy_seconds: f64,
    /// Mean tests per shadow ray of every pixel, kept only if they are to be drawn.
    pub cost_map: Option<Vec<f32>>,
}

/// The JSON document.
#[derive(Serialize)]
pub struct Document<'a> {
    pub schema: &'static str,
    #[serde(flatten)]
    pub machine: Machine,
    pub seed: u64,
    /// Whether there is a row for every scene, width and order that was asked for, timed as often; if not,
    /// the study was interrupted.
    pub complete: bool,
    pub rows: Vec<&'a Row>,
}

/// What is to be studied.
pub struct Plan {
    pub scenes: Vec<Loaded>,
    pub orders: Vec<Order>,
    pub widths: Vec<Width>,
    pub collapse: Collapse,
    pub spp: Option<u32>,
    /// Renderings without counting, for the times; the fastest counts. If 0, the counting ones are timed.
    pub repeat: u32,
    pub seed: u64,
    pub isa: Isa,
    pub out: Option<PathBuf>,
    pub json: Option<Destination>,
}

/// Runs the command.
pub fn run(args: &StudyArgs) -> Result<(), Failure> {
    let isa = args.rendering.isa()?;
    if let Some(path) = args.json.as_ref().and_then(Destination::file) {
        output::check_file(path)?;
    }
    args.rendering.start_threads()?;
    execute(&Plan {
        scenes: source::load_all(&args.scenes, &args.rendering)?,
        orders: args.orders.0.clone(),
        widths: args.widths.on(isa),
        collapse: args.rendering.collapse,
        spp: args.rendering.spp,
        repeat: args.repeat,
        seed: args.rendering.seed,
        isa,
        out: args.out.clone(),
        json: args.json.clone(),
    })
}

/// Renders everything, reports it, and fails if two images of a scene differ. If interrupted, reports what
/// was finished.
pub fn execute(plan: &Plan) -> Result<(), Failure> {
    if let Some(directory) = &plan.out {
        output::make_directory(directory)?;
    }
    let mut groups = Vec::new();
    let mut hashes = Hashes::default();
    let complete = match render_all(plan, &mut groups, &mut hashes) {
        Ok(()) => true,
        Err(Failure::Interrupted) if !groups.is_empty() => false,
        Err(failure) => return Err(failure),
    };
    write(plan, &groups, complete)?;
    hashes.verdict()?;
    if complete {
        Ok(())
    } else {
        Err(Failure::Interrupted)
    }
}

/// Renders everything. Groups with at least one rendering are there also after a failure.
fn render_all(plan: &Plan, groups: &mut Vec<Group>, hashes: &mut Hashes) -> Result<(), Failure> {
    let mut stems = Vec::new();
    for loaded in &plan.scenes {
        let world = source::world(&loaded.scene)?;
        let stem = unused(output::file_stem(&loaded.scene.name), &mut stems);
        hashes.first = None;
        for &width in &plan.widths {
            let mut group = Group {
                stem: stem.clone(),
                scene: loaded.scene.name.clone(),
                width,
                entries: Vec::new(),
                image: None,
            };
            let end = group.render(plan, &loaded.scene, &world, hashes);
            if !group.entries.is_empty() {
                groups.push(group);
            }
            end?;
        }
    }
    Ok(())
}

/// Writes the tables, the JSON document and the folder.
fn write(plan: &Plan, groups: &[Group], complete: bool) -> Result<(), Failure> {
    let document = Document {
        schema: "antumbra.study/1",
        machine: Machine::new(plan.isa),
        seed: plan.seed,
        complete,
        rows: groups
            .iter()
            .flat_map(|group| group.entries.iter().map(|entry| &entry.row))
            .collect(),
    };
    report::show(groups, &document, plan.json == Some(Destination::Stdout))?;
    json::write(&document, plan.json.as_ref())?;
    if let Some(directory) = &plan.out {
        report::write(groups, &document, directory)?;
        let report = directory.join("report.md");
        say(format_args!("wrote {}", report.display()));
    }
    Ok(())
}

impl Group {
    /// Renders a scene by every order: once counting, then as often as asked without. The orders take
    /// turns, so that what disturbs the machine for a while disturbs all of them; times are taken over
    /// when all had their turn, so that those of an interrupted group were measured in the same way.
    fn render(
        &mut self,
        plan: &Plan,
        scene: &Scene,
        world: &World,
        hashes: &mut Hashes,
    ) -> Result<(), Failure> {
        let width = self.width;
        let mut turns = Vec::new();
        let mut progress = Progress::new("");
        let steps = plan.orders.len() * (1 + plan.repeat as usize);
        for step in 0..steps {
            let (round, place) = (step / plan.orders.len(), step % plan.orders.len());
            let order = plan.orders[place];
            let counting = round == 0;
            let title = format!("{}, width {width}, {order}", scene.name);
            progress.retitle(format!("{title} ({} of {steps})", step + 1));
            let options = Options {
                spp: plan.spp,
                seed: plan.seed,
                order,
                collapse: plan.collapse,
                width,
                isa: plan.isa,
                count: counting,
                cost_map: counting && plan.out.is_some(),
                ..Options::default()
            };
            let rendering = render(world, &options, &progress)?;
            hashes.note(rendering.stats.image_hash, title);
            if counting {
                if plan.out.is_some() && self.image.is_none() {
                    self.image = Some(rendering.image);
                }
                self.entries.push(Entry {
                    order,
                    row: Row::new(scene, &options, &rendering.stats),
                    shadow_seconds: rendering.stats.split.shadow,
                    busy_seconds: rendering.stats.split.busy(),
                    cost_map: rendering.cost_map,
                });
            } else {
                turns.push(rendering.stats);
                if turns.len() == plan.orders.len() {
                    for (entry, stats) in self.entries.iter_mut().zip(turns.drain(..)) {
                        entry.time(&stats, round == 1);
                    }
                }
            }
        }
        Ok(())
    }
}

impl Entry {
    /// Takes over the times of a rendering if it is the first or the fastest.
    fn time(&mut self, stats: &Stats, first: bool) {
        if first || stats.render_seconds < self.row.render_seconds {
            self.row.log_seconds = stats.log_seconds;
            self.row.sort_seconds = stats.sort_seconds;
            self.row.build_seconds = stats.build_seconds;
            self.row.render_seconds = stats.render_seconds;
            self.shadow_seconds = stats.split.shadow;
            self.busy_seconds = stats.split.busy();
        }
    }
}

/// Watches that all images of a scene are the same.
#[derive(Default)]
struct Hashes {
    first: Option<u64>,
    differing: Vec<String>,
}

impl Hashes {
    fn note(&mut self, hash: u64, title: String) {
        if *self.first.get_or_insert(hash) != hash && !self.differing.contains(&title) {
            self.differing.push(title);
        }
    }

    fn verdict(self) -> Result<(), Failure> {
        if self.differing.is_empty() {
            return Ok(());
        }
        Err(Failure::Work(format!(
            "all images of a scene must be the same bit for bit, but these are not as its first one:\n  {}",
            self.differing.join("\n  ")
        )))
    }
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
    fn different_images_are_a_failure() {
        let mut hashes = Hashes::default();
        hashes.note(1, "a".into());
        hashes.note(1, "b".into());
        assert!(hashes.differing.is_empty());
        hashes.note(2, "c".into());
        let failure = hashes.verdict().expect_err("two images");
        assert!(
            matches!(&failure, Failure::Work(text) if text.ends_with("  c")),
            "{failure}"
        );
    }

    #[test]
    fn scenes_of_one_name_get_files_of_their_own() {
        let mut taken = Vec::new();
        let names = ["a", "b", "a", "a"].map(|name| unused(name.into(), &mut taken));
        assert_eq!(names, ["a", "b", "a-2", "a-3"]);
    }
}
