//! Masks and functions that decide about hits: every tree against brute force, and brute force against what is known.

use std::cell::RefCell;
use std::sync::Arc;

use antumbra::{
    Brute, Bvh, Geometry, Hit, INVALID_ID, Instance, Masks, Object, PrimId, Primitives, Ray,
    RayOrder, RayQuery, Recipe, Surface, Visit, World,
};
use antumbra_testkit::{Rng, mesh};
use proptest::prelude::*;

use crate::instances::Scene;
use crate::support::{Stripes, bits, config, cutouts, for_every_tree, geometry, square};
use crate::transforms::translation;

/// Masks of which some bits are missing, for some of what there is.
fn masks(rng: &mut Rng, scene: &Scene) -> Masks {
    let mut list = |most: usize| -> Vec<u32> {
        let count = rng.below(most + 3);
        (0..count)
            .map(|_| [0, 1, 2, 3, u32::MAX][rng.below(5)])
            .collect()
    };
    let mut masks = Masks::default();
    masks.world = list(6);
    masks.objects = (0..scene.objects.len() + 1).map(|_| list(5)).collect();
    masks.instances = list(scene.instances.len());
    masks
}

/// A decision that depends on everything a hit has.
fn accepts(ray: usize, hit: &Hit) -> bool {
    let words = [
        ray as u32,
        hit.t.to_bits(),
        hit.u.to_bits(),
        hit.v.to_bits(),
        hit.prim_id,
        hit.geom_id,
        hit.inst_id,
    ];
    let mixed = words.iter().fold(7u32, |mixed, word| {
        (mixed ^ word).wrapping_mul(0x9e37_79b1).rotate_left(13)
    });
    !mixed.is_multiple_of(3)
}

/// What is asked of one ray.
#[derive(Clone, Copy)]
struct Asked {
    mask: Option<u32>,
    excluded: PrimId,
    closed: bool,
}

