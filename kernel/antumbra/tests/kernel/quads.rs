//! Quads: the same hits as those of their triangles, with other names. Scenes of other tests have them, too.

use antumbra::shapes::{DropReason, Dropped};
use antumbra::{Brute, Bvh, Error, Geometry, Hit, Instance, PrimId, Primitives, Ray, Recipe};
use antumbra_testkit::{Mesh, Rng, mesh, rays};
use proptest::prelude::*;

use crate::support::{bits, config, for_every_tree, kernel_rays};
use crate::transforms::transform;

/// Quads of any shape and the triangles that they are, two for each.
fn both(rng: &mut Rng, size: usize) -> (Mesh, Vec<[u32; 4]>) {
    let mut any = mesh::soup(rng, size);
    // Few coordinates, so that corners coincide.
    if rng.below(3) == 0 {
        for x in any.positions.as_flattened_mut() {
            *x = (2.0 * *x).round();
        }
    }
    let count = any.positions.len();
    let mut corner = || rng.below(count) as u32;
    let quads: Vec<_> = (0..size)
        .map(|index| match index % 4 {
            // A triangle, as files have it.
            0 => {
                let [a, b, c] = [corner(), corner(), corner()];
                [a, b, c, c]
            }
            _ => [corner(), corner(), corner(), corner()],
        })
        .collect();
    let triangles = quads
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *d], [*c, *d, *b]]);
    any.indices = triangles.collect();
    (any, quads)
}

/// A hit on a triangle as one on its quad.
fn on_quad(hit: Hit) -> Hit {
    let (u, v) = match hit.prim_id % 2 {
        0 => (hit.u, hit.v),
        _ => (1.0 - hit.u, 1.0 - hit.v),
    };
    Hit {
        u,
        v,
        prim_id: hit.prim_id / 2,
        ..hit
    }
}

proptest! {
    #![proptest_config(config(4))]

    /// In the world and in instances, by every query.
    #[test]
    fn quads_are_pairs_of_triangles(seed: u64) {
        let mut rng = Rng::new(seed);
        let size = 1 + rng.below(60);
        let (any, indices) = both(&mut rng, size);
        let instances: Vec<_> = (0..rng.below(4))
            .map(|_| Instance::new(0, transform(&mut rng)))
            .collect();
        let scene = |kind: Geometry<'_>| {
            let world = core::slice::from_ref(&kind);
            Primitives::with_instances(world, &[vec![kind.clone()]], &instances).expect("in range")
        };
        let quads = scene(Geometry::quads(&any.positions[..], &indices[..]));
        let triangles = scene(Geometry::triangles(&any.positions[..], &any.indices[..]));
        prop_assert_eq!(quads.len(), triangles.len());
        let rays = kernel_rays(&rays::around(&mut rng, &any, 80));
        let brute = Brute::new(&triangles);
        let oracle = Brute::new(&quads);
        let name = |near: &antumbra::ClosestPoint| (near.inst_id, near.geom_id, near.prim_id);
        for_every_tree(&quads, &rays, |bvh, tree| {
            let place = format!("seed {seed}, {tree}");
            let mut hits = vec![None; rays.len()];
            bvh.batch(&rays).intersect_into(&mut hits);
            for (ray, hit) in rays.iter().zip(hits) {
                let expected = brute.intersect(ray).map(on_quad);
                assert_eq!(bits(hit), bits(expected), "{place}");
                assert_eq!(bits(bvh.intersect(ray)), bits(expected), "{place}");
                assert_eq!(bits(oracle.intersect(ray)), bits(expected), "{place}");
                assert_eq!(bvh.occluded(ray), expected.is_some(), "{place}");
                let all: Vec<_> = brute.query(ray).all_hits().into_iter().map(on_quad).collect();
                assert_eq!(bvh.query(ray).all_hits(), all, "{place}");
                assert_eq!(oracle.query(ray).all_hits(), all, "{place}");
                let Some(hit) = expected else { continue };
                let id = PrimId::from(hit);
                let next = all.iter().find(|hit| PrimId::from(**hit) != id).copied();
                assert_eq!(bits(bvh.query(ray).except(id).intersect()), bits(next), "{place}");
                assert_eq!(bvh.query(ray).except(id).occluded(), next.is_some(), "{place}");
            }
            for _ in 0..4 {
                let point = rng.point(1.5);
                let near = brute.closest(point, f32::INFINITY);
                let found = bvh.closest(point, f32::INFINITY);
                assert_eq!(found.map(|near| near.distance), near.map(|near| near.distance));
                assert_eq!(found.map(|near| near.prim_id), near.map(|near| near.prim_id / 2));
                let within = bvh.within(point, 1.0);
                assert_eq!(within, oracle.within(point, 1.0), "{place}");
                let mut names: Vec<_> = within.iter().map(name).collect();
                names.sort_unstable();
                let halves = brute.within(point, 1.0);
                let mut halves: Vec<_> = halves.iter().map(name).map(|(i, g, p)| (i, g, p / 2)).collect();
                halves.sort_unstable();
                halves.dedup();
                assert_eq!(names, halves, "{place}");
                assert_eq!(bvh.contains(point), brute.contains(point), "{place}");
            }
        });
    }
}

