//! Refit: a tree whose vertices moved answers like a tree built anew and like brute force.

use std::sync::Arc;

use crate::support::{
    BUILDERS, Odd, Stripes, bits, brute, config, cutouts, geometry, kernel_rays, orders, quads,
    ways,
};
use antumbra::recipe::Collapse;
use antumbra::shapes::Sphere;
use antumbra::{Bvh, Error, Geometry, Instance, Primitives, Recipe};
use antumbra_testkit::sample::triples;
use antumbra_testkit::{Mesh, Rng, mesh, rays};
use proptest::prelude::*;

/// A mesh of the same triangles somewhere else.
fn moved(rng: &mut Rng, mesh: &Mesh) -> Mesh {
    let by = [0.01, 0.5, 30.0][rng.below(3)];
    let scale = [1.0, 0.1, 50.0][rng.below(3)];
    mesh.map("moved", |position| {
        let moved = rng.point(by);
        core::array::from_fn(|axis| scale * position[axis] + moved[axis])
    })
}

/// Asserts that a tree answers as brute force over these geometries does.
fn check(bvh: &Bvh, geometries: &[Geometry<'_>], rays: &[antumbra::Ray], place: &str) {
    bvh.validate()
        .unwrap_or_else(|broken| panic!("{place}: {broken}"));
    let brute = brute(geometries);
    let mut occluded = vec![false; rays.len()];
    let mut hits = vec![None; rays.len()];
    bvh.batch(rays).occluded_into(&mut occluded);
    bvh.batch(rays).intersect_into(&mut hits);
    for (index, ray) in rays.iter().enumerate() {
        let hit = brute.intersect(ray);
        assert_eq!(occluded[index], hit.is_some(), "{place}: {ray:?}");
        assert_eq!(bits(hits[index]), bits(hit), "{place}: {ray:?}");
    }
}

proptest! {
    #![proptest_config(config(24))]

    /// Every builder and collapse, with triangles, spheres and cut-outs.
    #[test]
    fn refit_equals_rebuild(seed: u64) {
        let mut rng = Rng::new(seed);
        let any = mesh::ALL[rng.below(mesh::ALL.len())];
        let before = [any(&mut rng, 80), any(&mut rng, 40)];
        let spheres = |rng: &mut Rng| -> Vec<_> {
            let sphere = |rng: &mut Rng| Sphere { center: rng.point(1.0), radius: 0.01 + 0.2 * rng.unit() };
            (0..9).map(|_| sphere(rng)).collect()
        };
        let spheres = [spheres(&mut rng), spheres(&mut rng)];
        let after = [moved(&mut rng, &before[0]), moved(&mut rng, &before[1])];
        let stripes = Arc::new(Stripes { count: 3.0 });
        let odd = [Odd::new(&mut rng, 12), Odd::new(&mut rng, 12)].map(|mut odd| {
            // Sound at both times.
            odd.boxes.retain(|bounds| !bounds.is_empty() && bounds.half_area().is_finite());
            odd.boxes.resize(8, antumbra::Aabb { min: [0.0; 3], max: [1.0; 3] });
            odd
        });
        let list = |meshes: &[Mesh; 2], time: usize| {
            let [opaque, holes] = meshes;
            let list = vec![
                geometry(opaque),
                Geometry::spheres(spheres[time].clone()),
                odd[time].geometry(),
                quads(opaque),
                cutouts(holes, Arc::clone(&stripes) as _),
            ];
            list.into_iter().map(into_owned).collect::<Vec<_>>()
        };
        let (first, second) = (list(&before, 0), list(&after, 1));
        let rays = kernel_rays(&rays::around(&mut rng, &after[0], 120));
        for (builder, collapse, engine) in triples(seed, &BUILDERS, &Collapse::ALL, &ways()) {
            let order = orders()[rng.below(orders().len())];
            let recipe = Recipe::default().builder(builder).collapse(collapse).engine(engine).order(order);
            let place = format!("seed {seed}, {builder} {collapse} {engine:?} {order}");
            let mut bvh = Bvh::build(&first, &recipe).expect("indices in range");
            prop_assert_eq!(bvh.report().quality, 1.0);
            match bvh.refit(&second) {
                Ok(()) => {}
                Err(Error::OtherPrimitives { .. } | Error::PrimitiveIsGone { .. }) => {
                    check(&bvh, &first, &rays, &format!("{place}, as it was"));
                    continue;
                }
                Err(error) => panic!("{place}: {error}"),
            }
            let rebuilt = Bvh::build(&second, &recipe).expect("indices in range");
            prop_assert_eq!(bvh.bounds(), rebuilt.bounds(), "{}", place);
            engine.run(&mut bvh).expect("its width");
            check(&bvh, &second, &rays, &place);
            bvh.refit(&first).expect("what it was built over");
            check(&bvh, &first, &rays, &format!("{place}, there and back"));
        }
    }
}

/// The same geometry without a borrow.
fn into_owned(geometry: Geometry<'_>) -> Geometry<'static> {
    match geometry {
        Geometry::Triangles(mesh) => {
            let (positions, indices) = (mesh.positions.into_owned(), mesh.indices.into_owned());
            match mesh.opacity {
                Some(opacity) => Geometry::cutouts(positions, indices, opacity),
                None => Geometry::triangles(positions, indices),
            }
        }
        Geometry::Spheres(spheres) => Geometry::spheres(spheres.into_owned()),
        Geometry::User { count, shape } => Geometry::user(count, shape),
        Geometry::Quads(mesh) => {
            Geometry::quads(mesh.positions.into_owned(), mesh.indices.into_owned())
        }
        _ => unreachable!("no other kinds"),
    }
}

/// A tree large enough to be refitted by several threads at once.
#[test]
fn large_trees_refit_in_pieces() {
    let mut rng = Rng::new(2026);
    let before = mesh::bumpy_grid(&mut rng, 120_000);
    let after = before.map("stirred", |[x, y, z]| {
        [x + 0.2 * y, y - 0.1 * z * x, z + 0.3 * x]
    });
    let recipe = Recipe::fast();
    let mut bvh = Bvh::build(&[geometry(&before)], &recipe).expect("indices in range");
    let nodes = bvh.report().nodes;
    bvh.refit(&[geometry(&after)]).expect("all sound");
    bvh.validate().expect("boxes hold what moved");
    assert_eq!(bvh.report().nodes, nodes);
    let rebuilt = Bvh::build(&[geometry(&after)], &recipe).expect("indices in range");
    let rays = kernel_rays(&rays::around(&mut rng, &after, 20_000));
    let hits = |bvh: &Bvh| {
        let mut hits = vec![None; rays.len()];
        bvh.batch(&rays).intersect_into(&mut hits);
        hits.into_iter().map(bits).collect::<Vec<_>>()
    };
    assert_eq!(hits(&bvh), hits(&rebuilt));
}

/// Neighbours that fly apart make the nodes worse, and moving all by the same does not.
#[test]
fn quality_tells_when_a_rebuild_pays() {
    let mut rng = Rng::new(7);
    let before = mesh::bumpy_grid(&mut rng, 2000);
    let mut bvh = Bvh::build(&[geometry(&before)], &Recipe::default()).expect("indices in range");
    let larger = before.map("larger", |position| position.map(|x| 4.0 * x));
    bvh.refit(&[geometry(&larger)]).expect("all sound");
    assert!(
        (bvh.report().quality - 1.0).abs() < 1e-3,
        "{}",
        bvh.report().quality
    );
    let torn = before.map("torn", |_| rng.point(1.0));
    bvh.refit(&[geometry(&torn)]).expect("all sound");
    assert!(bvh.report().quality > 3.0, "{}", bvh.report().quality);
}

/// What a rebuild would drop or keep otherwise is an error.
#[test]
fn other_primitives_are_errors() {
    let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN; 3]];
    let list = |positions: [[f32; 3]; 4], indices: &[[u32; 3]]| {
        [Geometry::triangles(positions.to_vec(), indices.to_vec())]
    };
    let (sound, unsound) = ([0, 1, 2], [0, 1, 3]);
    let mut bvh =
        Bvh::build(&list(positions, &[sound, unsound]), &Recipe::default()).expect("in range");
    let mut refit = |geometries: &[Geometry<'_>]| bvh.refit(geometries);
    assert_eq!(refit(&list(positions, &[sound, unsound])), Ok(()));
    let count = |found| Error::OtherPrimitives { expected: 1, found };
    assert_eq!(refit(&list(positions, &[sound, sound])), Err(count(2)));
    assert_eq!(refit(&[]), Err(count(0)));
    let gone = Error::PrimitiveIsGone {
        geom_id: 0,
        prim_id: 0,
    };
    assert_eq!(refit(&list(positions, &[unsound, sound])), Err(gone));
    let range = refit(&list(positions, &[[0, 1, 4], sound]));
    assert!(
        matches!(range, Err(Error::IndexOutOfRange { index: 4, .. })),
        "{range:?}"
    );

    let here = Instance::new(0, crate::transforms::IDENTITY);
    let list = list(positions, &[sound]);
    let primitives = Primitives::with_instances(&[], &[&list], &[here]).expect("in range");
    let mut placed = Bvh::build(&primitives, &Recipe::default()).expect("a tree");
    assert_eq!(placed.refit(&list), Err(Error::HasInstances));
}