impl Asked {
    fn of(self, query: RayQuery<'_>) -> RayQuery<'_> {
        let query = query.except(self.excluded);
        let query = if self.closed { query.closed() } else { query };
        match self.mask {
            Some(mask) => query.mask(mask),
            None => query,
        }
    }
}

/// Every answer to a question about one ray.
#[derive(Debug, PartialEq)]
struct Answers {
    occluded: bool,
    occluded_if: bool,
    closest: Option<([u32; 3], [u32; 3])>,
    closest_if: Option<([u32; 3], [u32; 3])>,
    all: Vec<Option<([u32; 3], [u32; 3])>>,
    /// Primitives that are hit.
    ids: Vec<PrimId>,
    count: usize,
}

impl Answers {
    fn new(index: usize, query: RayQuery<'_>) -> Self {
        Self {
            occluded: query.occluded(),
            occluded_if: query.filter(&|hit| accepts(index, hit)).occluded(),
            closest: bits(query.intersect()),
            closest_if: bits(query.filter(&|hit| accepts(index, hit)).intersect()),
            all: query
                .all_hits()
                .into_iter()
                .map(|hit| bits(Some(hit)))
                .collect(),
            ids: query.all_hits().into_iter().map(PrimId::from).collect(),
            count: query.count_hits(),
        }
    }
}

/// A surface is the closest hit; its point is on the ray, and its normal is that of the hit.
fn check_surface(bvh: &Bvh, ray: &Ray, surface: Option<&Surface>, answers: &Answers) {
    assert_eq!(bits(surface.map(|surface| surface.hit)), answers.closest);
    let Some(Surface {
        hit,
        position,
        normal,
        ..
    }) = surface
    else {
        return;
    };
    // On the diagonal of a quad, where its halves meet, `normal` knows the place alone.
    let is_on_diagonal = (hit.u - hit.v).abs() < 1e-5 || (hit.u + hit.v - 1.0).abs() < 1e-5;
    let expected = bvh.normal(ray, hit).unwrap_or_default();
    assert!(
        expected == *normal || is_on_diagonal,
        "{hit:?}: {normal:?}, not {expected:?}"
    );
    // Transforms may be nearly singular.
    let tolerance = if hit.inst_id == INVALID_ID {
        2e-5
    } else {
        2e-3
    };
    let size = ray
        .org
        .iter()
        .chain(position)
        .filter(|x| x.is_finite())
        .fold(1e-3, |size: f32, x| size.max(x.abs()));
    for (axis, found) in position.iter().enumerate() {
        let along = f64::from(ray.org[axis]) + f64::from(hit.t) * f64::from(ray.dir[axis]);
        // Functions of users find hits anywhere.
        if along.abs() > f64::from(f32::MAX) {
            assert!(
                found.abs() > 0.9 * f32::MAX,
                "{found} on {axis}: {hit:?}, {ray:?}"
            );
            continue;
        }
        let apart = (f64::from(*found) - along).abs();
        assert!(
            apart < tolerance * f64::from(size),
            "{apart} on {axis}: {hit:?}, {ray:?}"
        );
    }
}

proptest! {
    #![proptest_config(config(3))]

    /// Scenes with all kinds of geometry, instances, masks, exclusions and functions, one by one and in batches.
    #[test]
    fn every_tree_equals_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        let scene = Scene::new(&mut rng, 50, 12);
        let stripes = Arc::new(Stripes { count: 3.0 });
        let mut world = scene.ground();
        world.extend(scene.world.iter().map(|mesh| cutouts(mesh, stripes.clone())));
        let mut objects = scene.object_lists();
        for (list, mesh) in objects.iter_mut().zip(&scene.objects) {
            list.push(cutouts(mesh, stripes.clone()));
        }
        let primitives = Primitives::with_instances(&world, &objects, &scene.instances).expect("in range");
        let masks = masks(&mut rng, &scene);
        let rays = scene.rays(&mut rng, 60);
        let mut brute = Brute::new(&primitives);
        brute.set_masks(masks.clone());
        let closed = rng.below(2) == 0;
        let asked: Vec<_> = rays.iter().map(|ray| {
            let hits = brute.query(ray).all_hits();
            let excluded = match rng.below(3) {
                0 if !hits.is_empty() => PrimId::from(hits[rng.below(hits.len())]),
                _ => PrimId::NONE,
            };
            let mask = [0, 1, 2, 3, u32::MAX][rng.below(5)];
            Asked { mask: Some(mask), excluded, closed }
        }).collect();
        let plain = rays.iter().map(|_| Asked { mask: None, excluded: PrimId::NONE, closed });
        let of_brute = |asked: &[Asked]| -> Vec<_> {
            let rays = rays.iter().zip(asked).enumerate();
            rays.map(|(index, (ray, asked))| Answers::new(index, asked.of(brute.query(ray)))).collect()
        };
        let plain: Vec<_> = plain.collect();
        let [all, none] = [&asked, &plain].map(|asked| of_brute(asked));
        // Surfaces of the first tree, which all others have.
        let surfaces = RefCell::new([None, None]);
        for_every_tree(&primitives, &rays, |bvh, tree| {
            let mut bvh = bvh.clone();
            bvh.set_masks(masks.clone());
            let place = |index: usize| format!("seed {seed}, {tree}, ray {index}: {:?}", rays[index]);
            for (turn, (asked, answers)) in [(&asked, &all), (&plain, &none)].into_iter().enumerate() {
                for (index, ray) in rays.iter().enumerate() {
                    let found = Answers::new(index, asked[index].of(bvh.query(ray)));
                    assert_eq!(found, answers[index], "{}", place(index));
                }
                let ray_masks: Vec<_> = asked.iter().map(|asked| asked.mask.unwrap_or(0)).collect();
                let excluded: Vec<_> = asked.iter().map(|asked| asked.excluded).collect();
                let batch = bvh.batch(&rays);
                let batch = if closed { batch.closed() } else { batch };
                let batch = match asked[0].mask {
                    Some(_) => batch.masks(&ray_masks).except(&excluded),
                    None => batch,
                };
                let mut flags = [(); 2].map(|()| vec![false; rays.len()]);
                let mut hits = [(); 2].map(|()| vec![None; rays.len()]);
                let mut words = vec![0; rays.len().div_ceil(64)];
                batch.occluded_into(&mut flags[0]);
                let filtered = batch.filter(&accepts);
                filtered.order(RayOrder::Sorted).occluded_into(&mut flags[1]);
                batch.on_this_thread().intersect_into(&mut hits[0]);
                filtered.intersect_into(&mut hits[1]);
                let counts = batch.count_hits();
                batch.occluded_bits_into(&mut words);
                let lists = batch.all_hits();
                let mut visited = vec![Vec::new(); rays.len()];
                batch.visit_hits(&mut visited, |hits, hit| {
                    hits.push(bits(Some(hit)));
                    // Rays end at different hits.
                    match (hits.len(), hit.prim_id % 7) {
                        (3.., 0) => Visit::Stop,
                        (3.., 1) => Visit::Accept,
                        _ => Visit::Reject,
                    }
                });
                let found = batch.surfaces();
                assert_eq!(batch.order(RayOrder::Sorted).surfaces(), found, "{tree}");
                let occluders = [batch.occluders(), batch.on_this_thread().order(RayOrder::Sorted).occluders()];
                for (index, answers) in answers.iter().enumerate() {
                    let is_end = |at: usize| at >= 2 && answers.ids[at].prim_id % 7 < 2;
                    let ends = (0..answers.all.len()).find(|&at| is_end(at));
                    let told = ends.map_or(answers.all.len(), |at| at + 1);
                    assert_eq!(visited[index], answers.all[..told], "{}", place(index));
                    let ray = if closed { rays[index].closed() } else { rays[index] };
                    check_surface(&bvh, &ray, found[index].as_ref(), answers);
                    for occluder in [occluders[0][index], occluders[1][index], asked[index].of(bvh.query(&rays[index])).occluder()] {
                        assert_eq!(occluder.is_some(), answers.occluded, "{}", place(index));
                        let is_met = |id| answers.ids.contains(&id);
                        assert!(occluder.is_none_or(is_met), "{occluder:?}, {}", place(index));
                    }
                }
                if turn == 1 && !closed {
                    for index in [0, 17, 59] {
                        assert_eq!(bvh.surface(&rays[index]), found[index], "{}", place(index));
                        let few = bvh.batch(&rays[index..index + 1]).surfaces();
                        assert_eq!(few, [found[index]], "{}", place(index));
                    }
                }
                let mut first = surfaces.borrow_mut();
                let expected = first[turn].get_or_insert_with(|| found.clone());
                assert_eq!(&found, expected, "{tree}");
                for (index, answers) in answers.iter().enumerate() {
                    let found = Answers {
                        occluded: flags[0][index],
                        occluded_if: flags[1][index],
                        closest: bits(hits[0][index]),
                        closest_if: bits(hits[1][index]),
                        all: lists.of(index).iter().map(|hit| bits(Some(*hit))).collect(),
                        ids: lists.of(index).iter().map(PrimId::from).collect(),
                        count: counts[index] as usize,
                    };
                    assert_eq!(&found, answers, "batch, {}", place(index));
                    assert_eq!(words[index / 64] >> (index % 64) & 1 == 1, answers.occluded);
                }
            }
        });
    }
}

