//! `antumbra study`: scenes by several orders, widths, builders and collapses.

use std::io::{self, IsTerminal};

use antumbra::recipe::{Order, Preset};
use antumbra::{Isa, Width};
use antumbra_lab::RaysFrom;
use antumbra_lab::study::{self, Plan, Results, Subject, Viewpoint};
use antumbra_load::{IntegratorKind, MemorySize};
use antumbra_scene::{Integrator, SamplerKind, Scene};
use antumbra_trees::{FTOB, ORDERS, PBRT};

use crate::args::{CameraChoice, StudyArgs};
use crate::exit::{Failure, tell};
use crate::json::{self, Destination};
use crate::output::Files;
use crate::progress::Progress;
use crate::progress::line::wrapped;
use crate::table::draw_all;
use crate::{interrupt, scenes, version};

/// Rays that are replayed by a study of more than orders that does not say how many.
const REPLAY: u32 = 100_000;

/// One part in so many of the memory is for the trees of one picture. Scene and picture are beside them.
const SHARE_OF_TREES: u64 = 8;

/// Runs the command.
pub fn run(args: &StudyArgs, memory: MemorySize) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    let mut files = Files::default();
    if let Some(json) = &args.json {
        files.writes("--json", json.path())?;
    }
    files.check()?;
    args.machine.start_threads()?;
    let mut viewpoint = |choice: &Option<CameraChoice>| {
        let choice = choice.as_ref();
        choice
            .map(|choice| self::viewpoint(choice, memory, &mut files))
            .transpose()
    };
    let (test, train) = (
        viewpoint(&args.test_camera)?,
        viewpoint(&args.train_camera)?,
    );
    let loaded = scenes::load_all(&args.scenes, &args.picture, memory)?;
    for loaded in &loaded {
        files.reads_all(&loaded.inputs)?;
    }
    let mut scenes: Vec<_> = loaded.into_iter().map(|loaded| loaded.scene).collect();
    if args.preset.preset == Preset::Paper {
        scenes.iter_mut().for_each(settings_of_the_paper);
    }
    if let Some(test) = &test {
        for scene in &mut scenes {
            scene.camera = test.camera(scene)?;
        }
    }
    let subjects = study::subjects(scenes, train.as_ref())?;
    let plan = plan(args, isa, memory, subjects);
    if let Some(directory) = &plan.out {
        files.writes_into("--out", directory, |name| is_written(&plan, name))?;
    }
    execute(&plan, args.json.as_ref())
}

/// The study that the command line describes.
fn plan(args: &StudyArgs, isa: Isa, memory: MemorySize, scenes: Vec<Subject>) -> Plan {
    let defaults = Plan::default();
    let recipe = args.preset.preset.recipe();
    let as_in_paper = args.preset.preset == Preset::Paper;
    let more_than_orders = args.trees.is_some()
        || args.collapses.or(&recipe).len() > 1
        || args.train_camera.is_some()
        || args.rays_from.is_some()
        || args.log_size.is_some();
    let replay = match args.replay {
        Some(rays) => rays,
        None if more_than_orders => REPLAY,
        None => 0,
    };
    Plan {
        scenes,
        orders: match &args.orders {
            Some(orders) => orders.0.clone(),
            None if as_in_paper => ORDERS_OF_THE_PAPER.to_vec(),
            None => ORDERS.to_vec(),
        },
        widths: match &args.widths.widths {
            widths if as_in_paper && widths.is_auto() => vec![Width::W4, Width::W8],
            widths => widths.on(isa),
        },
        costs: (recipe.costs)
            .prim(args.prim_cost.unwrap_or(recipe.costs.prim))
            .cutout(args.cutout_cost.unwrap_or(recipe.costs.cutout))
            .entry(args.entry_cost.unwrap_or(recipe.costs.entry)),
        more_prim_costs: match args.prim_cost {
            None if as_in_paper => vec![PRIM_COST_OF_OTHERS],
            _ => Vec::new(),
        },
        trees: match &args.trees {
            Some(trees) => trees.0.clone(),
            None if as_in_paper => vec![PBRT],
            None => vec![recipe.builder],
        },
        collapses: args.collapses.or(&recipe),
        spp: args.picture.spp.or(as_in_paper.then_some(1)),
        repeat: args.repeat.unwrap_or(if as_in_paper { 3 } else { 0 }),
        seed: args.picture.seed,
        isa,
        replay: replay as usize,
        log_size: args.log_size.unwrap_or(defaults.log_size),
        rays_from: args.rays_from.unwrap_or(RaysFrom::of(&recipe)),
        memory: memory.bytes() / SHARE_OF_TREES,
        out: args.out.clone(),
        restart: args.restart,
        caller: version::caller(),
    }
}

