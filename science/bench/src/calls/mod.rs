//! What calls of the kernel cost, beside Embree's where it has the same.

mod batches;
mod builds;
mod curves;
mod motion;
mod saved;
mod transmission;

use antumbra::Ray;
use antumbra_lab::harness::{Bench, Mesh};

use crate::Outcome;
use crate::input::Input;

/// Measures a case, of these scenes if it is about scenes.
type Run = fn(&mut Bench, &[String]) -> Outcome;

/// The cases by name.
pub const CASES: [(&str, Run); 7] = [
    ("sizes", |bench, scenes| {
        of_rays(bench, scenes, batches::sizes)
    }),
    ("conditions", |bench, scenes| {
        of_rays(bench, scenes, batches::conditions)
    }),
    ("transmission", |bench, scenes| {
        of_rays(bench, scenes, transmission::run)
    }),
    ("builds", |bench, scenes| {
        for scene in scenes {
            builds::run(bench, scene, &Input::read(scene, bench.rays())?)?;
        }
        Ok(())
    }),
    ("curves", |bench, _| curves::run(bench)),
    ("motion", |bench, _| motion::run(bench)),
    ("saved", |bench, _| saved::run(bench)),
];

/// Measures a case on the rays of scenes.
fn of_rays(
    bench: &mut Bench,
    scenes: &[String],
    run: fn(&mut Bench, &str, &Mesh, &[Ray]) -> Outcome,
) -> Outcome {
    for scene in scenes {
        let input = Input::read(scene, bench.rays())?;
        for (kind, rays) in &input.rays {
            run(bench, &format!("{scene} {kind}"), &input.mesh, rays)?;
        }
    }
    Ok(())
}