/// Hiding a geometry is as good as not having it.
#[test]
fn what_is_hidden_is_not_there() {
    let mut rng = Rng::new(61);
    let meshes = [0, 1, 2, 3].map(|_| mesh::soup(&mut rng, 40));
    let all = Bvh::build(&meshes.each_ref().map(geometry), &Recipe::default());
    let mut all = all.expect("in range");
    all.set_masks(Masks::new().world(vec![1, 2, 4, 8]));
    for mask in [0b0000, 0b0101, 0b1110, 0b1111] {
        let seen: Vec<_> = (0..4)
            .map(|index| match mask >> index & 1 {
                1 => geometry(&meshes[index]),
                // The same numbers, and nothing in it.
                _ => Geometry::spheres(vec![]),
            })
            .collect();
        let less = Brute::new(&Primitives::new(&seen).expect("in range"));
        for _ in 0..500 {
            let ray = Ray::between(rng.point(1.5), rng.point(1.5));
            let query = all.query(&ray).mask(mask);
            assert_eq!(query.occluded(), less.occluded(&ray), "{mask:b}");
            assert_eq!(query.all_hits().len(), less.query(&ray).all_hits().len());
            assert_eq!(
                query.intersect().map(PrimId::from),
                less.intersect(&ray).map(PrimId::from)
            );
        }
    }
    // Plain queries see everything, and so do masks that nobody else has.
    let ray = Ray::new([0.3, 0.1, 0.0], [0.0, 0.0, 1.0]);
    let mut bvh = Bvh::build(&[geometry(&square(1.0))], &Recipe::default()).expect("in range");
    assert!(bvh.query(&ray).mask(1 << 31).occluded() && !bvh.query(&ray).mask(0).occluded());
    assert_eq!(bvh.query(&ray).mask(0).intersect(), None);
    bvh.set_masks(Masks::new().world(vec![0]));
    assert!(bvh.occluded(&ray) && !bvh.query(&ray).mask(u32::MAX).occluded());
}

