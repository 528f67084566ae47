//! All hits of a ray, and queries that leave out a primitive: every tree against brute force.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use antumbra::cutout::{Candidate, Opacity, QueryKind};
use antumbra::shapes::Sphere;
use antumbra::{
    Brute, Bvh, Geometry, Hit, INVALID_ID, Instance, PrimId, Primitives, Ray, RayOrder, Recipe,
    Visit,
};
use antumbra_testkit::{Mesh, Rng, mesh, rays};
use proptest::prelude::*;

use crate::support::{
    BUILDERS, Odd, bits, config, cutouts, for_every_tree, geometry, kernel_rays, quads, square,
};
use crate::transforms::transform;

/// Holes of every kind, not the same for the two queries.
#[derive(Debug)]
struct Holes;

impl Opacity for Holes {
    fn opacity(&self, candidate: &Candidate) -> f32 {
        match candidate.prim_id % 4 {
            0 => 0.5,
            1 => candidate.u,
            2 if candidate.query == QueryKind::Occluded => 1.0,
            2 => 0.3,
            _ => f32::from(u8::from(candidate.u > candidate.v)),
        }
    }
}

/// Meshes, cut-outs, spheres, user geometry and quads, in the world and in instances of two objects.
fn scene(rng: &mut Rng, any: &Mesh, size: usize) -> Primitives {
    let soup = mesh::soup(rng, size);
    let spheres: Vec<_> = (0..rng.below(12))
        .map(|_| Sphere {
            center: rng.point(1.0),
            radius: rng.unit() * rng.unit() * 0.7,
        })
        .collect();
    let (holes, balls) = (
        cutouts(&soup, Arc::new(Holes)),
        Geometry::spheres(&spheres[..]),
    );
    // The first mesh twice: ties.
    let odd = Odd::new(rng, 20).geometry();
    let world = [
        geometry(any),
        holes.clone(),
        balls.clone(),
        geometry(any),
        odd.clone(),
        quads(any),
    ];
    let objects = [vec![geometry(any), balls], vec![holes, odd, quads(any)]];
    let instances: Vec<_> = (0..rng.below(8))
        .map(|index| Instance::new(index as u32 % 2, transform(rng)))
        .collect();
    Primitives::with_instances(&world, &objects, &instances).expect("in range")
}

/// Rays with all kinds of intervals, some of which begin behind their origins.
fn some_rays(rng: &mut Rng, mesh: &Mesh, count: usize) -> Vec<Ray> {
    let mut rays = kernel_rays(&rays::around(rng, mesh, count));
    for ray in rays.iter_mut().step_by(3) {
        ray.tnear = -ray.tnear.abs() - 3.0 * rng.unit();
    }
    for ray in rays.iter_mut().step_by(17) {
        ray.tnear = f32::NEG_INFINITY;
    }
    rays
}

fn all_bits(hits: &[Hit]) -> Vec<Option<([u32; 3], [u32; 3])>> {
    hits.iter().map(|hit| bits(Some(*hit))).collect()
}

/// A primitive that the ray hits, one that the scene has, or none.
fn excluded(rng: &mut Rng, hits: &[Hit]) -> PrimId {
    match rng.below(4) {
        0 if !hits.is_empty() => hits[rng.below(hits.len())].into(),
        1 => PrimId {
            inst_id: [0, 1, INVALID_ID][rng.below(3)],
            geom_id: rng.below(6) as u32,
            prim_id: rng.below(40) as u32,
        },
        2 => PrimId::NONE,
        _ => hits.first().map_or(PrimId::NONE, |hit| (*hit).into()),
    }
}

proptest! {
    #![proptest_config(config(2))]

    #[test]
    fn every_tree_tells_of_the_hits_of_brute_force(seed: u64) {
        every_tree(seed);
    }
}

