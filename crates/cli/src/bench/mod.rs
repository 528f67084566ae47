//! `antumbra bench`: rays per second, ours and Embree's, on the rays that a scene's camera paths really ask.
//!
//! - `model`: what is made of a scene, and its size;  `sphere`: spheres as meshes;  `reference`: the right answers
//! - `engine`: what can be measured;  `ours`, `rival`: our trees and Embree as engines;  `embree`: the library
//! - `measure`: engines taking turns;  `builds`: build times and sizes
//! - `record`: the JSON document;  `report`: tables and Markdown;  `chart`: bars

mod builds;
mod chart;
#[allow(unsafe_code, reason = "the binding of a C library")]
mod embree;
mod engine;
mod measure;
mod model;
mod ours;
mod record;
mod reference;
mod report;
mod rival;
mod sphere;
#[cfg(test)]
mod tests;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use antumbra::{BinaryTree, Brute, Builder, Isa, Primitives, Ray};
use antumbra_render::{Lowered, Rays, collect_rays};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::args::{self, BenchArgs};
use crate::exit::{Failure, say};
use crate::json::{self, Destination};
use crate::machine::Machine;
use crate::source::Loaded;
use crate::{interrupt, output, source};
use embree::{Device, Embree, Scene};
use engine::{Engine, Query, TreeLabel};
use measure::{Outcome, median, median_ratio};
use model::Size;
use ours::{Api, Ingredients, Ours, Tree, training_rays, tree_log};
use record::{Check, Document, KINDS, Row};
use reference::Reference;
use rival::{Rival, Variant};

/// Names the library if `--embree` does not.
const VARIABLE: &str = "ANTUMBRA_EMBREE";
/// Rounds of builds: they take long and swing little.
const BUILD_ROUNDS: usize = 3;

/// Runs the command.
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    let isas = args.levels.isas()?;
    if let Some(path) = args.json.as_ref().and_then(Destination::file) {
        output::check_file(path)?;
    }
    let embree = load_embree(args)?;
    let alone = isas.iter().map(|isa| isa.level());
    for level in alone.filter(|&level| embree.is_some() && embree::isa(level).is_none()) {
        say(format_args!(
            "Embree is not compared with on level {level}."
        ));
    }
    args::start_threads(None)?;
    let scenes = source::load_each(&args.scenes)?;
    if let Some(directory) = &args.out {
        output::make_directory(directory)?;
    }
    let mut bench = Bench {
        args,
        threads: args.threads.counts(),
        embree,
        document: Document {
            schema: "antumbra.bench/1",
            machine: Machine::new(isas[0]),
            compiler: option_env!("ANTUMBRA_COMPILER"),
            commit: option_env!("ANTUMBRA_COMMIT"),
            embree: embree.map(Embree::version),
            seed: args.seed,
            repeat: args.repeat as usize,
            log_rays: args.log_rays as usize,
            complete: false,
            checks: Vec::new(),
            builds: Vec::new(),
            rows: Vec::new(),
        },
        isas,
    };
    let end = bench.all(scenes);
    let mut document = bench.document;
    document.complete = end.is_ok();
    if end.is_err() && document.rows.is_empty() {
        return end;
    }
    report::finish(&document, args.json.as_ref())?;
    json::write(&document, args.json.as_ref())?;
    if let Some(directory) = &args.out {
        report::write(&document, directory)?;
        say(format_args!(
            "wrote {}",
            directory.join("bench.md").display()
        ));
    }
    verdict(&document)?;
    end
}

/// The library asked for. That there is none is said here, once.
fn load_embree(args: &BenchArgs) -> Result<Option<Embree>, Failure> {
    let named = || std::env::var_os(VARIABLE).filter(|path| !path.is_empty());
    match args.embree.clone().or_else(|| named().map(PathBuf::from)) {
        Some(path) => Embree::load(&path).map(Some).map_err(Failure::Usage),
        None => {
            say(format_args!(
                "Without Embree there are no ratios: run bench/get-embree, then give --embree LIB or set {VARIABLE}."
            ));
            Ok(None)
        }
    }
}

