//! The demonstration: what `antumbra` does when it is not told anything.

use std::path::Path;

use antumbra::{Collapse, Isa, Order, Width};

use crate::exit::{Failure, say};
use crate::{args, source, study};

const SCENE: &str = "builtin:city";
const DIRECTORY: &str = "antumbra-out";
/// Small enough for a minute on two cores.
const RESOLUTION: [u32; 2] = [512, 288];
const SPP: u32 = 6;
const REPEAT: u32 = 2;

/// Runs the demonstration.
pub fn run() -> Result<(), Failure> {
    let isa = Isa::best();
    args::start_threads(None)?;
    let mut loaded = source::load(Path::new(SCENE))?;
    loaded.scene.film.resolution = RESOLUTION;
    let width = Width::auto(isa.level());
    let [x, y] = RESOLUTION;
    say(format_args!(
        "The demonstration: {SCENE}, {x} x {y} pixels, {SPP} samples per pixel, every order, once counting and \
         {REPEAT} times timed.\nThe picture is always the same; what differs is the work of the shadow rays. For more: antumbra --help\n"
    ));
    study::execute(&study::Plan {
        scenes: vec![loaded],
        orders: Order::ALL.to_vec(),
        widths: vec![width],
        collapse: Collapse::default(),
        spp: Some(SPP),
        repeat: REPEAT,
        seed: 0,
        isa,
        out: Some(DIRECTORY.into()),
        json: None,
    })?;
    say(format_args!(
        "\nIn {DIRECTORY}/:\n  \
         report.md, study.json        the table\n  \
         city-w{width}.png, .exr           the picture\n  \
         city-w{width}-tests-ORDER.png     where the tests were done, before (simple) and after (sort-plus)"
    ));
    Ok(())
}