fn every_tree(seed: u64) {
    let mut rng = Rng::new(seed);
    for generate in mesh::ALL {
        let size = 1 + rng.below(120);
        let any = generate(&mut rng, size);
        let primitives = scene(&mut rng, &any, size);
        let rays = some_rays(&mut rng, &any, 60);
        let brute = Brute::new(&primitives);
        let hits: Vec<_> = rays.iter().map(|ray| brute.query(ray).all_hits()).collect();
        let left_out: Vec<_> = hits.iter().map(|hits| excluded(&mut rng, hits)).collect();
        let pairs = || rays.iter().zip(&left_out);
        let occluded: Vec<_> = pairs()
            .map(|(ray, id)| brute.query(ray).except(*id).occluded())
            .collect();
        let closest: Vec<_> = pairs()
            .map(|(ray, id)| brute.query(ray).except(*id).intersect())
            .collect();
        for_every_tree(&primitives, &rays, |bvh, tree| {
            let mut found_occluded = vec![false; rays.len()];
            let mut found_bits = vec![0; rays.len().div_ceil(64)];
            let mut found_closest = vec![None; rays.len()];
            let batch = bvh.batch(&rays).except(&left_out);
            batch.occluded_into(&mut found_occluded);
            batch
                .order(RayOrder::Sorted)
                .occluded_bits_into(&mut found_bits);
            batch.on_this_thread().intersect_into(&mut found_closest);
            let lists = bvh.batch(&rays).order(RayOrder::Sorted).all_hits();
            let counts = bvh.batch(&rays).count_hits();
            let lists_but = batch.all_hits();
            let counts_but = batch.order(RayOrder::Sorted).count_hits();
            assert_eq!((lists.len(), lists_but.len()), (rays.len(), rays.len()));
            for (index, ray) in rays.iter().enumerate() {
                let place = || {
                    let name = any.name;
                    format!("seed {seed}, {name}, {tree}, ray {index}: {ray:?}")
                };
                let (hits, id) = (&hits[index], left_out[index]);
                let found = bvh.query(ray).all_hits();
                assert_eq!(all_bits(&found), all_bits(hits), "{}", place());
                assert_eq!(all_bits(lists.of(index)), all_bits(hits), "{}", place());
                assert_eq!(counts[index] as usize, hits.len(), "{}", place());
                let but: Vec<_> = hits
                    .iter()
                    .filter(|hit| PrimId::from(**hit) != id)
                    .copied()
                    .collect();
                assert_eq!(all_bits(lists_but.of(index)), all_bits(&but), "{}", place());
                assert_eq!(counts_but[index] as usize, but.len(), "{}", place());
                assert_eq!(bits(bvh.intersect(ray)), bits(hits.first().copied()));
                assert_eq!(
                    bvh.query(ray).except(id).occluded(),
                    occluded[index],
                    "{}",
                    place()
                );
                assert_eq!(found_occluded[index], occluded[index], "{}", place());
                let bit = found_bits[index / 64] >> (index % 64) & 1;
                assert_eq!(bit == 1, occluded[index], "{}", place());
                for found in [bvh.query(ray).except(id).intersect(), found_closest[index]] {
                    assert_eq!(bits(found), bits(closest[index]), "{}", place());
                }
            }
        });
    }
}

/// Long batches of all hits, among threads, with any order, closed or not.
#[test]
fn lists_of_hits_are_those_of_single_rays() {
    let mut rng = Rng::new(94);
    let any = mesh::soup(&mut rng, 200);
    let bvh = Bvh::build(&[geometry(&any)], &Recipe::default()).expect("in range");
    let rays = kernel_rays(&rays::around(&mut rng, &any, 5000));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build();
    let pool = pool.expect("a pool");
    for order in [RayOrder::AsGiven, RayOrder::Sorted, RayOrder::ByRule] {
        for closed in [false, true] {
            let batch = bvh.batch(&rays).order(order);
            let batch = if closed { batch.closed() } else { batch };
            let (counts, lists) = pool.install(|| (batch.count_hits(), batch.all_hits()));
            assert_eq!(batch.on_this_thread().all_hits(), lists);
            assert_eq!(lists.splits.len(), rays.len() + 1);
            assert_eq!(lists.splits.last(), Some(&lists.hits.len()));
            for (index, ray) in rays.iter().enumerate() {
                let ray = if closed { ray.closed() } else { *ray };
                let hits = bvh.query(&ray).all_hits();
                assert_eq!(lists.of(index), hits, "{order:?} {ray:?}");
                assert_eq!(counts[index] as usize, hits.len(), "{order:?} {ray:?}");
            }
        }
    }
    let none = bvh.batch(&[]).all_hits();
    assert!(none.is_empty() && none.splits == [0] && none.hits.is_empty());
}