/// Fails if an answer of ours was wrong.
fn verdict(document: &Document) -> Result<(), Failure> {
    let mut wrong = Vec::new();
    for check in document
        .checks
        .iter()
        .filter(|check| check.disagreements > 0)
    {
        let Check {
            scene,
            rays,
            ray_count,
            disagreements,
        } = check;
        wrong.push(format!(
            "{scene}: {disagreements} of {ray_count} {rays} rays against brute force"
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
    if wrong.is_empty() {
        return Ok(());
    }
    Err(Failure::Work(format!(
        "every tree must give the answers of brute force, bit for bit, but these differ:\n  {}",
        wrong.join("\n  ")
    )))
}

/// A pool of its own for everything that is timed on so many threads.
fn pool(threads: NonZeroUsize) -> Result<ThreadPool, Failure> {
    ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build()
        .map_err(|source| Failure::Work(format!("cannot start the threads: {source}")))
}

/// A benchmark under way.
struct Bench<'a> {
    args: &'a BenchArgs,
    isas: Vec<Isa>,
    threads: Vec<NonZeroUsize>,
    embree: Option<Embree>,
    document: Document,
}

/// Rays of one kind with the right answers.
struct List {
    kind: &'static str,
    rays: Vec<Ray>,
    reference: Reference,
}

/// What is traced: one scene, ready.
struct Subject<'s> {
    name: &'s str,
    model: Lowered<'s>,
    timed: Rays,
    sample: Rays,
}

impl<'s> Subject<'s> {
    /// Takes a prepared scene apart: into what can be hit, and the rays of its camera paths.
    fn new(scene: &'s antumbra_scene::Scene, args: &BenchArgs) -> Result<Self, Failure> {
        let world = source::world(scene, Builder::default())?;
        let isa = Isa::best();
        let bvh = world.bvh(antumbra::Width::auto(isa.level()), isa);
        let timed = collect_rays(&world, &bvh, args.rays as usize, args.seed);
        interrupt::check()?;
        // Another seed: what is learned must hold for rays that were not seen.
        let each = args.log_rays.div_ceil(2) as usize;
        let mut sample = collect_rays(&world, &bvh, each, args.seed.wrapping_add(1));
        sample.diffuse.truncate(args.log_rays as usize - each);
        Ok(Self {
            name: &scene.name,
            model: Lowered::new(scene),
            timed,
            sample,
        })
    }
}

impl Bench<'_> {
    fn all(&mut self, scenes: Vec<Loaded>) -> Result<(), Failure> {
        for loaded in scenes {
            say(format_args!("{}: collecting rays", loaded.scene.name));
            let mut scene = loaded.scene;
            model::prepare(&mut scene);
            let subject = Subject::new(&scene, self.args)?;
            let begun = self.document.rows.len();
            self.scene(subject)?;
            report::show(&self.document.rows[begun..], self.args.json.as_ref())?;
        }
        Ok(())
    }

    fn scene(&mut self, subject: Subject) -> Result<(), Failure> {
        let Subject {
            name,
            model,
            timed,
            sample,
        } = &subject;
        say(format_args!("{name}: building"));
        for &isa in &self.isas {
            let built = builds::measure(&builds::Plan {
                scene: name,
                model,
                width: self.args.widths.on(isa)[0],
                isa,
                builders: &self.args.builds.0,
                threads: &self.threads,
                rounds: BUILD_ROUNDS.min(self.args.repeat as usize),
                embree: self.embree,
            })?;
            self.document.builds.extend(built);
        }
        let primitives = model.primitives().map_err(Failure::work)?;
        let rays = training_rays(&primitives, sample, self.args.seed);
        let binary = BinaryTree::build_for(&primitives, self.args.builder, &rays);
        let ingredients = Ingredients {
            primitives: &primitives,
            binary: &binary,
            log: &tree_log(&primitives, &binary, sample),
            builder: self.args.builder,
            sample,
            prefetch: self.args.prefetch.0,
            seed: self.args.seed,
        };
        let mut lists = Vec::new();
        for isa in self.isas.clone() {
            let trees = self.trees(&ingredients, isa)?;
            if lists.is_empty() {
                say(format_args!("{name}: checking the reference"));
                lists = self.lists(name, timed, &trees[0], &primitives, model);
                interrupt::check()?;
            }
            say(format_args!("{name}: measuring on {}", isa.level()));
            self.level(name, model, &lists, &trees, isa)?;
        }
        Ok(())
    }

    /// A tree for every width, collapse and order asked for.
    fn trees(&self, ingredients: &Ingredients, isa: Isa) -> Result<Vec<Tree>, Failure> {
        let mut trees = Vec::new();
        for width in self.args.widths.on(isa) {
            for &collapse in &self.args.collapses.0 {
                for &order in &self.args.orders.0 {
                    let tree = ingredients.tree(width, collapse, order, isa);
                    trees.push(tree.map_err(Failure::work)?);
                    interrupt::check()?;
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
        let brute = Brute::new(primitives.clone());
        let rays = [&rays.primary, &rays.shadow, &rays.diffuse];
        let mut lists = Vec::new();
        for (kind, rays) in KINDS.into_iter().zip(rays) {
            if rays.is_empty() {
                say(format_args!("{name}: its paths have no {kind} rays"));
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
    ) -> Result<(), Failure> {
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
        let rounds = self.args.repeat as usize;
        let known: Vec<_> = lists.iter().map(|list| known(trees, &list.rays)).collect();
        for &threads in &self.threads {
            let pool = pool(threads)?;
            for query in Query::ALL {
                for (list, known) in lists.iter().zip(&known) {
                    let reference = list.reference.answers(query);
                    let outcomes =
                        measure::measure(&engines, query, &list.rays, reference, &pool, rounds)?;
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
    fn rivals<'m>(&self, model: &'m Lowered, isa: Isa) -> Result<Option<[Scene<'m>; 2]>, Failure> {
        let Some((embree, isa)) = self.embree.zip(embree::isa(isa.level())) else {
            return Ok(None);
        };
        let build = |robust| {
            // All threads, whatever the queries will use: with one, a thread of Embree's scheduler spins until
            // the device goes, and takes its share of the core that the queries are timed on.
            let device = Device::new(embree, isa, 0)?;
            Scene::build(&device, model, robust)
        };
        let scenes = build(false).and_then(|default| Ok([default, build(true)?]));
        scenes.map(Some).map_err(Failure::Work)
    }
}

/// What is known of a tree without a clock.
struct Known {
    label: TreeLabel,
    prefetch: bool,
    /// Mean node and primitive tests of an occlusion ray.
    tests: [f64; 2],
}

/// Of every tree.
fn known(trees: &[Tree], rays: &[Ray]) -> Vec<Known> {
    let known = |Tree { bvh, label }: &Tree| Known {
        label: *label,
        prefetch: bvh.prefetches(),
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
