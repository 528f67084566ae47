//! Batches by their sizes, beside Embree's calls of 1, 4, 8 and 16 rays; and by their conditions.

use std::ops::Range;

use antumbra::inputs::Column;
use antumbra::{Hit, Masks, PrimId, Ray, RayColumns};
use antumbra_lab::embree::{Call, Scene, SceneFlags};
use antumbra_lab::harness::{Bench, Case, Mesh, each};

use crate::Outcome;

/// Rays of a batch.
const SIZES: [usize; 12] = [1, 2, 4, 8, 12, 16, 24, 32, 64, 256, 1000, 16384];

/// Rays of a batch with conditions.
const CALL: usize = 1000;

/// How many rays a call has.
pub fn sizes(bench: &mut Bench, name: &str, mesh: &Mesh, rays: &[Ray]) -> Outcome {
    let (device, model, bvh) = (bench.device()?, mesh.model(), &mesh.tree());
    let scene = &Scene::build(&device, &model, SceneFlags::default())?;
    let (columns, free) = (&Columns::of(rays), || vec![false; rays.len()]);
    let embree = |call| {
        move |answers: &mut [bool]| {
            scene.occluded(
                call,
                rays.len(),
                |index| rays[index],
                |index, is| answers[index] = is,
            );
        }
    };
    let mut case = Case::new(name, rays.len());
    case.base("rtcOccluded1", free(), embree(Call::Single));
    for size in [4, 8, 16] {
        case.add(
            format!("rtcOccluded{size}"),
            free(),
            embree(Call::Packets(size)),
        );
    }
    case.add("occluded", free(), |answers| {
        each(rays, answers, |ray| bvh.occluded(ray))
    });
    for size in SIZES {
        case.add(format!("batch of {size}"), free(), move |answers| {
            for (rays, answers) in rays.chunks(size).zip(answers.chunks_mut(size)) {
                bvh.batch(rays).on_this_thread().occluded_into(answers);
            }
        });
    }
    case.add("16 in columns", free(), |answers| {
        for (index, answers) in answers.chunks_mut(16).enumerate() {
            let columns = columns.at(16 * index, answers.len());
            bvh.batch(columns).on_this_thread().occluded_into(answers);
        }
    });
    Ok(case.run(bench, [0.0; 2])?)
}

/// Conditions, surfaces and occluders, relative to plain batches of the same rays. No condition leaves anything out.
pub fn conditions(bench: &mut Bench, name: &str, mesh: &Mesh, rays: &[Ray]) -> Outcome {
    let bvh = &mesh.tree();
    let mut masked = bvh.clone();
    masked.set_masks(Masks::new().world(vec![0b11]));
    let excluded = vec![PrimId::NONE; rays.len()];
    let accept = |_: usize, _: &Hit| true;
    let batch = |range: Range<usize>| bvh.batch(&rays[range]).on_this_thread();
    let mask = |range: Range<usize>| masked.batch(&rays[range]).on_this_thread().mask(1);
    let free = || vec![false; rays.len()];
    let none = || vec![None; rays.len()];
    let mut case = Case::new(name, rays.len());
    let occluded = |range, all: &mut _| batch(range).occluded_into(all);
    case.base("occluded", free(), pieces(occluded));
    let of_mask = |range, all: &mut _| mask(range).occluded_into(all);
    case.add("occluded, mask", free(), pieces(of_mask));
    let except = |range: Range<usize>, all: &mut _| {
        let batch = batch(range.clone());
        batch.except(&excluded[range]).occluded_into(all);
    };
    case.add("occluded, except", free(), pieces(except));
    let filter = |range, all: &mut _| batch(range).filter(&accept).occluded_into(all);
    case.add("occluded, filter", free(), pieces(filter));
    let occluders = |range, all: &mut _| batch(range).occluders_into(all);
    case.add("occluders", vec![None; rays.len()], pieces(occluders));
    let intersect = |range, all: &mut _| batch(range).intersect_into(all);
    case.base("intersect", none(), pieces(intersect));
    let of_mask = |range, all: &mut _| mask(range).intersect_into(all);
    case.add("intersect, mask", none(), pieces(of_mask));
    let filter = |range, all: &mut _| batch(range).filter(&accept).intersect_into(all);
    case.add("intersect, filter", none(), pieces(filter));
    let surfaces = |range, all: &mut _| batch(range).surfaces_into(all);
    case.add("surfaces", vec![None; rays.len()], pieces(surfaces));
    Ok(case.run(bench, [0.0; 2])?)
}

/// Answers in pieces, of as many rays as a call has.
fn pieces<A>(mut call: impl FnMut(Range<usize>, &mut [A])) -> impl FnMut(&mut [A]) {
    move |answers| {
        for (index, piece) in answers.chunks_mut(CALL).enumerate() {
            call(CALL * index..CALL * index + piece.len(), piece);
        }
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
