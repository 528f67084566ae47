//! What calls of the kernel cost: calls of few rays, builds, curves and motion beside Embree's, batches with conditions, surfaces and occluders
//! beside plain ones, visits in batches beside loops, and queries for nearest points beside parry3d's.
//!
//!     bench/get-embree
//!     cargo run --release --manifest-path science/bench/calls/Cargo.toml -- bench/embree/LIBRARY PART,PART SCENE...
//!     cargo run --release --manifest-path science/bench/calls/Cargo.toml -- bench/embree/LIBRARY curves,motion
//!     cargo run --release --manifest-path science/bench/calls/Cargo.toml -- points SCENE...
//!
//! CPU time of one thread, everything in turns, medians.

mod builds;
mod conditions;
mod curves;
mod embree;
mod input;
mod motion;
mod points;
mod sizes;
mod transmission;
mod turns;

use antumbra::{Bvh, Geometry, Recipe};

/// Turns of everything.
const ROUNDS: usize = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    // Builds of one thread, which is this one.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    pool.use_current_thread().build_global()?;
    let usage = "name `points`, or Embree's library and parts (sizes, conditions, transmission, builds, curves, motion); then scenes";
    let library = args.next().ok_or(usage)?;
    if library == "points" {
        return points(args);
    }
    let parts = args.next().ok_or(usage)?;
    let has = |part: &str| parts.split(',').any(|named| named == part);
    let mut embree = embree::Embree::load(&library);
    if has("curves") {
        curves::run(&mut embree, ROUNDS)?;
    }
    if has("motion") {
        motion::run(&mut embree, ROUNDS)?;
    }
    for scene in args {
        let input = input::read(&scene)?;
        let mesh = &input.mesh;
        embree.build(mesh);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let bvh = Bvh::build(&geometry, &Recipe::default())?;
        for (kind, rays) in [("ao", &input.ao), ("shadow", &input.shadow)] {
            let name = format!("{scene} {kind}");
            if has("sizes") {
                sizes::run(&name, &bvh, &embree, rays, ROUNDS);
            }
            if has("conditions") {
                conditions::run(&name, &bvh, rays, ROUNDS);
            }
            if has("transmission") {
                transmission::run(&name, mesh, rays, ROUNDS)?;
            }
        }
        if has("builds") {
            builds::run(
                &scene,
                &mut embree,
                mesh,
                [&input.ao, &input.shadow],
                ROUNDS,
            );
        }
    }
    Ok(())
}

/// Nearest points.
fn points(scenes: impl Iterator<Item = String>) -> Result<(), Box<dyn std::error::Error>> {
    for scene in scenes {
        let mesh = input::read_mesh(&scene)?;
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let bvh = Bvh::build(&geometry, &Recipe::default())?;
        points::run(&scene, &bvh, &mesh, ROUNDS);
    }
    Ok(())
}
