//! `antumbra bench`: rays per second, ours and Embree's.

use std::io::{self, IsTerminal};
use std::path::PathBuf;

use antumbra_lab::bench::{self, Embree, Options};
use antumbra_lab::make_directory;
use antumbra_load::MemorySize;

use crate::args::{self, BenchArgs};
use crate::exit::{Failure, tell};
use crate::json::{self, Destination};
use crate::output::Files;
use crate::progress::Progress;
use crate::progress::line::wrapped;
use crate::table::draw_all;
use crate::{scenes, version};

/// Names the library if `--embree` does not.
const VARIABLE: &str = "ANTUMBRA_EMBREE";

/// Runs the command.
pub fn run(args: &BenchArgs, memory: MemorySize) -> Result<(), Failure> {
    let isas = args.levels.isas()?;
    let mut files = Files::default();
    if let Some(json) = &args.json {
        files.writes("--json", json.path())?;
    }
    files.check()?;
    let embree = load_embree(args)?;
    args::start_threads(None)?;
    let loaded = scenes::load_each(&args.scenes, memory)?;
    for loaded in &loaded {
        files.reads_all(&loaded.inputs)?;
    }
    if let Some(directory) = &args.out {
        let ours = |name: &str| ["bench.json", "bench.md", "bench.svg"].contains(&name);
        files.writes_into("--out", directory, ours)?;
    }
    let scenes = loaded.into_iter().map(|loaded| loaded.scene).collect();
    if let Some(directory) = &args.out {
        make_directory(directory)?;
    }
    let recipe = args.preset.preset.recipe();
    let options = Options {
        embree,
        rays: args.rays as usize,
        log_rays: args.log_rays as usize,
        orders: (args.orders.as_ref()).map_or(vec![recipe.order], |orders| orders.0.clone()),
        collapses: args.collapses.or(&recipe),
        widths: args.widths.widths.choices(),
        builder: args.builder.builder.unwrap_or(recipe.builder),
        builds: args.builds.0.clone(),
        kinds: args.kinds,
        prefetch: args.prefetch.prefetch.0,
        isas,
        threads: args.threads.0.clone(),
        repeat: args.repeat as usize,
        seed: args.seed,
        caller: version::caller(),
    };
    let json = args.json.as_ref();
    let results = bench::run(scenes, &options, &Progress::of_experiment(json))?;
    let narrow = json != Some(&Destination::Stdout) && io::stdout().is_terminal();
    let legend = results.legend().to_string();
    let legend = if narrow { wrapped(&legend) } else { legend };
    let text = draw_all(&results.tables(), narrow) + &legend;
    json::print_beside(json, &text)?;
    json::write(results.document(), json)?;
    if let Some(directory) = &args.out {
        results.write(directory)?;
        let report = directory.join("bench.md");
        tell(format_args!("wrote {}", report.display()));
    }
    Ok(results.end()?)
}

/// The library that the command line names. A missing one is reported once.
fn load_embree(args: &BenchArgs) -> Result<Option<Embree>, Failure> {
    let named = || std::env::var_os(VARIABLE).filter(|path| !path.is_empty());
    match args.embree.clone().or_else(|| named().map(PathBuf::from)) {
        Some(path) => Ok(Some(Embree::load(&path)?)),
        None => {
            tell(format_args!(
                "Without Embree there are no ratios: run bench/get-embree, then give --embree LIB or set {VARIABLE}."
            ));
            Ok(None)
        }
    }
}