/// What is told before the end of a visit, and what the visit returns.
#[test]
fn visits_end_where_they_are_told_to() {
    let mut rng = Rng::new(91);
    let soup = mesh::soup(&mut rng, 300);
    let primitives = Primitives::new(&[geometry(&soup)]).expect("in range");
    let brute = Brute::new(&primitives);
    let bvh = Bvh::build(&primitives, &Recipe::default()).expect("a tree");
    let mut ends = 0;
    for ray in kernel_rays(&rays::around(&mut rng, &soup, 500)) {
        let all = brute.query(&ray).all_hits();
        assert_eq!(bvh.query(&ray).count_hits(), all.len());
        let last = rng.below(5);
        for end in [Visit::Accept, Visit::Stop] {
            let mut told = Vec::new();
            let mut decide = |hit: Hit| {
                told.push(hit);
                if told.len() > last {
                    end
                } else {
                    Visit::Reject
                }
            };
            let found = bvh.query(&ray).visit_hits(&mut decide);
            assert_eq!(
                bits(found),
                bits(brute.query(&ray).visit_hits({
                    let mut left = last + 1;
                    move |_| {
                        left -= 1;
                        if left == 0 { end } else { Visit::Reject }
                    }
                }))
            );
            let expected = &all[..all.len().min(last + 1)];
            assert_eq!(all_bits(&told), all_bits(expected));
            let is_found = end == Visit::Accept && all.len() > last;
            assert_eq!(
                bits(found),
                bits(expected.last().filter(|_| is_found).copied())
            );
            ends += usize::from(is_found);
        }
    }
    assert!(ends > 100, "{ends}");
}

/// Builders that split triangles put them into several leaves.
#[test]
fn a_triangle_in_many_leaves_is_told_once() {
    let mut rng = Rng::new(92);
    let mut large = square(0.0);
    // Small triangles in front of the large ones force splits.
    let small = mesh::soup(&mut rng, 400);
    let first = large.positions.len() as u32;
    large
        .positions
        .extend(small.positions.iter().map(|p| p.map(|x| 0.9 * x)));
    let moved = small
        .indices
        .iter()
        .map(|corners| corners.map(|i| i + first));
    large.indices.extend(moved);
    let primitives = Primitives::new(&[geometry(&large)]).expect("in range");
    let brute = Brute::new(&primitives);
    for builder in BUILDERS {
        let bvh = Bvh::build(&primitives, &Recipe::default().builder(builder)).expect("a tree");
        for _ in 0..300 {
            // Nearly in the plane of the square: through many leaves that hold it.
            let [x, y, z] = rng.point(1.0);
            let [a, b, c] = rng.point(1.0);
            let ray = Ray::between([x, y, 0.01 * z - 0.01], [a, b, 0.01 * c + 0.01]);
            let found = bvh.query(&ray).all_hits();
            assert_eq!(
                all_bits(&found),
                all_bits(&brute.query(&ray).all_hits()),
                "{builder}"
            );
        }
    }
}

/// Leaving out a triangle is the same as not having it.
#[test]
fn to_leave_out_a_triangle_is_to_remove_it() {
    let mut rng = Rng::new(93);
    let any = mesh::soup(&mut rng, 60);
    // A frame, so that nothing else changes with a triangle.
    let frame = Geometry::spheres(vec![Sphere {
        center: [0.0; 3],
        radius: 3.0,
    }]);
    let bvh = Bvh::build(&[geometry(&any), frame.clone()], &Recipe::default()).expect("in range");
    for prim_id in 0..any.indices.len() {
        let mut less = any.clone();
        // Two equal corners: the triangle is dropped, and all others keep their ids.
        less.indices[prim_id] = [any.indices[prim_id][0]; 3];
        let less = Primitives::new(&[geometry(&less), frame.clone()]).expect("in range");
        let less = Brute::new(&less);
        let id = PrimId {
            inst_id: INVALID_ID,
            geom_id: 0,
            prim_id: prim_id as u32,
        };
        let corners = any.indices[prim_id].map(|corner| any.positions[corner as usize]);
        for _ in 0..30 {
            // From the triangle to anywhere.
            let [a, b] = [rng.unit(), rng.unit()];
            let [a, b] = if a + b > 1.0 {
                [1.0 - a, 1.0 - b]
            } else {
                [a, b]
            };
            let from: [f32; 3] = core::array::from_fn(|axis| {
                let [p, q, r] = corners.map(|corner| corner[axis]);
                p + a * (q - p) + b * (r - p)
            });
            let ray = Ray::between(from, rng.point(1.5)).closed();
            assert_eq!(
                bvh.query(&ray).except(id).occluded(),
                less.occluded(&ray),
                "{ray:?}"
            );
            let found = bvh.query(&ray).except(id).intersect();
            assert_eq!(bits(found), bits(less.intersect(&ray)), "{ray:?}");
        }
    }
}

