//! Batches of every length, with rays that can hit nothing among them, give the answers of single queries, on
//! one thread and on several.

use antumbra::recipe::{Engine, Order};
use antumbra::{Bvh, Hit, Ray, Recipe, Width};
use antumbra_testkit::{Rng, mesh, rays};

use crate::support::{engines_for, geometry, kernel_rays};

/// Lengths around the number of rays in flight, and longer than what one thread takes at a time.
const LENGTHS: [usize; 19] = [
    0, 1, 2, 7, 8, 9, 15, 16, 17, 31, 32, 33, 48, 63, 64, 65, 127, 500, 40_000,
];

fn tree(engine: Engine) -> (Bvh, Vec<Ray>) {
    let mut rng = Rng::new(2016);
    let mesh = mesh::bumpy_grid(&mut rng, 600);
    // Bundles first, then rays that go alone, then both in turns.
    let mut rays = rays::bundles(&mut rng, &mesh, 10_000);
    rays.extend(rays::around(&mut rng, &mesh, 10_000));
    while rays.len() < 40_000 {
        let count = 1 + rng.below(200);
        rays.extend(rays::bundles(&mut rng, &mesh, count));
        rays.extend(rays::around(&mut rng, &mesh, count));
    }
    let mut rays = kernel_rays(&rays);
    // Rays that never enter the tree, one alone and many in a row.
    for index in (5..rays.len()).step_by(11).chain(70..110) {
        rays[index].dir = [0.0, f32::NAN, 0.0];
    }
    let options = Recipe::default().engine(engine);
    let bvh = Bvh::build(&[geometry(&mesh)], &options).expect("a mesh");
    (bvh, rays)
}

#[test]
fn batches_of_every_length_equal_single_queries() {
    let as_built = Recipe::default().order(Order::Simple);
    for width in Width::ALL {
        let (mut bvh, rays) = tree(Engine::best(width));
        let occluded: Vec<bool> = rays.iter().map(|ray| bvh.occluded(ray)).collect();
        let hits: Vec<Option<Hit>> = rays.iter().map(|ray| bvh.intersect(ray)).collect();
        assert!(occluded.contains(&true) && occluded.contains(&false));
        for engine in engines_for(width) {
            engine.run(&mut bvh).expect("its width");
            for (turn, length) in LENGTHS.into_iter().enumerate() {
                let prefetch = as_built.prefetch(Some(turn % 2 == 0));
                bvh.relearn(&[], &prefetch);
                let place = format!("{engine:?} {length} rays");
                let rays = &rays[..length];
                // Answers of another batch must not shine through.
                let mut found = vec![true; length];
                let mut found_hits = vec![
                    Some(Hit {
                        t: -1.0,
                        ..hits.iter().flatten().next().copied().expect("a hit")
                    });
                    length
                ];
                bvh.batch(rays).occluded_into(&mut found);
                assert_eq!(found, occluded[..length], "{place}");
                bvh.batch(rays).intersect_into(&mut found_hits);
                assert_eq!(found_hits, hits[..length], "{place}");
                found.fill(true);
                found_hits.fill(None);
                bvh.batch(rays).on_this_thread().occluded_into(&mut found);
                assert_eq!(found, occluded[..length], "{place}, tracer");
                bvh.batch(rays)
                    .on_this_thread()
                    .intersect_into(&mut found_hits);
                assert_eq!(found_hits, hits[..length], "{place}, tracer");

                let mut bits = vec![u64::MAX; length.div_ceil(64)];
                bvh.batch(rays).occluded_bits_into(&mut bits);
                for index in 0..64 * bits.len() {
                    let wanted = occluded[..length].get(index).copied().unwrap_or(false);
                    assert_eq!(bits[index / 64] >> (index % 64) & 1 == 1, wanted, "{place}");
                }
            }
        }
    }
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly has no threads")]
fn the_number_of_threads_changes_no_answer() {
    let (bvh, rays) = tree(Engine::best(Width::W8));
    let mut answers = Vec::new();
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        answers.push(pool.install(|| {
            let mut occluded = vec![false; rays.len()];
            let mut hits = vec![None; rays.len()];
            bvh.batch(&rays).occluded_into(&mut occluded);
            bvh.batch(&rays).intersect_into(&mut hits);
            (occluded, hits)
        }));
    }
    assert!(answers.iter().all(|other| *other == answers[0]));
}

#[test]
#[should_panic(expected = "one answer per ray")]
fn slices_of_different_length_panic() {
    let (bvh, rays) = tree(Engine::best(Width::W4));
    bvh.batch(&rays)
        .occluded_into(&mut vec![false; rays.len() - 1]);
}
