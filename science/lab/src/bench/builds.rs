//! Building: seconds and bytes, ours against Embree's, taking turns.

use antumbra_trees::engine;
use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

use antumbra::recipe::{BuildTimes, Builder, Collapse};
use antumbra::{Bvh, Isa, Recipe, Width};
use antumbra_render::Lowered;
use antumbra_render::clock;

use super::model::Size;
use super::pool;
use super::record::{BuildRow, StepSeconds};
use crate::Error;
use crate::embree::{Device, Embree, Scene, SceneFlags, isa};
use crate::harness::{interleave, median};
use crate::watch::{self, Watcher};

/// Structures to build, and how.
pub struct Plan<'a> {
    pub scene: &'a str,
    pub model: &'a Lowered<'a>,
    pub width: Width,
    pub isa: Isa,
    pub builders: &'a [Builder],
    pub threads: &'a [NonZeroUsize],
    pub rounds: usize,
    pub embree: Option<Embree>,
}

/// Time and size of one build.
#[derive(Clone)]
struct Built {
    seconds: f64,
    bytes: usize,
    buffer_bytes: usize,
    times: Option<BuildTimes>,
}

/// Median seconds of the steps of our builds; `None` for Embree, which does not report them.
fn step_seconds(built: &[Built]) -> Option<StepSeconds> {
    let times: Option<Vec<BuildTimes>> = built.iter().map(|built| built.times).collect();
    let times = times?;
    let seconds = |step: fn(&BuildTimes) -> Duration| {
        median(times.iter().map(|times| step(times).as_secs_f64()))
    };
    Some(StepSeconds {
        primitives: seconds(|times| times.primitives),
        tree: seconds(|times| times.tree),
        log: seconds(|times| times.log),
        collapse: seconds(|times| times.collapse),
        order: seconds(|times| times.order_log + times.order + times.predict),
    })
}

/// Builds with all these builders and Embree, on every number of threads: once to warm up, then timed.
pub fn measure(plan: &Plan, watcher: &dyn Watcher) -> Result<Vec<BuildRow>, Error> {
    let mut rows = Vec::new();
    let rival = plan.embree.zip(isa(plan.isa.level()));
    for &threads in plan.threads {
        let pool = pool(threads)?;
        let engines = plan.builders.len() + usize::from(rival.is_some());
        let built = interleave(plan.rounds, engines, |which| {
            watch::check(watcher)?;
            if let Some(&builder) = plan.builders.get(which) {
                return pool.install(|| build(plan, builder));
            }
            let (embree, isa) = rival.ok_or_else(|| Error::report("no Embree"))?;
            // Gone before our next turn: with few threads, one of its scheduler spins as long as it lives.
            let device = Device::new(embree, Some(isa), threads.get())?;
            let scene = Scene::build(&device, plan.model, SceneFlags::default())?;
            Ok(Built {
                seconds: scene.seconds,
                bytes: scene.bytes,
                buffer_bytes: scene.buffer_bytes,
                times: None,
            })
        })?;
        let size = Size::of(plan.model);
        let row = |engine, builder, built: &[Built]| {
            let last = built.last()?;
            let seconds = built.iter().map(|built| built.seconds);
            let is_ours = engine == "antumbra";
            Some(BuildRow {
                scene: plan.scene.to_owned(),
                size,
                engine,
                builder,
                collapse: is_ours.then_some(Collapse::default().name()),
                level: plan.isa.level().to_string(),
                width: is_ours.then_some(plan.width.lanes()),
                threads: threads.get(),
                seconds: median(seconds.clone()),
                best_seconds: seconds.fold(f64::INFINITY, f64::min),
                step_seconds: step_seconds(built),
                bytes: last.bytes,
                buffer_bytes: last.buffer_bytes,
            })
        };
        for (which, built) in built.iter().enumerate() {
            rows.extend(match plan.builders.get(which) {
                Some(builder) => row("antumbra", builder.name(), built),
                None => row("embree", "medium", built),
            });
        }
    }
    Ok(rows)
}

/// Builds a tree from slices, by the options that users get who choose none but the builder.
fn build(plan: &Plan, builder: Builder) -> Result<Built, Error> {
    let start = Instant::now();
    let recipe = Recipe::default()
        .builder(builder)
        .engine(engine(plan.isa, plan.width))
        .clock(Some(clock));
    let primitives = plan.model.primitives()?;
    let checked = start.elapsed();
    let bvh = Bvh::build(&primitives, &recipe).expect("a tree");
    let seconds = start.elapsed().as_secs_f64();
    let report = bvh.report();
    Ok(Built {
        seconds,
        bytes: report.bytes,
        buffer_bytes: 0,
        times: report.times.map(|mut times| {
            times.primitives = checked;
            times
        }),
    })
}
