//! What the C interface costs over calls of the Rust library: `interfaces/capi/bench/run`.
//!
//! Both sides ask the same tree in the same program about the same rays. Answers are compared bit for bit before anything is
//! timed. CPU time of one thread, interleaved turns, medians of the turns, and the median of the ratios of neighbouring turns.

#[path = "../../../../science/bench/calls/src/turns.rs"]
#[allow(dead_code, reason = "medians of ratios are made here")]
mod turns;

use std::hint::black_box;
use std::ptr::from_ref;

use antumbra::{Bvh, Geometry, Hit, Ray, Recipe, Surface};
use antumbra_capi::batch::{BatchOptions, THIS_THREAD};
use antumbra_capi::status::Status;
use antumbra_capi::{queries, single};
use turns::seconds;

/// Rays of a batch.
const RAYS: usize = 1_000_000;

/// Turns of each.
const TURNS: usize = 21;

struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    fn direction(&mut self) -> [f32; 3] {
        loop {
            let way: [f32; 3] = [0, 1, 2].map(|_| 2.0 * self.next() - 1.0);
            let square: f32 = way.iter().map(|x| x * x).sum();
            if square > 0.01 && square < 1.0 {
                return way.map(|x| x / square.sqrt());
            }
        }
    }
}

/// A field of towers, as in the example `ambient_occlusion.c`.
fn towers(side: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut random = Random(1);
    let tops: Vec<f32> = (0..side.div_ceil(8).pow(2))
        .map(|_| 16.0 * random.next())
        .collect();
    let height = |x: u32, y: u32| match x % 8 < 4 && y % 8 < 4 {
        true => tops[(y / 8 * side.div_ceil(8) + x / 8) as usize],
        false => 0.0,
    };
    let positions = (0..side * side)
        .map(|place| (place % side, place / side))
        .map(|(x, y)| [x as f32, y as f32, height(x, y)]);
    let triangles = (0..(side - 1).pow(2)).flat_map(|place| {
        let corner = place / (side - 1) * side + place % (side - 1);
        [[0, 1, side + 1], [0, side + 1, side]].map(|corners| corners.map(|c| corner + c))
    });
    (positions.collect(), triangles.collect())
}

/// A ray among other fields of a caller, as the stride of 56 bytes has it.
#[derive(Clone, Copy)]
#[repr(C)]
struct Record {
    ray: Ray,
    hit: Hit,
}

