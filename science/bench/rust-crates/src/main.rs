//! Three small programs, each written with three crates: a baker of ambient occlusion, a matrix of who sees whom, and a world
//! of instances; and nearest points of scenes beside parry3d. Cases of the harness: everything runs on one thread, in turns.
//!
//!     cargo run --release --manifest-path science/bench/rust-crates/Cargo.toml -- [--rounds N] [--part N] [--json FILE] [SCENE...]
//!
//! Without scenes the programs run. Set `RUSTFLAGS="-C target-cpu=native"` for the other crates: antumbra chooses its instruction
//! set by itself.

mod input;
mod with_antumbra;
mod with_bvh;
mod with_obvhs;
mod with_parry;

use std::convert::Infallible;
use std::path::PathBuf;

use antumbra_lab::harness::{
    Answers, Bench, Mesh, Row, TOLERANCE, interleave, median, ratios, spread,
};
use antumbra_lab::thread_seconds;

use input::Ray;

/// What a program found: which rays are occluded; or distances of closest hits, and which of the hits lie in shadow.
#[derive(Clone, Default)]
pub struct Found {
    pub distances: Vec<f32>,
    pub occluded: Vec<bool>,
}

impl Found {
    /// Rays of which some are occluded.
    pub fn of(occluded: Vec<bool>) -> Self {
        Self {
            occluded,
            ..Self::default()
        }
    }

    fn rays(&self) -> usize {
        self.distances.len() + self.occluded.len()
    }

    /// Answers that differ. Where the sets of hits differ, shadows cannot be compared one by one.
    fn differences(&self, other: &Self) -> usize {
        let distances = |found: &Self| Answers::Distances(found.distances.clone());
        let occluded = |found: &Self| Answers::Occluded(found.occluded.clone());
        let far = distances(other).differing_from(&distances(self), TOLERANCE);
        match self.occluded.len() == other.occluded.len() {
            true => far + occluded(other).differing_from(&occluded(self), 0.0),
            false => far,
        }
    }
}

/// CPU seconds of one run.
#[derive(Default)]
pub struct Timed {
    build: f64,
    trace: f64,
}

impl Timed {
    pub fn build<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let start = thread_seconds();
        let result = work();
        self.build = thread_seconds() - start;
        result
    }

    pub fn trace(&mut self, work: impl FnOnce() -> Found) -> Found {
        let start = thread_seconds();
        let result = work();
        self.trace = thread_seconds() - start;
        result
    }
}

const CRATES: [(&str, &str); 3] = [
    ("antumbra", include_str!("with_antumbra.rs")),
    ("obvhs", include_str!("with_obvhs.rs")),
    ("bvh", include_str!("with_bvh.rs")),
];

/// Lines of a program: those of its own and those that all programs of the file share, without comments and empty ones.
fn lines(text: &str, program: &str) -> usize {
    let mut parts = vec![("shared", 0)];
    for line in text.lines().map(str::trim) {
        if let Some(name) = ["baker", "visibility", "instances"]
            .into_iter()
            .find(|name| line == format!("// {name}"))
        {
            parts.push((name, 0));
        } else if !line.is_empty() && !line.starts_with("//") {
            parts.last_mut().expect("there is one").1 += 1;
        }
    }
    parts
        .iter()
        .filter(|(name, _)| ["shared", program].contains(name))
        .map(|(_, lines)| lines)
        .sum()
}

/// Runs a program with every crate, in turns.
fn compare(bench: &mut Bench, program: &'static str, runs: [&dyn Fn(&mut Timed) -> Found; 3]) {
    let mut found = [const { None }; 3];
    let Ok(times) = interleave(bench.rounds, 3, |which| {
        let mut timed = Timed::default();
        found[which] = Some(runs[which](&mut timed));
        Ok::<_, Infallible>(timed)
    });
    let found = found.map(|found| found.expect("a run"));
    let traces = |of: usize| times[of].iter().map(|timed| timed.trace);
    let ours: Vec<f64> = traces(0).collect();
    for (which, (name, text)) in CRATES.into_iter().enumerate() {
        let own: Vec<f64> = traces(which).collect();
        bench.add(Row {
            case: program.to_owned(),
            work: name.to_owned(),
            count: found[which].rays(),
            seconds: spread(own.iter().copied()),
            over: CRATES[0].0.to_owned(),
            speedup: spread(ratios(&own, &ours)),
            differ: found[0].differences(&found[which]),
            build_seconds: Some(median(times[which].iter().map(|timed| timed.build))),
            lines: Some(lines(text, program)),
        });
    }
}

/// A program with every crate, in the order of [`CRATES`].
macro_rules! with_each {
    ($program:ident($($argument:expr),*)) => {[
        &|timed: &mut Timed| with_antumbra::$program($($argument,)* timed),
        &|timed: &mut Timed| with_obvhs::$program($($argument,)* timed),
        &|timed: &mut Timed| with_bvh::$program($($argument,)* timed),
    ]};
}

/// The three programs.
fn programs(bench: &mut Bench) {
    let size = |whole: usize| whole / bench.part;
    let city: Mesh = input::city(size(340) as u32, size(3000));
    let baking: Vec<Ray> = input::baking_rays(&city, 16);
    let points = input::points(size(2000));
    let torus = input::torus(48, 24);
    let places = input::places(size(10_000));
    let camera = input::camera(size(1000));
    compare(bench, "baker", with_each!(bake(&city, &baking)));
    compare(bench, "visibility", with_each!(see(&city, &points)));
    compare(
        bench,
        "instances",
        with_each!(shade(&torus, &places, &camera)),
    );
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Builds of one thread, which is this one.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    pool.use_current_thread().build_global()?;
    let mut args = std::env::args().skip(1);
    let (mut rounds, mut part, mut json, mut scenes) = (3, 1, None, Vec::new());
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or(format!("{arg} takes a value"));
        match arg.as_str() {
            "--rounds" => rounds = value()?.parse()?,
            "--part" => part = value()?.parse()?,
            "--json" => json = Some(PathBuf::from(value()?)),
            _ => scenes.push(arg),
        }
    }
    let folder = env!("CARGO_MANIFEST_DIR").as_ref();
    let mut bench = Bench::new(folder, None, (rounds, part), |row| println!("{row}"))?;
    if scenes.is_empty() {
        programs(&mut bench);
    }
    for scene in &scenes {
        with_parry::run(&mut bench, scene, &Mesh::read(scene)?)?;
    }
    Ok(json.map_or(Ok(()), |path| bench.write(&path))?)
}
