//! Benchmarks: rays per second, ours and Embree's, on the rays of a scene's camera paths.
//!
//! [`run`] measures what [`Options`] say and returns [`Results`].
//!
//! - `model`: what is made of a scene, and its size;  `sphere`: spheres as meshes;  `reference`: the right answers
//! - `engine`: what can be measured;  `ours`, `rival`: our trees and Embree as engines
//! - `builds`: build times and sizes;  `kinds`: what there is beside plain triangles
//! - `record`: the JSON document;  `report`: tables and Markdown;  `chart`: its bars

mod builds;
mod chart;
mod engine;
mod kinds;
mod model;
mod ours;
mod record;
mod reference;
mod report;
mod rival;
mod sphere;
#[cfg(test)]
mod tests;

use std::fmt;
use std::num::NonZeroUsize;
use std::path::Path;

use antumbra::recipe::{Builder, Collapse, Order};
use antumbra::{Brute, Isa, Primitives, Ray, Recipe, Width};
use antumbra_render::Lowered;
use antumbra_scene::Scene;
use antumbra_trees::BUILDERS;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::embree::{self, Device, SceneFlags};
use crate::harness::{self, Answers, Measured, TOLERANCE, Team, median, median_ratio};
use crate::still::still_world;
use crate::watch::{self, Watcher};
use crate::{Caller, Error, Machine, Rays, Table, collect_rays};
use engine::{Engine, Label, Query, TreeLabel};
use ours::{Api, Ingredients, Ours, Tree};
use record::{KINDS, distinct};
use reference::Reference;
use rival::{Rival, Variant};

pub use crate::embree::Embree;
pub use model::Size;
pub use record::{BuildRow, Check, Document, KindRow, Row, StepSeconds};

/// Rounds of builds: they take long and swing little.
const BUILD_ROUNDS: usize = 3;

/// Everything that a caller may choose about a benchmark.
#[derive(Clone)]
pub struct Options {
    /// Embree, for comparison. Without it there are no ratios.
    pub embree: Option<Embree>,
    /// Rays of each kind; fewer if the scene's paths do not have so many.
    pub rays: usize,
    /// Training rays, half shadow, half diffuse. None of them is timed.
    pub log_rays: usize,
    /// Child orders.
    pub orders: Vec<Order>,
    /// Collapses.
    pub collapses: Vec<Collapse>,
    /// Children per node; `None` is what suits the instruction set.
    pub widths: Vec<Option<Width>>,
    /// Builder of the trees that are traced.
    pub builder: Builder,
    /// Builders whose build times are measured.
    pub builds: Vec<Builder>,
    /// Whether to measure what there is beside plain triangles, on one thread: quads, user geometry, conditions, refits, points.
    pub kinds: bool,
    /// Whether batches prefetch nodes and leaves; `None` is by the size of the tree.
    pub prefetch: Option<bool>,
    /// Instruction sets, of Embree too. At least one.
    pub isas: Vec<Isa>,
    /// Numbers of threads; `None` is all of the current pool.
    pub threads: Vec<Option<NonZeroUsize>>,
    /// Rounds in which every engine is timed once.
    pub repeat: usize,
    /// Seed of all random values.
    pub seed: u64,
    /// The program that runs the benchmark.
    pub caller: Caller,
}

impl Default for Options {
    /// The tree of the default recipe, on the best instruction set, on one thread and on all.
    fn default() -> Self {
        let recipe = Recipe::default();
        Self {
            embree: None,
            rays: 131_072,
            log_rays: 65_536,
            orders: vec![recipe.order],
            collapses: vec![recipe.collapse],
            widths: vec![None],
            builder: recipe.builder,
            builds: BUILDERS.to_vec(),
            kinds: false,
            prefetch: None,
            isas: vec![Isa::best()],
            threads: vec![Some(NonZeroUsize::MIN), None],
            repeat: 9,
            seed: 0,
            caller: Caller::default(),
        }
    }
}

impl Options {
    /// The widths on an instruction set, each once.
    fn widths_on(&self, isa: Isa) -> Vec<Width> {
        let auto = Width::auto(isa.level());
        distinct(self.widths.iter().map(|width| width.unwrap_or(auto)))
    }

