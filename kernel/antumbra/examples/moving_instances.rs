//! Ten thousand instances, some of which move in every frame: what a new top level costs, and what it answers.
//!
//! `cargo run --release -p antumbra --example moving_instances`

use std::sync::Arc;
use std::time::Instant;

use antumbra::{Bvh, Error, Geometry, Instance, Object, Primitives, Ray, Recipe, World};

const INSTANCES: usize = 10_000;
const RAYS: usize = 200_000;
const FRAMES: usize = 10;

/// Positions and triangles of a torus around the z axis.
fn torus(around: u32, along: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let angle = |part: u32, whole: u32| part as f32 / whole as f32 * std::f32::consts::TAU;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..around {
        for j in 0..along {
            let (a, b) = (angle(i, around), angle(j, along));
            let radius = 1.0 + 0.4 * b.cos();
            positions.push([radius * a.cos(), radius * a.sin(), 0.4 * b.sin()]);
            let at = |i: u32, j: u32| i % around * along + j % along;
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    (positions, triangles)
}

/// Numbers in [0, 1), the same in every run.
struct Random(u32);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }

    fn point(&mut self, size: f32) -> [f32; 3] {
        [(); 3].map(|()| (self.unit() - 0.5) * size)
    }

    /// Somewhere in the box, turned about z.
    fn instance(&mut self) -> Instance {
        let [x, y, z] = self.point(120.0);
        let (s, c) = (self.unit() * 6.0).sin_cos();
        Instance::new(0, [[c, -s, 0.0, x], [s, c, 0.0, y], [0.0, 0.0, 1.0, z]])
    }
}

fn main() -> Result<(), Error> {
    let (positions, triangles) = torus(48, 24);
    let geometry = [Geometry::triangles(positions, triangles)];
    // ANCHOR: book
    let torus = Arc::new(Object::build(&geometry, &Recipe::default())?);

    let mut random = Random(1);
    let mut instances: Vec<_> = (0..INSTANCES).map(|_| random.instance()).collect();
    let mut world = World::new(&[Arc::clone(&torus)], &instances)?;

    instances[0].transform[0][3] += 0.5;
    instances.swap_remove(1);
    instances.push(random.instance());
    world.set_instances(&instances)?;
    // ANCHOR_END: book

    let rays: Vec<_> = (0..RAYS)
        .map(|_| Ray::between(random.point(120.0), random.point(120.0)))
        .collect();
    let mut occluded = vec![false; rays.len()];

    println!(
        "{:>8} {:>10} {:>8} {:>8}",
        "moved", "update ms", "Mray/s", "blocked"
    );
    for moved in [0, 100, 1000, 10_000] {
        // The best of some frames: other programs run as well.
        let (mut update, mut query) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..FRAMES {
            for instance in &mut instances[..moved] {
                *instance = random.instance();
            }
            let start = Instant::now();
            world.set_instances(&instances)?;
            update = update.min(start.elapsed().as_secs_f64());
            let start = Instant::now();
            world.batch(&rays).occluded_into(&mut occluded);
            query = query.min(start.elapsed().as_secs_f64());
        }
        let blocked = occluded.iter().filter(|occluded| **occluded).count();
        println!(
            "{moved:8} {:10.2} {:8.2} {:7.1}%",
            update * 1e3,
            rays.len() as f64 / query / 1e6,
            100.0 * blocked as f64 / rays.len() as f64,
        );
    }

    // The same scene built at once gives the same answers.
    let start = Instant::now();
    let scene = Primitives::with_instances(&[], &[&geometry], &instances)?;
    let whole = Bvh::build(&scene, &Recipe::default())?;
    let build = start.elapsed().as_secs_f64() * 1e3;
    let mut again = vec![false; rays.len()];
    let mut query = f64::INFINITY;
    for _ in 0..FRAMES {
        let start = Instant::now();
        whole.batch(&rays).occluded_into(&mut again);
        query = query.min(start.elapsed().as_secs_f64());
    }
    let rate = rays.len() as f64 / query / 1e6;
    assert_eq!(occluded, again, "answers never depend on the tree");
    println!("built at once and learned: {build:.0} ms, {rate:.2} Mray/s");
    Ok(())
}
