//! What conditions, surfaces and occluders cost in batches of 1000 rays, relative to plain batches of the same rays.

use std::cell::RefCell;

use antumbra::{Bvh, Hit, Masks, PrimId, Ray};

use crate::turns::{Work, medians};

/// Rays of a call.
const CALL: usize = 1000;

/// Prints times relative to the plain batches.
pub fn run(name: &str, bvh: &Bvh, rays: &[Ray], rounds: usize) {
    let mut masked = bvh.clone();
    masked.set_masks(Masks::new().world(vec![0b11]));
    let masked = &masked;
    let excluded = vec![PrimId::NONE; rays.len()];
    let accept = |_: usize, _: &Hit| true;
    let occluded = RefCell::new(vec![false; rays.len()]);
    let hits = RefCell::new(vec![None; rays.len()]);
    let occluders = RefCell::new(vec![None; rays.len()]);
    let surfaces = RefCell::new(vec![None; rays.len()]);
    let (occluded, hits, excluded, accept) = (&occluded, &hits, &excluded, &accept);
    let (occluders, surfaces) = (&occluders, &surfaces);
    let pieces = || {
        (0..rays.len())
            .step_by(CALL)
            .map(|first| first..rays.len().min(first + CALL))
    };
    let mut works: Vec<Work<'_>> = Vec::new();
    macro_rules! work {
        ($name:literal, $answers:ident, |$range:ident, $place:ident| $call:expr) => {
            works.push((
                $name.into(),
                Box::new(move || {
                    let mut answers = $answers.borrow_mut();
                    for $range in pieces() {
                        let $place = &mut answers[$range.clone()];
                        $call;
                    }
                }),
            ));
        };
    }
    work!("occluded", occluded, |range, answers| bvh
        .batch(&rays[range])
        .on_this_thread()
        .occluded_into(answers));
    work!("occluded, mask", occluded, |range, answers| masked
        .batch(&rays[range])
        .on_this_thread()
        .mask(1)
        .occluded_into(answers));
    work!("occluded, except", occluded, |range, answers| bvh
        .batch(&rays[range.clone()])
        .on_this_thread()
        .except(&excluded[range])
        .occluded_into(answers));
    work!("occluded, filter", occluded, |range, answers| bvh
        .batch(&rays[range])
        .on_this_thread()
        .filter(accept)
        .occluded_into(answers));
    work!("occluders", occluders, |range, answers| bvh
        .batch(&rays[range])
        .on_this_thread()
        .occluders_into(answers));
    let count = works.len();
    work!("intersect", hits, |range, answers| bvh
        .batch(&rays[range])
        .on_this_thread()
        .intersect_into(answers));
    work!("intersect, mask", hits, |range, answers| masked
        .batch(&rays[range])
        .on_this_thread()
        .mask(1)
        .intersect_into(answers));
    work!("intersect, filter", hits, |range, answers| bvh
        .batch(&rays[range])
        .on_this_thread()
        .filter(accept)
        .intersect_into(answers));
    work!("surfaces", surfaces, |range, answers| bvh
        .batch(&rays[range])
        .on_this_thread()
        .surfaces_into(answers));
    let names: Vec<String> = works.iter().map(|(name, _)| name.clone()).collect();
    let times = medians(rounds, &mut works);
    for (index, (name_of, time)) in names.iter().zip(&times).enumerate() {
        let plain = times[if index < count { 0 } else { count }];
        println!(
            "{name:16} {name_of:18} {:7.1} ns {:6.2}",
            1e9 * time / rays.len() as f64,
            time / plain
        );
    }
}