/// Masks go by numbers, also when the instances of a world change.
#[test]
fn masks_of_a_world_stay() {
    let object = |height: f32| {
        let mesh = square(height);
        Object::build(&[geometry(&mesh)], &Recipe::default()).expect("in range")
    };
    let objects = [object(1.0), object(2.0)];
    let place = |object: u32, x: f32| Instance::new(object, translation([x, 0.0, 0.0]));
    let mut world =
        World::on_ground(object(3.0), &objects, &[place(0, 0.0), place(1, 0.0)]).expect("in range");
    let masks = Masks::new()
        .world(vec![0b001])
        .objects(vec![vec![0b010], vec![0b100]])
        .instances(vec![u32::MAX, u32::MAX, 0b1000]);
    world.set_masks(masks);
    let ray = Ray::new([0.3, 0.1, 0.0], [0.0, 0.0, 1.0]);
    let seen = |world: &World, mask: u32| {
        let hits = world.query(&ray).mask(mask).all_hits();
        hits.iter().map(|hit| hit.inst_id).collect::<Vec<_>>()
    };
    assert_eq!(seen(&world, 0b001), [INVALID_ID]);
    assert_eq!(seen(&world, 0b110), [0, 1]);
    world
        .set_instances(&[place(1, 0.0), place(0, 9.0), place(0, 0.0)])
        .expect("in range");
    assert_eq!(seen(&world, 0b100), [0]);
    assert_eq!(
        seen(&world, 0b010),
        [0u32; 0],
        "it has moved, and the third has another mask"
    );
    let asked = |mask: u32| {
        let query = world.query(&ray).mask(mask);
        (query.occluded(), query.intersect().map(|hit| hit.inst_id))
    };
    assert_eq!([asked(0b010), asked(0b1000)], [(false, None); 2]);
    assert_eq!(asked(0b1010), (true, Some(2)));
    assert_eq!(asked(0b101), (true, Some(0)));
    assert_eq!(seen(&world, 0b1010), [2]);
    assert_eq!(seen(&world, 0b111), [0, INVALID_ID]);
}

/// A function hears of hits as a visit tells of them, and of nothing that does not count.
#[test]
fn functions_hear_of_hits() {
    let panes = [1.0, 2.0, 3.0, 4.0].map(square);
    let mut bvh =
        Bvh::build(&panes.each_ref().map(geometry), &Recipe::default()).expect("in range");
    bvh.set_masks(Masks::new().world(vec![1, 2, 1, 1]));
    let ray = Ray {
        tfar: 3.5,
        ..Ray::new([0.3, 0.1, 0.0], [0.0, 0.0, 1.0])
    };
    let heard = RefCell::new(Vec::new());
    let query = bvh.query(&ray).mask(1);
    let found = query
        .filter(&|hit| {
            heard.borrow_mut().push((hit.t, hit.geom_id));
            false
        })
        .intersect();
    assert_eq!(found, None);
    let mut heard = heard.into_inner();
    heard.dedup();
    assert_eq!(heard, [(1.0, 0), (3.0, 2)]);
    let heard = RefCell::new(Vec::new());
    assert!(
        !query
            .filter(&|hit| {
                heard.borrow_mut().push(hit.geom_id);
                false
            })
            .occluded()
    );
    let mut heard = heard.into_inner();
    heard.sort_unstable();
    assert_eq!(heard, [0, 2]);
    assert!(bvh.query(&ray).filter(&|hit| hit.geom_id == 1).occluded());
    assert!(
        !bvh.query(&ray).filter(&|hit| hit.geom_id == 3).occluded(),
        "behind the end"
    );
    let second = bvh.query(&ray).filter(&|hit| hit.t > 1.0).intersect();
    assert_eq!(second.map(|hit| hit.geom_id), Some(1));
}

#[test]
#[should_panic(expected = "one mask per ray")]
fn every_ray_of_a_batch_has_its_mask() {
    let bvh = Bvh::build(&[geometry(&square(1.0))], &Recipe::default()).expect("in range");
    let _ = bvh.batch(&[Ray::default()]).masks(&[]);
}
