//! Three small programs, each written with three crates: a baker of ambient occlusion, a matrix of who sees whom, and a world
//! of instances. Prints how long they take, how they differ and how long their texts are.
//!
//!     cargo run --release --manifest-path science/bench/rust-crates/Cargo.toml -- [--rounds N] [--small] [--json FILE]
//!
//! Everything runs on one thread, the crates in turns. Set `RAYON_NUM_THREADS=1` for builds on one thread as well, and
//! `RUSTFLAGS="-C target-cpu=native"` for the other crates: antumbra chooses its instruction set by itself.

mod input;
mod with_antumbra;
mod with_bvh;
mod with_obvhs;

use std::time::Instant;

use serde::Serialize;

use input::{Mesh, Ray};

/// What a program found.
#[derive(PartialEq)]
pub enum Answers {
    /// Which rays are occluded.
    Bits(Vec<bool>),
    /// Distances of closest hits, and which of the hits lie in shadow.
    Shaded {
        distances: Vec<f32>,
        occluded: Vec<bool>,
    },
}

impl Answers {
    fn rays(&self) -> usize {
        match self {
            Self::Bits(bits) => bits.len(),
            Self::Shaded {
                distances,
                occluded,
            } => distances.len() + occluded.len(),
        }
    }

    fn occluded(&self) -> usize {
        match self {
            Self::Bits(bits) | Self::Shaded { occluded: bits, .. } => {
                bits.iter().filter(|bit| **bit).count()
            }
        }
    }

    /// Answers that differ: bits, and distances by more than 1e-4 of themselves.
    fn differences(&self, other: &Self) -> usize {
        let count = |a: &[bool], b: &[bool]| {
            a.iter().zip(b).filter(|(a, b)| a != b).count() + a.len().abs_diff(b.len())
        };
        match (self, other) {
            (Self::Bits(a), Self::Bits(b)) => count(a, b),
            (
                Self::Shaded {
                    distances: a,
                    occluded: own,
                },
                Self::Shaded {
                    distances: b,
                    occluded: others,
                },
            ) => {
                let far = a.iter().zip(b).filter(|(a, b)| {
                    a != b
                        && (**a - **b).abs().partial_cmp(&(1e-4 * **a))
                            != Some(std::cmp::Ordering::Less)
                });
                // Where the sets of hits differ, shadows cannot be compared one by one.
                far.count()
                    + if own.len() == others.len() {
                        count(own, others)
                    } else {
                        0
                    }
            }
            _ => usize::MAX,
        }
    }
}

/// Seconds of one run.
#[derive(Default)]
pub struct Timed {
    build: f64,
    trace: f64,
}

impl Timed {
    pub fn build<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.build = start.elapsed().as_secs_f64();
        result
    }

    pub fn trace(&mut self, work: impl FnOnce() -> Answers) -> Answers {
        let start = Instant::now();
        let result = work();
        self.trace = start.elapsed().as_secs_f64();
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

/// A row of the table.
#[derive(Serialize)]
struct Row {
    program: &'static str,
    name: &'static str,
    lines: usize,
    build_seconds: f64,
    rays: usize,
    occluded: usize,
    mrays_per_second: f64,
    /// Rate of antumbra over that of this crate: the median of the rounds and the extremes.
    antumbra_faster: [f64; 3],
    differences: usize,
}

fn median(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    [
        values[values.len() / 2],
        values[0],
        values[values.len() - 1],
    ]
}

/// Runs a program with every crate, in turns.
fn compare(
    program: &'static str,
    rounds: usize,
    runs: [&dyn Fn(&mut Timed) -> Answers; 3],
) -> Vec<Row> {
    let mut times: [Vec<Timed>; 3] = Default::default();
    let mut answers: Vec<Answers> = Vec::new();
    for round in 0..rounds {
        for (index, run) in runs.iter().enumerate() {
            let mut timed = Timed::default();
            let found = run(&mut timed);
            times[index].push(timed);
            if round == 0 {
                answers.push(found);
            }
        }
    }
    (0..3)
        .map(|index| {
            let (name, text) = CRATES[index];
            let trace = median(times[index].iter().map(|timed| timed.trace).collect())[0];
            let ratios = times[index]
                .iter()
                .zip(&times[0])
                .map(|(own, ours)| own.trace / ours.trace);
            Row {
                program,
                name,
                lines: lines(text, program),
                build_seconds: median(times[index].iter().map(|timed| timed.build).collect())[0],
                rays: answers[index].rays(),
                occluded: answers[index].occluded(),
                mrays_per_second: answers[index].rays() as f64 / trace / 1e6,
                antumbra_faster: median(ratios.collect()),
                differences: answers[0].differences(&answers[index]),
            }
        })
        .collect()
}

fn main() {
    let mut args = std::env::args().skip(1);
    let (mut rounds, mut small, mut json) = (3, false, None);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--rounds" => {
                rounds = args
                    .next()
                    .and_then(|n| n.parse().ok())
                    .filter(|n| *n > 0)
                    .expect("--rounds takes a number")
            }
            "--small" => small = true,
            "--json" => json = Some(args.next().expect("--json takes a file")),
            _ => panic!("unknown argument {arg}; known are --rounds N, --small, --json FILE"),
        }
    }
    let size = |whole: usize| if small { whole / 10 } else { whole };
    let city: Mesh = input::city(size(340) as u32, size(3000));
    let baking: Vec<Ray> = input::baking_rays(&city, 16);
    let points = input::points(size(2000));
    let torus = input::torus(48, 24);
    let places = input::places(size(10_000));
    let camera = input::camera(size(1000));
    println!(
        "{} triangles, {} instances of {} triangles",
        city.triangles.len(),
        places.len(),
        torus.triangles.len()
    );

    let mut rows = compare(
        "baker",
        rounds,
        [
            &|timed| with_antumbra::bake(&city, &baking, timed),
            &|timed| with_obvhs::bake(&city, &baking, timed),
            &|timed| with_bvh::bake(&city, &baking, timed),
        ],
    );
    rows.extend(compare(
        "visibility",
        rounds,
        [
            &|timed| with_antumbra::see(&city, &points, timed),
            &|timed| with_obvhs::see(&city, &points, timed),
            &|timed| with_bvh::see(&city, &points, timed),
        ],
    ));
    rows.extend(compare(
        "instances",
        rounds,
        [
            &|timed| with_antumbra::shade(&torus, &places, &camera, timed),
            &|timed| with_obvhs::shade(&torus, &places, &camera, timed),
            &|timed| with_bvh::shade(&torus, &places, &camera, timed),
        ],
    ));

    println!(
        "{:<11} {:<9} {:>5} {:>8} {:>9} {:>8} {:>7} {:>22} {:>11}",
        "program",
        "crate",
        "lines",
        "build s",
        "rays",
        "occluded",
        "Mray/s",
        "antumbra is faster by",
        "differences"
    );
    for row in &rows {
        let [middle, least, most] = row.antumbra_faster;
        println!(
            "{:<11} {:<9} {:>5} {:>8.3} {:>9} {:>7.1}% {:>7.2} {:>22} {:>11}",
            row.program,
            row.name,
            row.lines,
            row.build_seconds,
            row.rays,
            100.0 * row.occluded as f64 / row.rays as f64,
            row.mrays_per_second,
            format!("{middle:.2} ({least:.2} to {most:.2})"),
            row.differences,
        );
    }
    if let Some(path) = json {
        let text = serde_json::to_string_pretty(&rows).expect("numbers and names");
        std::fs::write(&path, text + "\n")
            .unwrap_or_else(|error| panic!("cannot write {path}: {error}"));
    }
}