    /// The numbers of threads, each once.
    fn thread_counts(&self) -> Vec<NonZeroUsize> {
        let all = NonZeroUsize::new(rayon::current_num_threads()).unwrap_or(NonZeroUsize::MIN);
        distinct(self.threads.iter().map(|count| count.unwrap_or(all)))
    }
}

/// Results of a benchmark.
pub struct Results {
    document: Document,
    end: Result<(), Error>,
}

/// Measures how many rays per second are answered.
///
/// The rays come from camera paths of up to five bounces: camera rays, shadow rays to the lights, and diffuse
/// bounces. All engines take turns on one list of rays; ratios are medians over the rounds. All answers are compared
/// with a watertight reference, which is compared with brute force.
///
/// # Errors
/// A failure before there is any result. A later failure is the [end](Results::end) of the results.
pub fn run(scenes: Vec<Scene>, options: &Options, watcher: &dyn Watcher) -> Result<Results, Error> {
    let first = options.isas.first().copied().unwrap_or_else(Isa::best);
    for isa in &options.isas {
        let level = isa.level();
        if options.embree.is_some() && embree::isa(level).is_none() {
            watcher.note(&format!("Embree is not compared with on level {level}."));
        }
    }
    let mut bench = Bench {
        options,
        watcher,
        threads: options.thread_counts(),
        document: Document {
            schema: "antumbra.bench/1",
            machine: Machine::new(first, &options.caller),
            compiler: options.caller.compiler.clone(),
            commit: options.caller.commit.clone(),
            embree: options.embree.map(Embree::version),
            seed: options.seed,
            repeat: options.repeat,
            log_rays: options.log_rays,
            complete: false,
            checks: Vec::new(),
            builds: Vec::new(),
            rows: Vec::new(),
            kinds: Vec::new(),
        },
    };
    let end = bench.all(scenes);
    let mut document = bench.document;
    document.complete = end.is_ok();
    match end {
        Err(error) if document.rows.is_empty() => Err(error),
        end => Ok(Results { document, end }),
    }
}

impl Results {
    /// Everything as a JSON document.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// The means over all scenes, and the build times. The tables of every scene are
    /// [shown](Watcher::show) when it is finished.
    pub fn tables(&self) -> Vec<Table> {
        let mut tables = report::tables(&self.document.means());
        tables.push(report::builds(&self.document.builds));
        tables
    }

    /// Meaning of the words in the headings of the tables.
    pub fn legend(&self) -> &'static str {
        report::LEGEND
    }

    /// Writes `bench.json`, `bench.md` and `bench.svg` to a directory.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, directory: &Path) -> Result<(), Error> {
        report::write(&self.document, directory)
    }

    /// How the benchmark ended: finished, or why not.
    ///
    /// # Errors
    /// [`Error::Differ`] if an answer of ours is wrong, otherwise what stopped the benchmark.
    pub fn end(self) -> Result<(), Error> {
        verdict(&self.document)?;
        self.end
    }
}

/// Fails if an answer of ours was wrong.
fn verdict(document: &Document) -> Result<(), Error> {
    let mut wrong = Vec::new();
    for check in document.checks.iter().filter(|one| one.disagreements > 0) {
        wrong.push(format!(
            "{}: {} of {} {} rays against brute force",
            check.scene, check.disagreements, check.ray_count, check.rays
        ));
    }
    let rows = document.rows.iter().filter(|row| row.engine == "antumbra");
    for row in rows.filter(|row| row.disagreements > 0) {
        wrong.push(format!(
            "{}: {} of {} {} rays, {} {}, width {}, order {}, {}",
            row.scene,
            row.disagreements,
            row.ray_count,
            row.rays,
            row.api,
            row.query,
            row.width.unwrap_or_default(),
            row.order.unwrap_or_default(),
            row.level
        ));
    }
    let kinds = document.kinds.iter().filter(|row| row.engine == "antumbra");
    for row in kinds.filter(|row| row.disagreements > 0) {
        wrong.push(format!(
            "{}: {} of {}, {}, {} {}, {}",
            row.scene, row.disagreements, row.count, row.kind, row.api, row.query, row.level
        ));
    }
    if wrong.is_empty() {
        return Ok(());
    }
    Err(Error::Differ {
        rule: "every tree must give the answers of brute force, bit for bit",
        found: wrong,
    })
}

