//! Cases of the harness beside `antumbra bench`: what single calls of the kernel cost, and whole jobs from a mesh in memory to
//! finished numbers, beside programs that use Embree 4.
//!
//!     bench/get-embree
//!     cargo run --release -p antumbra-bench -- --embree bench/embree/LIBRARY sizes conditions --scene sponza.pbrt
//!     ANTUMBRA_SCENES=FOLDER cargo run --release -p antumbra-bench -- --embree bench/embree/LIBRARY jobs --json FILE
//!
//! CPU time of one thread, interleaved turns, medians with least and most. A case is a list of works on the same questions; the
//! first is what the others are relative to, and answers are compared with its own.
//!
//! - `input`: meshes, rays, sensors
//! - `calls/`: calls of few rays, conditions, visits, builds, files, curves, motion
//! - `jobs/`: two programs for one job, ours as a user would write it, Embree's the best that we can write with few lines
//!
//! FOLDER holds the shared scenes `sponza/sponza.pbrt` and `scans/igea_igea.ply`. Jobs on scenes that are not there are skipped.

mod calls;
mod input;
mod jobs;

use std::path::PathBuf;

use antumbra_lab::harness::Bench;
use clap::Parser;

/// An error of whatever kind.
type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Measures cases, and prints a line for each work.
#[derive(Parser)]
struct Args {
    /// Cases by name, or `calls` and `jobs` for all of either
    #[arg(required = true)]
    cases: Vec<String>,
    /// Embree's library, see bench/get-embree
    #[arg(long, value_name = "LIB")]
    embree: Option<PathBuf>,
    /// Scene of the calls: a file or a built-in name
    #[arg(long, value_name = "SCENE", default_value = "builtin:city:200000")]
    scene: Vec<String>,
    /// Rounds in which every work is timed once
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    /// One question in so many, to try a case
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    part: u32,
    /// File of the record, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn main() -> Outcome {
    let args = Args::parse();
    // Builds of one thread, which is this one.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    pool.use_current_thread().build_global()?;
    let mut bench = Bench::new(
        env!("CARGO_MANIFEST_DIR").as_ref(),
        args.embree.as_deref(),
        (args.rounds, args.part as usize),
        |row| println!("{row}"),
    )?;
    let names = || (calls::CASES.iter().map(|(name, _)| *name)).chain(jobs::NAMES);
    for name in &args.cases {
        if !["calls", "jobs"].contains(&&**name) && names().all(|known| known != name) {
            let known: Vec<_> = names().collect();
            return Err(format!("there is no case {name}; there is {}", known.join(", ")).into());
        }
    }
    let wanted = |group: &str, name: &str| args.cases.iter().any(|one| one == group || one == name);
    for (name, run) in calls::CASES {
        if wanted("calls", name) {
            run(&mut bench, &args.scene)?;
        }
    }
    jobs::run(&mut bench, &|name| wanted("jobs", name));
    let ours = bench.rows().iter().filter(|row| row.work == jobs::OURS);
    let logs: Vec<f64> = ours.map(|row| row.speedup[0].ln()).collect();
    if !logs.is_empty() {
        let mean = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
        println!("geometric mean of {} jobs {mean:.2}", logs.len());
    }
    Ok(args.json.map_or(Ok(()), |path| bench.write(&path))?)
}
