//! Moving meshes and instances beside Embree with the same keys.
//!
//!     bench/get-embree
//!     cargo run --release --manifest-path bench/motion/Cargo.toml -- bench/embree/LIBRARY [TRIANGLES]
//!
//! CPU time of one thread, interleaved, medians. Every row has the speedup over single calls of Embree, and how many answers differ.

mod embree;
mod scenes;

use antumbra::{Bvh, MovingBvh, MovingScene, Ray, Recipe};
use embree::Embree;
use rustix::time::{ClockId, clock_gettime};

/// Rays of a scene: what one thread takes at a time.
const RAYS: usize = 1 << 14;
/// Turns of everything.
const ROUNDS: usize = 15;

fn main() {
    let mut args = std::env::args().skip(1);
    let library = args.next().expect("Embree's library");
    let triangles = args
        .next()
        .map_or(200_000, |text| text.parse().expect("a number"));
    let mut embree = Embree::load(&library);
    let recipe = Recipe::default();
    for share in [0.001, 0.01, 0.1] {
        let (mesh, end) = scenes::city(triangles, share);
        let (scene, bvh) = scenes::moving_mesh(&mesh, &end, &recipe);
        embree.build_mesh(&[&mesh.positions, &end], &mesh.indices);
        run(
            &format!("city, moved by {share} of its size"),
            &scene,
            &bvh,
            &embree,
        );
    }
    for count in [200, 5000] {
        let (mesh, keys) = scenes::balls(count);
        let (scene, bvh) = scenes::moving_instances(&mesh, &keys, &recipe);
        embree.build_instances(&mesh, &keys);
        run(&format!("{count} instances"), &scene, &bvh, &embree);
    }
}

/// Seconds for which this thread has run.
fn seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

fn run(name: &str, scene: &MovingScene<'_>, bvh: &MovingBvh, embree: &Embree) {
    let (rays, times) = scenes::rays(bvh, RAYS);
    let (rays, times) = (&rays[..], &times[..]);
    // The same rays among what does not move, to see what motion costs.
    let still = Bvh::build(&scene.middle(0).expect("sound"), &Recipe::default()).expect("sound");
    let mut expected = vec![false; rays.len()];
    embree.occluded(rays, times, &mut expected);
    let hits = expected.iter().filter(|&&hit| hit).count();
    println!("{name}: {} % occluded", 100 * hits / rays.len());
    type Ask<'a> = Box<dyn Fn(&[Ray], &mut [f32]) + 'a>;
    let shadows = |ask: &dyn Fn(&mut [bool]), found: &mut [f32]| {
        let mut occluded = vec![false; found.len()];
        ask(&mut occluded);
        for (found, occluded) in found.iter_mut().zip(occluded) {
            *found = if occluded { 1.0 } else { f32::INFINITY };
        }
    };
    let rows: Vec<(&str, bool, Ask<'_>)> = vec![
        (
            "rtcOccluded1",
            true,
            Box::new(|rays, found| {
                shadows(&|occluded| embree.occluded(rays, times, occluded), found);
            }),
        ),
        (
            "rtcOccluded16",
            true,
            Box::new(|rays, found| {
                shadows(
                    &|occluded| embree.occluded_packets(rays, times, occluded),
                    found,
                );
            }),
        ),
        (
            "occluded",
            true,
            Box::new(|rays, found| {
                shadows(
                    &|occluded| {
                        for ((ray, time), occluded) in rays.iter().zip(times).zip(occluded) {
                            *occluded = bvh.occluded(ray, *time);
                        }
                    },
                    found,
                );
            }),
        ),
        (
            "occluded_batch",
            true,
            Box::new(|rays, found| {
                shadows(&|occluded| bvh.occluded_batch(rays, times, occluded), found);
            }),
        ),
        (
            "occluded_batch, nothing moves",
            true,
            Box::new(|rays, found| {
                shadows(
                    &|occluded| still.batch(rays).on_this_thread().occluded_into(occluded),
                    found,
                );
            }),
        ),
        (
            "rtcIntersect1",
            false,
            Box::new(|rays, found| embree.intersect(rays, times, found)),
        ),
        (
            "intersect",
            false,
            Box::new(|rays, found| {
                for ((ray, time), found) in rays.iter().zip(times).zip(found) {
                    *found = bvh.intersect(ray, *time).map_or(f32::INFINITY, |hit| hit.t);
                }
            }),
        ),
        (
            "intersect_batch",
            false,
            Box::new(|rays, found| {
                let mut hits = vec![None; rays.len()];
                bvh.intersect_batch(rays, times, &mut hits);
                for (found, hit) in found.iter_mut().zip(hits) {
                    *found = hit.map_or(f32::INFINITY, |hit| hit.t);
                }
            }),
        ),
    ];
    let mut found = vec![vec![0.0; rays.len()]; rows.len()];
    let mut spent = vec![Vec::new(); rows.len()];
    for _ in 0..ROUNDS {
        for ((row, found), spent) in rows.iter().zip(&mut found).zip(&mut spent) {
            let start = seconds();
            (row.2)(rays, found);
            spent.push(seconds() - start);
        }
    }
    let median = |spent: &mut Vec<f64>| {
        spent.sort_by(f64::total_cmp);
        spent[spent.len() / 2]
    };
    // Rays begin that close to surfaces.
    let nearly = 1e-4 * bvh.bounds().reach();
    let medians: Vec<f64> = spent.iter_mut().map(median).collect();
    for (index, (what, is_shadow, _)) in rows.iter().enumerate() {
        let base = if *is_shadow { 0 } else { 5 };
        let differ = (found[index].iter().zip(&found[base])).filter(|(a, b)| match is_shadow {
            true => a != b,
            false => !((*a - *b).abs() <= 1e-3 * b.abs() + nearly) && a != b,
        });
        println!(
            "  {what:<30} {:8.1} ns {:6.2}  {} differ",
            1e9 * medians[index] / rays.len() as f64,
            medians[base] / medians[index],
            differ.count()
        );
    }
}