/// A pool of its own for everything that is timed on so many threads.
fn pool(threads: NonZeroUsize) -> Result<ThreadPool, Error> {
    ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build()
        .map_err(|source| Error::Threads {
            threads: threads.get(),
            source,
        })
}

/// A benchmark under way.
struct Bench<'a> {
    options: &'a Options,
    watcher: &'a dyn Watcher,
    threads: Vec<NonZeroUsize>,
    document: Document,
}

/// Rays of one kind with the right answers.
struct List {
    kind: &'static str,
    rays: Vec<Ray>,
    reference: Reference,
}

/// One scene, ready to be traced.
struct Subject<'s> {
    name: &'s str,
    model: Lowered<'s>,
    timed: Rays,
    sample: Rays,
}

impl<'s> Subject<'s> {
    /// Takes a prepared scene apart: into what can be hit, and the rays of its camera paths.
    fn new(scene: &'s Scene, options: &Options, watcher: &dyn Watcher) -> Result<Self, Error> {
        let world = still_world(scene, Builder::default())?;
        watch::check(watcher)?;
        let isa = Isa::best();
        let bvh = world.bvh(antumbra::recipe::Engine::of(isa));
        let timed = collect_rays(&world, &bvh, options.rays, options.seed);
        watch::check(watcher)?;
        // Another seed: what is learned must hold for rays that were not seen.
        let each = options.log_rays.div_ceil(2);
        let mut sample = collect_rays(&world, &bvh, each, options.seed.wrapping_add(1));
        sample.diffuse.truncate(options.log_rays - each);
        Ok(Self {
            name: &scene.name,
            model: Lowered::new(scene),
            timed,
            sample,
        })
    }
}

