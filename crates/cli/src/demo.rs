//! The demonstration: what `antumbra` does when it is not told anything.

use std::path::Path;

use antumbra::{Builder, Collapse, Isa, Order, Width};
use antumbra_render::RaysFrom;

use crate::args::LogSize;
use crate::exit::{Failure, say};
use crate::{args, source, study};

const SCENE: &str = "builtin:city";
const DIRECTORY: &str = "antumbra-out";
/// Small enough for a minute on two cores.
const RESOLUTION: [u32; 2] = [512, 288];
const SPP: u32 = 6;
const REPEAT: u32 = 1;
const REPLAY: usize = 30_000;

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
         once timed.\nThe picture is always the same; what differs is the work of the shadow rays. For more: antumbra --help\n"
    ));
    study::execute(&study::Plan {
        scenes: study::subjects(vec![loaded], None)?,
        orders: Order::ALL.to_vec(),
        widths: vec![width],
        trees: vec![Builder::default()],
        collapses: vec![Collapse::default()],
        spp: Some(SPP),
        repeat: REPEAT,
        seed: 0,
        isa,
        replay: REPLAY,
        log_size: LogSize::Share(0.01),
        rays_from: RaysFrom::default(),
        out: Some(DIRECTORY.into()),
        restart: true,
        json: None,
    })?;
    say(format_args!(
        "\nIn {DIRECTORY}/:\n  \
         report.html                  everything, to be opened in a browser\n  \
         report.md, results.json, .csv    the figures\n  \
         city-w{width}.png, .exr           the picture\n  \
         city-w{width}-tests-ORDER.png     where the tests were done, before (simple) and after (sort-plus)"
    ));
    Ok(())
}
