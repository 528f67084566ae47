//! What calls of the kernel cost: calls of few rays beside Embree's, and batches with conditions, surfaces and occluders
//! beside plain ones.
//!
//!     bench/get-embree
//!     cargo run --release --manifest-path bench/calls/Cargo.toml -- bench/embree/LIBRARY SCENE...
//!
//! CPU time of one thread, everything in turns, medians.

mod conditions;
mod embree;
mod input;
mod sizes;
mod turns;

use antumbra::{Bvh, Geometry, Recipe};

/// Turns of everything.
const ROUNDS: usize = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let library = args.next().ok_or("name Embree's library, and scenes")?;
    let mut embree = embree::Embree::load(&library);
    for scene in args {
        let input = input::read(&scene)?;
        let mesh = &input.mesh;
        embree.build(mesh);
        let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
        let bvh = Bvh::build(&geometry, &Recipe::default())?;
        for (kind, rays) in [("ao", &input.ao), ("shadow", &input.shadow)] {
            let name = format!("{scene} {kind}");
            sizes::run(&name, &bvh, &embree, rays, ROUNDS);
            conditions::run(&name, &bvh, rays, ROUNDS);
        }
    }
    Ok(())
}
