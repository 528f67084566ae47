//! Which of many places on a terrain see each other: all pairs of two sets of points, counted.
//!
//! `cargo run --release -p antumbra --example line_of_sight`

use std::time::Instant;

use antumbra::{Bvh, Error, Geometry, Ray, Recipe};

/// Squares of the terrain along a side. Each is a quad.
const SIDE: u32 = 500;
const LOOKOUTS: usize = 40;
const PLACES: usize = 20_000;
/// Pairs that are traced at one go: 2 MiB of rays, so that nothing of all pairs but the counts has to be kept.
const BATCH: usize = 1 << 16;

/// Numbers in [0, 1), the same in every run.
struct Random(u32);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }
}

/// Height of the ground: hills on hills.
fn height(x: f32, y: f32) -> f32 {
    let (mut sum, mut size) = (0.0, 40.0);
    for octave in 0..5 {
        let (a, b) = (x / size, y / size);
        sum += 0.2 * size * (a + 1.3 * octave as f32).sin() * (b - 0.7 * octave as f32).cos();
        size *= 0.45;
    }
    sum
}

/// Positions and quads of the terrain.
fn terrain() -> (Vec<[f32; 3]>, Vec<[u32; 4]>) {
    let corners = SIDE + 1;
    let positions = (0..corners * corners).map(|i| {
        let [x, y] = [i % corners, i / corners].map(|place| place as f32);
        [x, y, height(x, y)]
    });
    let quads = (0..SIDE * SIDE).map(|i| {
        let corner = i / SIDE * corners + i % SIDE;
        [corner, corner + 1, corner + corners + 1, corner + corners]
    });
    (positions.collect(), quads.collect())
}

/// Points at a height above the ground.
fn points(random: &mut Random, count: usize, above: f32) -> Vec<[f32; 3]> {
    (0..count)
        .map(|_| {
            let [x, y] = [(); 2].map(|()| random.unit() * (SIDE - 2) as f32 + 1.0);
            [x, y, height(x, y) + above]
        })
        .collect()
}

fn main() -> Result<(), Error> {
    let (positions, quads) = terrain();
    let mut random = Random(7);
    let lookouts = points(&mut random, LOOKOUTS, 3.0);
    let places = points(&mut random, PLACES, 0.5);

    // ANCHOR: book
    let geometry = [Geometry::quads(&positions[..], &quads[..])];
    let bvh = Bvh::build(&geometry, &Recipe::default())?;

    let mut seen = vec![0u32; lookouts.len()];
    let pairs = lookouts.len() * places.len();
    let ray = |pair: usize| {
        // Neighbouring rays begin at the same lookout.
        Ray::between(lookouts[pair / places.len()], places[pair % places.len()])
    };
    let (mut rays, mut blocked) = (Vec::new(), Vec::new());
    for first in (0..pairs).step_by(BATCH) {
        rays.clear();
        rays.extend((first..pairs.min(first + BATCH)).map(ray));
        blocked.resize(rays.len(), false);
        bvh.batch(&rays).occluded_into(&mut blocked);
        for (pair, blocked) in (first..).zip(&blocked) {
            seen[pair / places.len()] += u32::from(!blocked);
        }
    }
    // ANCHOR_END: book

    let best = (0..seen.len()).max_by_key(|lookout| seen[*lookout]);
    let best = best.expect("there are lookouts");
    let share = |seen: u32| 100.0 * f64::from(seen) / places.len() as f64;
    println!("{} quads, {pairs} pairs", quads.len());
    println!(
        "lookout {best} at {:.1?} sees {:.1} % of all places, the mean is {:.1} %",
        lookouts[best],
        share(seen[best]),
        seen.iter().map(|seen| share(*seen)).sum::<f64>() / seen.len() as f64,
    );

    // Rays from the places to a lookout ask the same: what is seen sees.
    let back: Vec<_> = places
        .iter()
        .map(|place| Ray::between(*place, lookouts[best]))
        .collect();
    let mut blocked = vec![false; back.len()];
    let start = Instant::now();
    bvh.batch(&back).occluded_into(&mut blocked);
    let seconds = start.elapsed().as_secs_f64();
    let again = blocked.iter().filter(|blocked| !**blocked).count() as u32;
    // But for rays that graze the ground, where rounding decides.
    assert!(again.abs_diff(seen[best]) <= 1 + seen[best] / 1000);
    println!("and back: {:.2} Mray/s", back.len() as f64 / seconds / 1e6);
    Ok(())
}
