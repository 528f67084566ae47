//! How many rays a call has: from 1 to 16 384, beside Embree's calls of 1, 4, 8 and 16.

use std::cell::RefCell;

use antumbra::inputs::Column;
use antumbra::{Bvh, Ray, RayColumns};

use crate::embree::Embree;
use crate::turns::{Work, medians};

pub const SIZES: [usize; 12] = [1, 2, 4, 8, 12, 16, 24, 32, 64, 256, 1000, 16384];

/// Prints rates relative to `rtcOccluded1`.
pub fn run(name: &str, bvh: &Bvh, embree: &Embree, rays: &[Ray], rounds: usize) {
    let mut expected = vec![false; rays.len()];
    embree.occluded(rays, &mut expected);
    let answers = RefCell::new(vec![false; rays.len()]);
    let columns = Columns::of(rays);
    let mut works: Vec<Work<'_>> = vec![(
        "rtcOccluded1".into(),
        Box::new(|| embree.occluded(rays, &mut answers.borrow_mut())),
    )];
    for size in [4, 8, 16] {
        let answers = &answers;
        let packets = move || embree.occluded_packets(size, rays, &mut answers.borrow_mut());
        works.push((format!("rtcOccluded{size}"), Box::new(packets)));
    }
    works.push((
        "occluded".into(),
        Box::new(|| {
            for (ray, answer) in rays.iter().zip(answers.borrow_mut().iter_mut()) {
                *answer = bvh.occluded(ray);
            }
        }),
    ));
    for size in SIZES {
        let answers = &answers;
        works.push((
            format!("batch of {size}"),
            Box::new(move || {
                let mut answers = answers.borrow_mut();
                for (rays, answers) in rays.chunks(size).zip(answers.chunks_mut(size)) {
                    bvh.batch(rays).on_this_thread().occluded_into(answers);
                }
            }),
        ));
    }
    let (answers, columns) = (&answers, &columns);
    works.push((
        "16 in columns".into(),
        Box::new(move || {
            let mut answers = answers.borrow_mut();
            for (index, answers) in answers.chunks_mut(16).enumerate() {
                let columns = columns.at(16 * index, answers.len());
                bvh.batch(columns).on_this_thread().occluded_into(answers);
            }
        }),
    ));
    let names: Vec<String> = works.iter().map(|(name, _)| name.clone()).collect();
    let mut differences = Vec::new();
    for (name, work) in &mut works {
        work();
        let answers = answers.borrow();
        let differ = answers
            .iter()
            .zip(&expected)
            .filter(|(a, b)| a != b)
            .count();
        if differ > rays.len() / 10_000 {
            differences.push(format!("{name}: {differ} answers differ"));
        }
    }
    let times = medians(rounds, &mut works);
    for (name_of, time) in names.iter().zip(&times) {
        println!(
            "{name:16} {name_of:16} {:7.1} ns {:6.2}",
            1e9 * time / rays.len() as f64,
            times[0] / time
        );
    }
    for text in differences {
        println!("{name:16} {text}");
    }
}

/// Rays in separate arrays: origins, directions and ends of the intervals.
struct Columns([Vec<f32>; 8]);

impl Columns {
    fn of(rays: &[Ray]) -> Self {
        let numbers = |number: usize| {
            let each = rays.iter().map(|ray| {
                let [ox, oy, oz] = ray.org;
                let [dx, dy, dz] = ray.dir;
                [ox, oy, oz, dx, dy, dz, ray.tnear, ray.tfar][number]
            });
            each.collect()
        };
        Self([0, 1, 2, 3, 4, 5, 6, 7].map(numbers))
    }

    fn at(&self, first: usize, len: usize) -> RayColumns<'_> {
        let [ox, oy, oz, dx, dy, dz, near, far] = self
            .0
            .each_ref()
            .map(|numbers| &numbers[first..first + len]);
        RayColumns::new(
            len,
            Column::of_axes(ox, oy, oz),
            Column::of_axes(dx, dy, dz),
        )
        .and_then(|rays| rays.near(near)?.far(far))
        .expect("as many numbers as rays")
    }
}
