//! What builds cost beside Embree's, on one thread, and at which rate the trees answer.

use antumbra::{Bvh, Recipe};
use antumbra_lab::embree::{Scene, SceneFlags};
use antumbra_lab::harness::{Bench, Case};

use crate::Outcome;
use crate::input::Input;

/// Triangles that are built: so many of the first ones of a scene, or all.
const SIZES: [usize; 6] = [8, 48, 360, 10_000, 100_000, 1_000_000];

pub fn run(bench: &mut Bench, name: &str, input: &Input) -> Outcome {
    let recipes = [("default", Recipe::default()), ("fast", Recipe::fast())];
    let (device, mesh) = (&bench.device()?, &input.mesh);
    let all = mesh.indices.len();
    for size in SIZES.into_iter().filter(|size| *size < all).chain([all]) {
        let part = mesh.first(size);
        let (model, geometry) = (part.model(), [part.geometry()]);
        let repeat = (20_000 / size).max(1);
        let nothing = Vec::<bool>::new;
        let mut case = Case::new(format!("{name} {size} triangles"), repeat);
        case.base("Embree", nothing(), |_| {
            for _ in 0..repeat {
                Scene::build(device, &model, SceneFlags::default()).expect("a mesh");
            }
        });
        for (name, recipe) in &recipes {
            let geometry = &geometry;
            case.add(*name, nothing(), move |_| {
                (0..repeat).for_each(|_| drop(Bvh::build(geometry, recipe)));
            });
        }
        case.run(bench, [0.0; 2])?;
    }
    let build = |(name, recipe)| {
        (
            name,
            Bvh::build(&[mesh.geometry()], &recipe).expect("as above"),
        )
    };
    let trees = recipes.map(build);
    for (kind, rays) in &input.rays {
        let mut case = Case::new(format!("{name} {kind}"), rays.len());
        let answer = |bvh| {
            move |answers: &mut [bool]| {
                Bvh::batch(bvh, rays)
                    .on_this_thread()
                    .occluded_into(answers)
            }
        };
        case.base(trees[0].0, vec![false; rays.len()], answer(&trees[0].1));
        case.add(trees[1].0, vec![false; rays.len()], answer(&trees[1].1));
        case.run(bench, [0.0; 2])?;
    }
    Ok(())
}