/// A quad with numbers that can be worked out by hand.
#[test]
fn coordinates_run_over_the_whole_quad() {
    let corners = [
        [0.0, 0.0, 1.0],
        [2.0, 0.0, 1.0],
        [2.0, 4.0, 1.0],
        [0.0, 4.0, 1.0],
    ];
    let quad = [Geometry::quads(&corners[..], vec![[0, 1, 2, 3]])];
    let bvh = Bvh::build(&quad, &Recipe::default()).expect("in range");
    let up = |x, y| Ray::new([x, y, 0.0], [0.0, 0.0, 1.0]);
    for (x, y) in [(0.5, 0.5), (1.5, 3.5), (0.25, 3.0), (1.75, 1.0)] {
        let ray = up(x, y);
        let hit = bvh.intersect(&ray).expect("a quad");
        assert_eq!((hit.u, hit.v, hit.prim_id), (0.5 * x, 0.25 * y, 0));
        assert_eq!(bvh.normal(&ray, &hit), Some([0.0, 0.0, 1.0]));
        assert_eq!(bvh.query(&ray).count_hits(), 1);
    }
    // On the diagonal both triangles are hit.
    assert_eq!(bvh.query(&up(1.0, 2.0)).count_hits(), 2);
    let rays = [up(1.0, 2.0), up(0.5, 0.5)];
    let excluded = [PrimId::from(bvh.intersect(&rays[0]).expect("a quad")); 2];
    assert_eq!(bvh.batch(&rays).except(&excluded).count_hits(), [0, 0]);
    let near = bvh.closest([1.5, 3.5, 5.0], 9.0).expect("4 away");
    assert_eq!((near.u, near.v, near.distance), (0.75, 0.875, 4.0));
}

/// Normals of quads that are not flat are those of the triangle that is hit.
#[test]
fn each_half_has_its_normal() {
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 0.0],
    ];
    let quad = [Geometry::quads(&corners[..], vec![[0, 1, 2, 3]])];
    let bvh = Bvh::build(&quad, &Recipe::default()).expect("in range");
    let down = |x, y| Ray::new([x, y, 5.0], [0.0, 0.0, -1.0]);
    let normal = |ray: &Ray| bvh.normal(ray, &bvh.intersect(ray).expect("a quad"));
    assert_eq!(normal(&down(0.25, 0.25)), Some([0.0, 0.0, 1.0]));
    let tilted = (1.0 / 3f64.sqrt()) as f32;
    assert_eq!(normal(&down(0.75, 0.75)), Some([-tilted, -tilted, tilted]));
}

