//! Motion blur: a door that opens, and a ball that rolls, seen by rays that each have a time.
//!
//! `cargo run --release -p antumbra --example motion_blur`
//!
//! Prints how much of each place the things cover while the shutter is open.

use antumbra::shapes::Sphere;
use antumbra::{Bvh, Geometry, Instance, Primitives, Ray, Recipe};

fn main() -> Result<(), antumbra::Error> {
    let door = |angle: f32| -> Vec<[f32; 3]> {
        let [x, z] = [angle.cos(), angle.sin()];
        vec![[0.0; 3], [x, 0.0, z], [x, 2.0, z], [0.0, 2.0, 0.0]]
    };
    let (closed, open) = (door(0.0), door(0.8));
    let door_indices = vec![[0, 1, 2], [0, 2, 3]];
    let ball = Geometry::spheres(vec![Sphere {
        center: [0.0; 3],
        radius: 0.3,
    }]);
    let place = |x: f32| {
        [
            [1.0, 0.0, 0.0, x],
            [0.0, 1.0, 0.0, 1.0],
            [0.0, 0.0, 1.0, 0.0],
        ]
    };
    let (at_start, at_end) = (place(-2.0), place(-0.5));

    const COLUMNS: usize = 48;
    const TIMES: usize = 64;
    let column = |ray: usize| (ray / TIMES) as f32 * 3.6 / COLUMNS as f32 - 2.4;
    let rays: Vec<Ray> = (0..COLUMNS * TIMES)
        .map(|ray| Ray::new([column(ray), 1.0, -5.0], [0.0, 0.0, 1.0]))
        .collect();
    let times: Vec<f32> = (0..rays.len())
        .map(|ray| ((ray % TIMES) as f32 + 0.5) / TIMES as f32)
        .collect();

    // ANCHOR: book
    let mesh = Geometry::moving([closed, open], door_indices);
    let rolling = Instance::moving(0, [at_start, at_end]);
    let scene = Primitives::with_instances(&[mesh], &[[ball]], &[rolling])?;
    let bvh = Bvh::build(&scene, &Recipe::default())?;

    let hits = bvh.batch(&rays).at(&times).intersect();
    // ANCHOR_END: book
    let picture = hits.chunks(TIMES).map(|hits| {
        let covered = hits.iter().flatten().count();
        b" .:-=+*#%@"[covered * 9 / TIMES] as char
    });
    println!("{}", picture.collect::<String>());
    Ok(())
}