impl Bench<'_> {
    fn all(&mut self, scenes: Vec<Scene>) -> Result<(), Error> {
        for mut scene in scenes {
            self.note(format_args!("{}: collecting rays", scene.name));
            model::prepare(&mut scene);
            let subject = Subject::new(&scene, self.options, self.watcher)?;
            let begun = self.document.rows.len();
            let begun_kinds = self.document.kinds.len();
            self.scene(subject)?;
            let mut tables = report::tables(&self.document.rows[begun..]);
            tables.extend(report::kinds(&self.document.kinds[begun_kinds..]));
            self.watcher.show(&tables).map_err(Error::Show)?;
        }
        Ok(())
    }

    fn note(&self, text: fmt::Arguments<'_>) {
        self.watcher.note(&text.to_string());
    }

    fn check(&self) -> Result<(), Error> {
        watch::check(self.watcher)
    }

    fn scene(&mut self, subject: Subject) -> Result<(), Error> {
        let Subject {
            name,
            model,
            timed,
            sample,
        } = &subject;
        self.note(format_args!("{name}: building"));
        for &isa in &self.options.isas {
            let plan = builds::Plan {
                scene: name,
                model,
                width: self.options.widths_on(isa)[0],
                isa,
                builders: &self.options.builds,
                threads: &self.threads,
                rounds: BUILD_ROUNDS.min(self.options.repeat),
                embree: self.options.embree,
            };
            let built = builds::measure(&plan, self.watcher)?;
            self.document.builds.extend(built);
        }
        let primitives = model.primitives()?;
        let recipe = Recipe::default()
            .builder(self.options.builder)
            .prefetch(self.options.prefetch)
            .seed(self.options.seed);
        let ingredients = Ingredients::new(&primitives, sample, &recipe);
        let mut lists = Vec::new();
        for isa in self.options.isas.clone() {
            let trees = self.trees(&ingredients, isa)?;
            if lists.is_empty() {
                self.note(format_args!("{name}: checking the reference"));
                lists = self.lists(name, timed, &trees[0], &primitives, model);
                self.check()?;
            }
            self.note(format_args!("{name}: measuring on {}", isa.level()));
            self.level(name, model, &lists, &trees, isa)?;
            if self.options.kinds {
                self.note(format_args!("{name}: measuring kinds on {}", isa.level()));
                self.kinds(&subject, recipe, isa)?;
            }
        }
        Ok(())
    }

    /// Measures everything beside plain triangles, on one instruction set.
    fn kinds(&mut self, subject: &Subject, recipe: Recipe, isa: Isa) -> Result<(), Error> {
        let plan = kinds::Plan {
            scene: subject.name,
            model: &subject.model,
            rays: &subject.timed,
            sample: &subject.sample,
            recipe,
            isa,
            pool: &pool(NonZeroUsize::MIN)?,
            rounds: self.options.repeat,
            embree: self.options.embree,
            watcher: self.watcher,
        };
        let kinds::Found { rows, checks } = kinds::measure(&plan)?;
        self.document.kinds.extend(rows);
        self.document.checks.extend(checks);
        Ok(())
    }

    /// A tree for every width, collapse and order requested.
    fn trees(&self, ingredients: &Ingredients, isa: Isa) -> Result<Vec<Tree>, Error> {
        let mut trees = Vec::new();
        for width in self.options.widths_on(isa) {
            for &collapse in &self.options.collapses {
                for &order in &self.options.orders {
                    let tree = ingredients.tree(width, collapse, order, isa);
                    trees.push(tree?);
                    self.check()?;
                }
            }
        }
        Ok(trees)
    }

    /// The rays with their reference, checked. Kinds without rays are left out.
    fn lists(
        &mut self,
        name: &str,
        rays: &Rays,
        tree: &Tree,
        primitives: &Primitives,
        model: &Lowered,
    ) -> Vec<List> {
        let triangles = Size::of(model).triangles;
        let brute = Brute::new(primitives);
        let rays = [&rays.primary, &rays.shadow, &rays.diffuse];
        let mut lists = Vec::new();
        for (kind, rays) in KINDS.into_iter().zip(rays) {
            if rays.is_empty() {
                self.note(format_args!("{name}: its paths have no {kind} rays"));
                continue;
            }
            let reference = Reference::new(&tree.bvh, rays);
            let [ray_count, disagreements] = reference.check(rays, &brute, triangles);
            self.document.checks.push(Check {
                scene: name.to_owned(),
                rays: kind,
                ray_count,
                disagreements,
            });
            lists.push(List {
                kind,
                rays: rays.clone(),
                reference,
            });
        }
        lists
    }

    /// Everything on one instruction set.
    fn level(
        &mut self,
        name: &str,
        model: &Lowered,
        lists: &[List],
        trees: &[Tree],
        isa: Isa,
    ) -> Result<(), Error> {
        let rivals = self.rivals(model, isa)?;
        let mut engines: Vec<Box<dyn Engine + '_>> = Vec::new();
        if let Some([default, robust]) = &rivals {
            let rivals = [
                (default, Variant::Default),
                (default, Variant::Packets),
                (robust, Variant::Robust),
            ];
            for (scene, variant) in rivals {
                engines.push(Box::new(Rival { scene, variant }));
            }
        }
        for tree in trees {
            for api in [Api::Single, Api::Batch] {
                engines.push(Box::new(Ours { tree, api }));
            }
        }
        let engines: Vec<&dyn Engine> = engines.iter().map(|engine| &**engine).collect();
        let rounds = self.options.repeat;
        let known: Vec<_> = lists.iter().map(|list| known(trees, &list.rays)).collect();
        for &threads in &self.threads {
            let pool = pool(threads)?;
            for query in Query::ALL {
                for (list, known) in lists.iter().zip(&known) {
                    let reference = list.reference.answers(query);
                    let outcomes = measure(
                        &engines,
                        (query, &list.rays, reference),
                        (&pool, rounds, self.watcher),
                    )?;
                    let blank = Row {
                        scene: name.to_owned(),
                        size: Size::of(model),
                        rays: list.kind,
                        ray_count: list.rays.len(),
                        query: query.name(),
                        level: isa.level().to_string(),
                        threads: threads.get(),
                        occluded: reference.occluded_share(),
                        ..Row::default()
                    };
                    self.document.rows.extend(rows(&blank, known, &outcomes));
                }
            }
        }
        Ok(())
    }

    /// Embree's scenes, without and with the robust flag.
    fn rivals<'m>(
        &self,
        model: &'m Lowered,
        isa: Isa,
    ) -> Result<Option<[embree::Scene<'m>; 2]>, Error> {
        let Some((embree, isa)) = self.options.embree.zip(embree::isa(isa.level())) else {
            return Ok(None);
        };
        let build = |flags| {
            // All threads, whatever the queries will use: with one, a thread of Embree's scheduler spins until
            // the device goes, and takes its share of the core that the queries are timed on.
            let device = Device::new(embree, Some(isa), 0)?;
            embree::Scene::build(&device, model, flags)
        };
        let default = build(SceneFlags::default())?;
        Ok(Some([default, build(SceneFlags::ROBUST)?]))
    }
}