/// No ray slips through the diagonal, or between two quads.
#[test]
fn quads_are_watertight() {
    let mut rng = Rng::new(81);
    let side = 12;
    let positions: Vec<_> = (0..(side + 1) * (side + 1))
        .map(|place| {
            let [x, y] = [place % (side + 1), place / (side + 1)].map(|x| x as f32 / side as f32);
            [x, y, 0.2 * rng.unit()]
        })
        .collect();
    let indices: Vec<_> = (0..side * side)
        .map(|place| {
            let corner = (place / side * (side + 1) + place % side) as u32;
            let above = corner + side as u32 + 1;
            [corner, corner + 1, above + 1, above]
        })
        .collect();
    let geometry = [Geometry::quads(&positions[..], &indices[..])];
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("in range");
    let brute = Brute::new(&Primitives::new(&geometry).expect("in range"));
    let mut rays = Vec::new();
    for _ in 0..20_000 {
        let [a, b, _, d] = indices[rng.below(indices.len())];
        let other = if rng.below(3) == 0 { a } else { d };
        let [p, q] = [b, other].map(|corner| positions[corner as usize]);
        let s = rng.unit();
        // At a diagonal or a side, inside the sheet.
        let on: [f32; 3] = core::array::from_fn(|axis| p[axis] + s * (q[axis] - p[axis]));
        let on = [on[0].clamp(0.05, 0.95), on[1].clamp(0.05, 0.95), on[2]];
        let org = [on[0] + 0.04 * (rng.unit() - 0.5), on[1], 2.0];
        rays.push(Ray::new(
            org,
            core::array::from_fn(|axis| on[axis] - org[axis]),
        ));
    }
    let mut occluded = vec![false; rays.len()];
    bvh.batch(&rays).occluded_into(&mut occluded);
    for (ray, occluded) in rays.iter().zip(occluded) {
        assert!(occluded && brute.occluded(ray), "{ray:?}");
    }
}

#[test]
fn unsound_quads_are_dropped_whole_and_half_ones_kept() {
    let positions = [
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
        [f32::NAN; 3],
    ];
    let indices = vec![
        [0, 1, 2, 3],
        // Triangles.
        [0, 1, 2, 2],
        [0, 0, 1, 2],
        // Lines, or less.
        [0, 1, 1, 0],
        [0, 1, 0, 1],
        [2, 2, 2, 2],
        // Also where one half is finite.
        [0, 1, 4, 3],
    ];
    let list = [Geometry::quads(&positions[..], &indices[..])];
    let primitives = Primitives::new(&list).expect("in range");
    assert_eq!(primitives.len(), 4);
    let dropped: Vec<_> = primitives
        .dropped_list()
        .iter()
        .map(|dropped| match dropped {
            Dropped::Primitive {
                prim_id, reason, ..
            } => (*prim_id, *reason),
            other => panic!("{other}"),
        })
        .collect();
    let coincide = DropReason::CornersCoincide;
    let expected = [
        (3, coincide),
        (4, coincide),
        (5, coincide),
        (6, DropReason::NotFinite),
    ];
    assert_eq!(dropped, expected);

    let mut bvh = Bvh::build(&primitives, &Recipe::default()).expect("a tree");
    assert_eq!(bvh.refit(&list), Ok(()));
    let mut other = indices.clone();
    other.swap(0, 6);
    let gone = bvh.refit(&[Geometry::quads(&positions[..], &other[..])]);
    let expected = Error::PrimitiveIsGone {
        geom_id: 0,
        prim_id: 0,
    };
    assert_eq!(gone, Err(expected));
    let error = bvh
        .refit(&[Geometry::quads(&positions[..], vec![[0, 1, 2, 5]])])
        .expect_err("vertex 5 of 5");
    let text = "quad 0 of geometry 0 uses vertex 5, but there are 5 vertices";
    assert_eq!(error.to_string(), text);
    let error = Primitives::new(&[Geometry::quads(&positions[..], vec![[0, 1, 2, 5]])]);
    assert_eq!(error.expect_err("vertex 5 of 5").to_string(), text);
    let triangles = [Geometry::triangles(&positions[..], vec![[0, 1, 2]; 4])];
    assert!(matches!(
        bvh.refit(&triangles),
        Err(Error::PrimitiveIsGone { .. })
    ));
}
