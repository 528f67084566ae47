//! The demonstration: `antumbra` without a command.

use std::path::Path;

use antumbra_lab::study::{self, Plan};
use antumbra_load::MemorySize;

use crate::exit::{Failure, tell};
use crate::{args, scenes, version};

const SCENE: &str = "builtin:city";
const DIRECTORY: &str = "antumbra-out";
/// Small enough for a minute on two cores.
const RESOLUTION: [u32; 2] = [512, 288];
const SPP: u32 = 6;
const REPEAT: u32 = 1;
const REPLAY: usize = 30_000;

/// Runs the demonstration.
pub fn run(memory: MemorySize) -> Result<(), Failure> {
    args::start_threads(None)?;
    let mut scene = scenes::load(Path::new(SCENE), memory)?.scene;
    scene.film.resolution = RESOLUTION;
    let [x, y] = RESOLUTION;
    tell(format_args!(
        "The demonstration: {SCENE}, {x} x {y} pixels, {SPP} samples per pixel, every order, once counting and \
         once timed.\nThe picture is always the same; what differs is the work of the shadow rays. For more: antumbra --help\n"
    ));
    let plan = Plan {
        scenes: study::subjects(vec![scene], None)?,
        spp: Some(SPP),
        repeat: REPEAT,
        replay: REPLAY,
        out: Some(DIRECTORY.into()),
        restart: true,
        caller: version::caller(),
        ..Plan::default()
    };
    crate::study::execute(&plan, None)?;
    let width = plan.widths[0];
    tell(format_args!(
        "\nIn {DIRECTORY}/:\n  \
         report.html                  everything, to be opened in a browser\n  \
         report.md, results.json, .csv    the figures\n  \
         city-w{width}.png, .exr           the picture\n  \
         city-w{width}-tests-ORDER.png     where the tests were done, before (simple) and after (sort-plus)"
    ));
    Ok(())
}
