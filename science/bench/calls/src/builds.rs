//! What builds cost beside Embree's, on one thread, and at which rate the trees answer.

use std::cell::RefCell;

use antumbra::{Bvh, Geometry, Ray, Recipe};

use crate::embree::Embree;
use crate::input::Mesh;
use crate::turns::{Work, medians};

/// Triangles that are built: so many of the first ones of a scene, or all.
const SIZES: [usize; 6] = [8, 48, 360, 10_000, 100_000, 1_000_000];

/// Prints times relative to Embree's, and rates relative to those of the default.
pub fn run(name: &str, embree: &mut Embree, mesh: &Mesh, rays: [&[Ray]; 2], rounds: usize) {
    let recipes = [("default", Recipe::default()), ("fast", Recipe::fast())];
    let embree = RefCell::new(embree);
    for size in SIZES.into_iter().chain([mesh.indices.len()]) {
        if size > mesh.indices.len() {
            continue;
        }
        let part = mesh.first(size);
        let repeat = (20_000 / size).max(1);
        let geometry = [Geometry::triangles(&part.positions[..], &part.indices[..])];
        let mut works: Vec<Work<'_>> = vec![(
            "Embree".into(),
            Box::new(|| (0..repeat).for_each(|_| embree.borrow_mut().build(&part))),
        )];
        for (name, recipe) in &recipes {
            let build = || (0..repeat).for_each(|_| drop(Bvh::build(&geometry, recipe)));
            works.push(((*name).into(), Box::new(build)));
        }
        let names: Vec<String> = works.iter().map(|(name, _)| name.clone()).collect();
        let times = medians(rounds, &mut works);
        for (recipe, time) in names.iter().zip(&times) {
            println!(
                "{name:16} {size:8} triangles, {recipe:16} {:10.4} ms {:6.2}",
                1e3 * time / repeat as f64,
                time / times[0]
            );
        }
    }
    let geometry = [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])];
    for (kind, rays) in ["ao", "shadow"].into_iter().zip(rays) {
        let trees = recipes.map(|(_, recipe)| Bvh::build(&geometry, &recipe).expect("as above"));
        let answers = RefCell::new(vec![false; rays.len()]);
        let mut works: Vec<Work<'_>> = Vec::new();
        for ((name, _), tree) in recipes.iter().zip(&trees) {
            let answers = &answers;
            let ask = move || {
                tree.batch(rays)
                    .on_this_thread()
                    .occluded_into(&mut answers.borrow_mut());
            };
            works.push(((*name).into(), Box::new(ask)));
        }
        let times = medians(rounds, &mut works);
        for ((recipe, _), time) in recipes.iter().zip(&times) {
            println!(
                "{name:16} {kind:8} rays, {recipe:16} {:6.2}",
                times[0] / time
            );
        }
    }
}