fn ok(status: Status) {
    assert_eq!(status, Status::Ok);
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Times both in turns, and prints a row.
fn row(name: &str, rays: usize, mut rust: impl FnMut(), mut c: impl FnMut()) {
    let time = |work: &mut dyn FnMut()| {
        let start = seconds();
        work();
        seconds() - start
    };
    let (mut ours, mut theirs, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    // The first turn fetches memory. Every other turn begins with the other side.
    for turn in 0..=TURNS {
        let (a, b) = if turn % 2 == 0 {
            let a = time(&mut rust);
            (a, time(&mut c))
        } else {
            let b = time(&mut c);
            (time(&mut rust), b)
        };
        if turn > 0 {
            ours.push(a);
            theirs.push(b);
            ratios.push(b / a);
        }
    }
    let fastest = |times: &[f64]| times.iter().copied().fold(f64::INFINITY, f64::min);
    let of_fastest = fastest(&theirs) / fastest(&ours);
    let nanoseconds = |times| 1e9 * median(times) / rays as f64;
    println!(
        "| {name} | {:.1} | {:.1} | {:.3} | {of_fastest:.3} |",
        nanoseconds(ours),
        nanoseconds(theirs),
        median(ratios)
    );
}

fn main() {
    let (positions, triangles) = towers(330);
    let geometry = [Geometry::triangles(&positions[..], &triangles[..])];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("in range");
    let mut random = Random(7);
    let offset = bvh.bounds().origin_offset();
    let mut rays = Vec::with_capacity(RAYS);
    while rays.len() < RAYS {
        let [x, y, z] = positions[(random.next() * positions.len() as f32) as usize];
        for _ in 0..64.min(RAYS - rays.len()) {
            let [a, b, c] = random.direction();
            rays.push(Ray::new([x, y, z + offset], [a, b, c.abs()]));
        }
    }
    let mut records: Vec<_> = (rays.iter())
        .map(|&ray| Record {
            ray,
            hit: single::MISS,
        })
        .collect();
    let packed = BatchOptions {
        flags: THIS_THREAD,
        ..BatchOptions::of(&rays)
    };
    let apart = BatchOptions {
        rays: &raw const records[0].ray,
        ray_stride: size_of::<Record>(),
        ..packed
    };
    let (tree, packed, apart) = (from_ref(&bvh), &packed, &apart);
    let first_hit = (&raw mut records[0].hit).cast::<Hit>();

    // Answers first.
    let (mut dark, mut dark_c) = (vec![false; RAYS], vec![9u8; RAYS]);
    let (mut bits, mut bits_c) = (vec![0; RAYS.div_ceil(64)], vec![0; RAYS.div_ceil(64)]);
    let (mut hits, mut hits_c) = (vec![None; RAYS], vec![single::MISS; RAYS]);
    let nothing = single::surface(None);
    let (mut surfaces, mut surfaces_c) = (vec![None::<Surface>; RAYS], vec![nothing; RAYS]);
    let batch = || bvh.batch(&rays).on_this_thread();
    batch().occluded_into(&mut dark);
    batch().occluded_bits_into(&mut bits);
    batch().intersect_into(&mut hits);
    batch().surfaces_into(&mut surfaces);
    let occluded = |batch: *const BatchOptions, dark: &mut [u8]| {
        // SAFETY: a byte for each ray.
        ok(unsafe { queries::antumbra_occluded(black_box(tree), batch, dark.as_mut_ptr(), 0) });
    };
    let occluded_bits = |batch: *const BatchOptions, bits: &mut [u64]| {
        // SAFETY: a bit for each ray.
        ok(unsafe {
            queries::antumbra_occluded_bits(black_box(tree), batch, bits.as_mut_ptr(), bits.len())
        });
    };
    let intersect = |batch: *const BatchOptions, hits: *mut Hit, stride: usize| {
        // SAFETY: a hit for each ray.
        ok(unsafe { queries::antumbra_intersect(black_box(tree), batch, hits, stride) });
    };
    let surface = |batch: *const BatchOptions, surfaces: &mut [single::Surface]| {
        // SAFETY: a surface for each ray.
        ok(unsafe {
            queries::antumbra_surface_of(black_box(tree), batch, surfaces.as_mut_ptr(), 0)
        });
    };
    occluded(packed, &mut dark_c);
    occluded_bits(packed, &mut bits_c);
    intersect(packed, hits_c.as_mut_ptr(), 0);
    surface(packed, &mut surfaces_c);
    intersect(apart, first_hit, size_of::<Record>());
    for ray in 0..RAYS {
        let hit = hits[ray].unwrap_or(single::MISS);
        assert_eq!(dark[ray], dark_c[ray] == 1);
        assert_eq!(hits_c[ray], hit);
        assert_eq!(records[ray].hit, hit);
        assert_eq!(surfaces_c[ray], single::surface(surfaces[ray]));
    }
    assert_eq!(bits, bits_c);
    let blocked = dark.iter().filter(|dark| **dark).count();
    println!(
        "{} triangles, {RAYS} rays, {blocked} of them blocked; all answers equal",
        triangles.len()
    );
    println!();
    println!("| query | Rust, ns per ray | C, ns per ray | C over Rust, median | fastest turns |");
    println!("|---|---|---|---|---|");
    row(
        "occluded",
        RAYS,
        || batch().occluded_into(&mut dark),
        || occluded(packed, &mut dark_c),
    );
    row(
        "occluded, bits",
        RAYS,
        || batch().occluded_bits_into(&mut bits),
        || occluded_bits(packed, &mut bits_c),
    );
    row(
        "intersect",
        RAYS,
        || batch().intersect_into(&mut hits),
        || intersect(packed, hits_c.as_mut_ptr(), 0),
    );
    row(
        "surface",
        RAYS,
        || batch().surfaces_into(&mut surfaces),
        || surface(packed, &mut surfaces_c),
    );
    row(
        "intersect, rays and hits in one structure",
        RAYS,
        || batch().intersect_into(&mut hits),
        || intersect(apart, first_hit, size_of::<Record>()),
    );
    let few = &rays[..100_000];
    let mut count = 0;
    row(
        "occluded1",
        few.len(),
        || {
            count += few
                .iter()
                .filter(|ray| black_box(&bvh).occluded(ray))
                .count()
        },
        || {
            for ray in few {
                let mut is = false;
                // SAFETY: a ray, and a place for the answer.
                ok(unsafe { single::antumbra_occluded1(black_box(tree), ray, &raw mut is) });
                black_box(is);
            }
        },
    );
    row(
        "intersect1",
        few.len(),
        || {
            for ray in few {
                black_box(black_box(&bvh).intersect(ray));
            }
        },
        || {
            for ray in few {
                let mut hit = single::MISS;
                // SAFETY: as above.
                ok(unsafe { single::antumbra_intersect1(black_box(tree), ray, &raw mut hit) });
                black_box(hit);
            }
        },
    );
    black_box(count);
}