/// Times and mistakes of one engine.
struct Outcome {
    label: Label,
    seconds: Vec<f64>,
    /// Rays answered otherwise than the reference says. Our own engines must give the same bits, others may be
    /// off by rounding.
    disagreements: usize,
}

impl Outcome {
    fn new(label: Label, measured: Measured, right: &Answers) -> Self {
        let tolerance = if label.tree.is_some() { 0.0 } else { TOLERANCE };
        Self {
            label,
            seconds: measured.seconds,
            disagreements: measured.answers.differing_from(right, tolerance),
        }
    }
}

/// Has every engine that knows the query answer rays. They are cut into as many runs as the pool has threads.
fn measure(
    engines: &[&dyn Engine],
    (query, rays, right): (Query, &[Ray], &Answers),
    (pool, rounds, watcher): (&ThreadPool, usize, &dyn Watcher),
) -> Result<Vec<Outcome>, Error> {
    let run_length = rays.len().div_ceil(pool.current_num_threads()).max(1);
    let (mut labels, mut teams) = (Vec::new(), Vec::new());
    for engine in engines {
        let runs = rays.chunks(run_length);
        if let Some(team) = runs
            .map(|run| engine.work(query, run))
            .collect::<Option<Team>>()
        {
            labels.push(engine.label());
            teams.push(team);
        }
    }
    let measured = harness::measure(teams, pool, rounds, watcher)?;
    let outcomes = labels.into_iter().zip(measured);
    Ok(outcomes
        .map(|(label, measured)| Outcome::new(label, measured, right))
        .collect())
}

/// Facts about a tree that need no clock.
struct Known {
    label: TreeLabel,
    prefetch: bool,
    /// Mean node and primitive tests of an occlusion ray.
    tests: [f64; 2],
}

/// Facts about every tree.
fn known(trees: &[Tree], rays: &[Ray]) -> Vec<Known> {
    let known = |Tree { bvh, label }: &Tree| Known {
        label: *label,
        prefetch: bvh.report().prefetches,
        tests: ours::mean_tests(bvh, rays),
    };
    trees.iter().map(known).collect()
}

/// Rows from what was measured; `blank` says of what.
fn rows(blank: &Row, known: &[Known], outcomes: &[Outcome]) -> Vec<Row> {
    let mut reference = outcomes.iter();
    let reference = reference.find(|outcome| outcome.label == Rival::REFERENCE);
    let row = |outcome: &Outcome| {
        let tree = outcome.label.tree;
        let seconds = median(outcome.seconds.iter().copied());
        let known = tree.and_then(|tree| known.iter().find(|known| known.label == tree));
        let counted = known.filter(|_| blank.query == Query::Occluded.name());
        Row {
            engine: outcome.label.engine,
            api: outcome.label.api,
            width: tree.map(|tree| tree.width),
            order: tree.map(|tree| tree.order),
            builder: tree.map(|tree| tree.builder),
            collapse: tree.map(|tree| tree.collapse),
            mrays_per_s: blank.ray_count as f64 / seconds / 1e6,
            ratio_to_embree: reference
                .map(|reference| median_ratio(&outcome.seconds, &reference.seconds)),
            disagreements: outcome.disagreements,
            prefetch: known.map(|known| known.prefetch),
            node_tests: counted.map(|known| known.tests[0]),
            prim_tests: counted.map(|known| known.tests[1]),
            ..blank.clone()
        }
    };
    outcomes.iter().map(row).collect()
}