/// A ray through a sphere meets it where the interval begins to hold it, and leaves it out whole.
#[test]
fn spheres_are_told_once() {
    let spheres = vec![Sphere {
        center: [0.0; 3],
        radius: 1.0,
    }];
    let bvh = Bvh::build(&[Geometry::spheres(spheres)], &Recipe::default()).expect("in range");
    let along = |tnear| Ray {
        tnear,
        ..Ray::new([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    };
    for (tnear, t) in [
        (0.0, Some(2.0)),
        (3.0, Some(4.0)),
        (5.0, None),
        (-9.0, Some(2.0)),
    ] {
        let hits = bvh.query(&along(tnear)).all_hits();
        assert_eq!(hits.first().map(|hit| hit.t), t);
        assert_eq!(hits.len(), usize::from(t.is_some()));
    }
    let id = bvh.intersect(&along(0.0)).expect("a hit");
    assert!(!bvh.query(&along(3.0)).except(id).occluded());
    assert_eq!(bvh.query(&along(3.0)).except(id).intersect(), None);
}

/// What lies far behind the end of a visit is not looked at.
#[test]
fn a_visit_goes_no_farther_than_its_end() {
    #[derive(Debug, Default)]
    struct Asked(AtomicUsize);
    impl Opacity for Asked {
        fn opacity(&self, _: &Candidate) -> f32 {
            self.0.fetch_add(1, Ordering::Relaxed);
            1.0
        }
    }
    let filter = Arc::new(Asked::default());
    let panes: Vec<_> = (1..=400).map(|height| square(height as f32)).collect();
    let panes: Vec<_> = panes
        .iter()
        .map(|pane| cutouts(pane, filter.clone()))
        .collect();
    let bvh = Bvh::build(&panes, &Recipe::default()).expect("in range");
    let ray = Ray::new([0.3, 0.1, 0.0], [0.0, 0.0, 1.0]);
    for (visit, most) in [(Visit::Accept, 16), (Visit::Stop, 16), (Visit::Reject, 400)] {
        filter.0.store(0, Ordering::Relaxed);
        bvh.query(&ray).visit_hits(|_| visit);
        let asked = filter.0.load(Ordering::Relaxed);
        assert!(
            asked <= most && (asked == 400 || visit != Visit::Reject),
            "{visit:?}: {asked}"
        );
    }
}

/// Batches close the intervals of rays that are asked again, too.
#[test]
fn closed_batches_leave_out_primitives() {
    let panes = [square(1.0), square(2.0)];
    let bvh = Bvh::build(&panes.each_ref().map(geometry), &Recipe::default()).expect("in range");
    let ray = Ray {
        tnear: 1.0,
        tfar: 2.0,
        ..Ray::new([0.3, 0.1, 0.0], [0.0, 0.0, 1.0])
    };
    let rays = vec![ray; 100];
    let first = bvh.intersect(&ray.closed()).expect("a hit");
    let excluded = vec![PrimId::from(first); 100];
    let batch = bvh.batch(&rays).except(&excluded);
    let (mut occluded, mut hits) = (vec![false; 100], vec![None; 100]);
    for (batch, t) in [(batch, None), (batch.closed(), Some(2.0))] {
        batch.occluded_into(&mut occluded);
        batch.intersect_into(&mut hits);
        assert_eq!(occluded, vec![t.is_some(); 100]);
        assert!(hits.iter().all(|hit| hit.map(|hit| hit.t) == t), "{t:?}");
    }
}

/// The same triangle in another instance is another primitive.
#[test]
fn only_the_instance_named_is_left_out() {
    let triangle = Geometry::triangles(
        vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]],
        vec![[0, 1, 2]],
    );
    let at = |z: f32| {
        Instance::new(
            0,
            [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, z],
            ],
        )
    };
    let places = [at(1.0), at(2.0)];
    let row = Primitives::with_instances(&[], &[vec![triangle]], &places).expect("in range");
    let bvh = Bvh::build(&row, &Recipe::default()).expect("a tree");
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    let id = |inst_id| PrimId {
        inst_id,
        geom_id: 0,
        prim_id: 0,
    };
    let hit = |inst_id| {
        bvh.query(&ray)
            .except(id(inst_id))
            .intersect()
            .map(|hit| hit.inst_id)
    };
    assert_eq!(
        [hit(0), hit(1), hit(INVALID_ID)],
        [Some(1), Some(0), Some(0)]
    );
    let short = Ray { tfar: 1.5, ..ray };
    let occluded =
        [0, 1, INVALID_ID].map(|inst_id| bvh.query(&short).except(id(inst_id)).occluded());
    assert_eq!(occluded, [false, true, true]);
}

