//! `antumbra probe`: what goes beyond a static order.

use antumbra_lab::probe::{self, Options, Row};
use antumbra_lab::{Error, Table, Watcher, number};
use antumbra_load::MemorySize;

use crate::args::ProbeArgs;
use crate::exit::Failure;
use crate::output::Files;
use crate::progress::Progress;
use crate::scenes;

/// Runs the command.
pub fn run(args: &ProbeArgs, memory: MemorySize) -> Result<(), Failure> {
    let isa = args.machine.isa()?;
    let mut files = Files::default();
    if let Some(csv) = &args.csv {
        files.writes("--csv", csv)?;
    }
    files.check()?;
    args.machine.start_threads()?;
    let loaded = scenes::load_all(&args.scenes, &args.picture, memory)?;
    for loaded in &loaded {
        files.reads_all(&loaded.inputs)?;
    }
    let scenes = loaded.into_iter().map(|loaded| loaded.scene);
    let mut scenes: Vec<_> = scenes.collect();
    if let Some(spp) = args.picture.spp {
        scenes
            .iter_mut()
            .for_each(|scene| scene.sampler.pixel_samples = spp);
    }
    let progress = Progress::of_experiment(None);
    let mut all: Vec<Row> = Vec::new();
    for width in args.widths.widths.on(isa) {
        let options = Options {
            parts: args.parts.clone(),
            width,
            isa,
            log_rays: args.log_rays as usize,
            rays: args.rays as usize,
            rounds: args.repeat as usize,
            frames: args.frames as usize,
            seed: args.picture.seed,
        };
        let rows = probe::run(scenes.clone(), &options, &progress, |rows| {
            progress.show(&[table(rows)]).map_err(Error::Show)
        })?;
        all.extend(rows);
        // After every width, so that little is lost.
        if let Some(path) = &args.csv {
            let text = probe::csv(&all)?;
            antumbra_lab::write_file(path, &text)?;
        }
    }
    progress.finish();
    Ok(())
}

/// Rows for people.
fn table(rows: &[Row]) -> Table {
    let cells = |row: &Row| {
        let frame = row
            .frame
            .map_or_else(String::new, |frame| format!(" #{frame}"));
        vec![
            format!(
                "{} {} {} {}{frame}",
                row.rays, row.tree, row.collapse, row.technique
            ),
            number(Some(row.node_tests), 2),
            number(Some(row.prim_tests), 2),
            number(Some(row.cost), 2),
            number(row.independent, 2),
            number(row.exclusive, 2),
            number(row.overlapping, 2),
            number(row.batch_speed, 2),
            number(row.single_speed, 2),
            number(row.learn_ms, 1),
        ]
    };
    Table {
        caption: rows.first().map_or_else(String::new, |row| {
            format!("{}, {}, {} wide", row.scene, row.part, row.width)
        }),
        header: vec![
            "technique",
            "nodes",
            "prims",
            "cost",
            "independent",
            "exclusive",
            "overlapping",
            "batch",
            "single",
            "learn ms",
        ],
        rows: rows.iter().map(cells).collect(),
    }
}