/// The paper does not give the cost of a primitive test. Beside our own, orders are learned by the textbook's: a node's.
const PRIM_COST_OF_OTHERS: f32 = 1.0;

/// Orders of the paper's Tables 2 and 3.
const ORDERS_OF_THE_PAPER: [Order; 6] = [
    Order::Simple,
    FTOB,
    Order::Sato,
    Order::SortMinus,
    Order::Sort,
    Order::SortPlus,
];

/// Gives a scene the integrator and the sampler that the paper used.
fn settings_of_the_paper(scene: &mut Scene) {
    scene.sampler.kind = SamplerKind::Random;
    antumbra_load::choose_integrator(scene, IntegratorKind::Path);
    if let Integrator::Path { max_depth, .. } = &mut scene.integrator {
        *max_depth = if scene.name == "sanmiguel" { 2 } else { 5 };
    }
}

/// Whether a study writes a file of this name to its directory.
fn is_written(plan: &Plan, name: &str) -> bool {
    const REPORTS: [&str; 5] = [
        "report.html",
        "report.md",
        "results.json",
        "results.csv",
        "journal.jsonl",
    ];
    let is_picture = |stem: &str| {
        let rest = name
            .strip_prefix(stem)
            .and_then(|rest| rest.strip_prefix("-w"));
        rest.is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
    };
    REPORTS.contains(&name) || plan.scenes.iter().any(|subject| is_picture(&subject.stem))
}

/// A camera of the command line.
fn viewpoint(
    choice: &CameraChoice,
    memory: MemorySize,
    files: &mut Files,
) -> Result<Viewpoint, Failure> {
    match choice {
        CameraChoice::LookAt(numbers) => Ok(Viewpoint::look_at(*numbers)?),
        CameraChoice::OfScene(path) => {
            let loaded = scenes::load(path, memory)?;
            files.reads_all(&loaded.inputs)?;
            Ok(Viewpoint::Whole(Box::new(loaded.scene.camera)))
        }
    }
}

/// Does what the plan says and reports it, also if it is interrupted. Fails if two images or answers of a scene
/// differ.
pub fn execute(plan: &Plan, json: Option<&Destination>) -> Result<(), Failure> {
    let journal = plan.out.as_ref().map(|folder| folder.join(study::JOURNAL));
    let progress = Progress::of_experiment(json).with_journal(journal);
    let results = study::run(plan, &progress)?;
    let _writing = interrupt::writing();
    progress.finish();
    let narrow = json != Some(&Destination::Stdout) && io::stdout().is_terminal();
    json::print_beside(json, &text(&results, narrow))?;
    json::write(&results.document(), json)?;
    if let Some(report) = results.write()? {
        tell(format_args!("wrote {}", report.display()));
    }
    results.verdict()?;
    match results.journal() {
        _ if results.is_complete() => Ok(()),
        Some(journal) => Err(Failure::Continuable(journal)),
        None => Err(Failure::Interrupted),
    }
}

fn text(results: &Results, narrow: bool) -> String {
    let legend = results.legend().to_string();
    let legend = if narrow { wrapped(&legend) } else { legend };
    format!(
        "{}\n\n{}{}",
        results.machine().describe(),
        draw_all(&results.tables(), narrow),
        legend
    )
}