/// A visit may ask the tree again.
/// Thirty panes, which is several lists of hits, and enough rays that later ones begin with lists.
#[test]
fn rays_of_a_batch_visit_many_hits() {
    let panes: Vec<Mesh> = (0..30).map(|z| square(1.0 + z as f32)).collect();
    let geometry: Vec<_> = panes.iter().map(geometry).collect();
    let bvh = Bvh::build(&geometry, &Recipe::default()).expect("in range");
    let mut rng = Rng::new(9);
    // Half of the rays begin among the panes and look back as far.
    let rays: Vec<Ray> = (0..10_000)
        .map(|index| {
            let [x, y, _] = rng.point(1.2);
            let middle = 15.5 * (index % 2) as f32;
            Ray {
                tnear: -middle,
                ..Ray::new([x, y, middle], [0.0, 0.0, 1.0])
            }
        })
        .collect();
    let decide = |seen: &mut Vec<u32>, hit: Hit, last: usize| {
        seen.push(hit.geom_id);
        match (seen.len() >= last, last % 2) {
            (false, _) => Visit::Reject,
            (true, 0) => Visit::Accept,
            (true, _) => Visit::Stop,
        }
    };
    // Where each ray ends: before, in and behind the first list, or nowhere.
    let last = |index: usize| 1 + index % 41;
    let mut states: Vec<_> = (0..rays.len()).map(|index| (last(index), vec![])).collect();
    bvh.batch(&rays)
        .visit_hits(&mut states, |(last, seen), hit| decide(seen, hit, *last));
    let mut all = 0;
    for (index, (ray, (_, seen))) in rays.iter().zip(&states).enumerate() {
        let mut expected = Vec::new();
        bvh.query(ray)
            .visit_hits(|hit| decide(&mut expected, hit, last(index)));
        assert_eq!(seen, &expected, "ray {index}");
        all += usize::from(seen.len() == 30);
    }
    assert!(all > 500, "{all}");
}

#[test]
fn visits_may_be_nested() {
    let bvh = Bvh::build(&[geometry(&square(1.0))], &Recipe::default()).expect("in range");
    let ray = Ray::new([0.3, 0.1, 0.0], [0.0, 0.0, 1.0]);
    let found = bvh.query(&ray).visit_hits(|hit| {
        assert_eq!(bvh.query(&ray).all_hits(), [hit]);
        Visit::Accept
    });
    assert_eq!(found, bvh.intersect(&ray));
}

#[test]
#[should_panic(expected = "one primitive per ray")]
fn every_ray_of_a_batch_has_its_primitive() {
    let bvh = Bvh::build(&[geometry(&square(1.0))], &Recipe::default()).expect("in range");
    let _ = bvh.batch(&[Ray::default()]).except(&[]);
}
