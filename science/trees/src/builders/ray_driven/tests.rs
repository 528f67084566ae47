//! Counts against counting; costs against the models they come from.

use crate::builders::ray_driven::rdh::RdhCost;
use crate::builders::ray_driven::seen::Seen;
use crate::builders::ray_driven::srdh::SrdhCost;
use crate::builders::ray_driven::*;
use crate::test_primitives::primitives;
use antumbra::parts::{RaySetup, SplitCost as Cost, surface_rays};
use antumbra::recipe::Builder;
use antumbra::shapes::Sphere;
use antumbra::{Brute, Geometry, Instance, Ray};
use antumbra_testkit::{Mesh, Rng, mesh};

/// Everything a side of a split is said to have is counted again, ray by ray and primitive by primitive.
#[test]
fn sides_are_counted_exactly() {
    let seed = 71;
    let mut rng = Rng::new(seed);
    for size in [9, 30, 300] {
        let mesh = mesh::soup(&mut rng, size);
        let primitives = primitives(&mesh, 5, &mut rng);
        let rays = surface_rays(&primitives, 200, 3);
        let all = Levels::followed(&primitives, &rays);
        let evidence = &all.world;
        assert!(evidence.rays.len() == 200 && !evidence.hits.is_empty());
        let plan = Plan {
            primitives: &primitives,
            evidence,
            cost: &RdhCost::default(),
        };
        // Every second primitive, as if the others had been split off.
        let prims: Vec<u32> = (0..primitives.len() as u32).step_by(2).collect();
        let boxes: Vec<_> = prims
            .iter()
            .map(|prim| primitives.bounds_of(*prim as usize))
            .collect();
        let hits = evidence.hits.iter().copied().filter(|hit| hit.1 % 2 == 0);
        let node = Node {
            prims: prims.clone(),
            rays: (0..200).collect(),
            hits: hits.collect(),
            depth: 0,
        };
        let places: Vec<_> = node
            .hits
            .iter()
            .map(|hit| (hit.0, hit.1 as usize / 2))
            .collect();
        for axis in 0..3 {
            let candidates = Candidates::new(&boxes, axis).expect("splits");
            let sides = plan.sides(&node, &candidates, &places);
            for split in candidates.splits() {
                for side in 0..2 {
                    let here =
                        |place: usize| (usize::from(candidates.bins[place]) < split) == (side == 0);
                    let inside = || (0..prims.len()).filter(|place| here(*place));
                    let bounds = inside().fold(Aabb::EMPTY, |all, place| all.union(&boxes[place]));
                    let entered = evidence.rays.iter().filter(|ray| ray.hits_box(&bounds));
                    let hits = (0..200).filter(|ray| {
                        let mut hits = places.iter();
                        hits.any(|hit| hit.0 == *ray && here(hit.1))
                    });
                    let until_hit: f64 = (0..200)
                        .map(|ray| {
                            places
                                .iter()
                                .filter(|hit| hit.0 == ray && here(hit.1))
                                .count()
                        })
                        .filter(|count| *count > 0)
                        .map(|count| 1.0 / (1 + count) as f64)
                        .sum();
                    let mut found = sides[split][side];
                    assert!((found.until_hit - until_hit).abs() < 1e-9);
                    found.until_hit = 0.0;
                    let expected = Measure {
                        area: area(&bounds),
                        prims: inside().count(),
                        entered: entered.count(),
                        hits: hits.count(),
                        until_hit: 0.0,
                    };
                    let place = format!("seed {seed} size {size} axis {axis} split {split}");
                    assert_eq!(found, expected, "{place} side {side}");
                }
            }
        }
    }
}

/// Rays of all directions through the middle.
fn rays_between(rng: &mut Rng, count: usize) -> Vec<Ray> {
    (0..count)
        .map(|_| Ray::between(rng.point(2.0), rng.point(2.0)))
        .collect()
}

/// Brute force over each triangle of a mesh by itself, where it is or where an instance places it.
fn one_by_one(mesh: &Mesh, placed: Option<Instance>) -> Vec<Brute> {
    let alone = mesh.indices.iter().map(|corners| {
        let geometry = [Geometry::triangles(&mesh.positions[..], vec![*corners])];
        let primitives = match &placed {
            None => Primitives::new(&geometry),
            Some(instance) => {
                Primitives::with_instances(&[], &[geometry], core::slice::from_ref(instance))
            }
        };
        Brute::new(&primitives.expect("indices in range"))
    });
    alone.collect()
}

/// What each of these rays hits; rays that hit nothing are left out.
fn hits_of(brute: &[Brute], rays: &[Ray]) -> Vec<Vec<u32>> {
    let hits = rays.iter().map(|ray| {
        let prims = 0..brute.len() as u32;
        prims
            .filter(|prim| brute[*prim as usize].occluded(ray))
            .collect::<Vec<_>>()
    });
    hits.filter(|hits| !hits.is_empty()).collect()
}

/// A ray has every primitive that it hits, in the world and in the object of every instance that it enters.
#[test]
fn evidence_is_that_of_brute_force() {
    let seed = 76;
    let mut rng = Rng::new(seed);
    let [object, world] = [(); 2].map(|()| mesh::soup(&mut rng, 60));
    let instances: Vec<_> = (0..10)
        .map(|_| {
            let transform = std::array::from_fn(|_| std::array::from_fn(|_| rng.range(-1.0, 1.0)));
            Instance::new(0, transform)
        })
        .collect();
    let [of_object, of_world] =
        [&object, &world].map(|mesh| [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])]);
    let primitives =
        Primitives::with_instances(&of_world, &[of_object], &instances).expect("indices in range");
    let rays = rays_between(&mut rng, 2000);
    let all = Levels::followed(&primitives, &rays);
    assert_eq!(all.world.rays.len(), rays.len());
    let entered = all.objects[0].rays.len();
    assert!(entered > 100 && entered < rays.len() * instances.len());

    let in_world = hits_of(&one_by_one(&world, None), &rays);
    let in_instances = instances
        .iter()
        .flat_map(|instance| hits_of(&one_by_one(&object, Some(instance.clone())), &rays))
        .collect();
    // Sorted, for the trees do not matter, and in which order they are entered.
    for (evidence, mut expected) in [(&all.world, in_world), (&all.objects[0], in_instances)] {
        let mut found: Vec<Vec<u32>> = evidence
            .hits
            .chunk_by(|a, b| a.0 == b.0)
            .map(|hits| hits.iter().map(|hit| hit.1).collect())
            .collect();
        found.iter_mut().for_each(|hits| hits.sort());
        found.sort();
        expected.sort();
        assert_eq!(found, expected);
        assert!(found.len() > 20);
    }
}

fn random_measure(rng: &mut Rng, parent: &Measure) -> Measure {
    let entered = rng.below(parent.entered + 1);
    let hits = rng.below(entered + 1);
    Measure {
        area: parent.area * f64::from(rng.unit()),
        prims: 1 + rng.below(parent.prims),
        entered,
        hits,
        until_hit: 0.5 * f64::from(rng.unit()) * hits as f64,
    }
}

const PARENT: Measure = Measure {
    area: 8.0,
    prims: 100,
    entered: 800,
    hits: 700,
    until_hit: 0.0,
};

/// Rays that enter boxes by their areas make RDH the surface area heuristic.
#[test]
fn evidence_by_area_gives_the_surface_area_heuristic() {
    let mut rng = Rng::new(72);
    let cost = Cost::default();
    for _ in 0..1000 {
        let sides = [(); 2].map(|()| {
            let eighths = rng.below(9);
            Measure {
                area: eighths as f64,
                entered: 100 * eighths,
                ..random_measure(&mut rng, &PARENT)
            }
        });
        let expected: f64 = sides
            .iter()
            .map(|side| side.area / PARENT.area * f64::from(cost.weight_of(side.prims)))
            .sum();
        let [left, right] = sides;
        let found = RdhCost::default().of(&PARENT, &left, &right);
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
}

/// Rays made ready for a tree, whose primitives do not matter.
fn ready(rays: &[Ray]) -> Vec<RaySetup> {
    let mut all = Vec::new();
    let primitives = Primitives::new(&[Geometry::spheres(vec![Sphere {
        center: [0.0; 3],
        radius: 1.0,
    }])]);
    let primitives = primitives.expect("a sphere");
    // So many at a time that all are used.
    for rays in rays.chunks(1 << 14) {
        all.extend(Levels::followed(&primitives, rays).world.rays);
    }
    all
}

/// Lines in all directions, equally many everywhere, enter boxes by their areas: RDH comes to what the surface area
/// heuristic assumes.
#[test]
fn uniform_rays_enter_boxes_by_area() {
    let seed = 73;
    let mut rng = Rng::new(seed);
    let parent = Aabb {
        min: [-0.5, -0.4, -0.3],
        max: [0.5, 0.4, 0.3],
    };
    // Chords between uniform points of a sphere around the box are such lines.
    let rays: Vec<_> = (0..40_000)
        .map(|_| Ray::between(rng.direction(), rng.direction()))
        .collect();
    let rays: Vec<_> = ready(&rays)
        .into_iter()
        .filter(|ray| ray.hits_box(&parent))
        .collect();
    let measure = |bounds: &Aabb| Measure {
        area: area(bounds),
        entered: rays.iter().filter(|ray| ray.hits_box(bounds)).count(),
        ..PARENT
    };
    let whole = measure(&parent);
    for _ in 0..50 {
        let mut child = parent;
        for axis in 0..3 {
            let [a, b] = [(); 2].map(|()| rng.range(parent.min[axis], parent.max[axis]));
            (child.min[axis], child.max[axis]) = (a.min(b), a.max(b));
        }
        let found = crate::builders::ray_driven::rdh::chance(&measure(&child), &whole);
        let expected = measure(&child).area_share(&whole);
        // Four standard errors of 10,000 rays or more.
        assert!(
            (found - expected).abs() < 0.02,
            "seed {seed}: {found} {expected}"
        );
    }
}

/// The cost of SRDH is equation (1) of Ogaki and Derouet-Jourdan for two children, in the better order, which is the
/// order of appendix A.
#[test]
fn srdh_is_the_model_for_two_children() {
    use antumbra::parts::{ChildCost, cost_any};
    let mut rng = Rng::new(74);
    let srdh = SrdhCost::default();
    for _ in 0..1000 {
        let sides = [(); 2].map(|()| random_measure(&mut rng, &PARENT));
        let [left, right] = sides.map(|side| {
            let child = srdh.child(&PARENT, &side);
            ChildCost {
                enter: child.enter,
                hit: child.hit,
                cost: child.cost,
            }
        });
        let orders = [cost_any(0.0, [left, right]), cost_any(0.0, [right, left])];
        let found = srdh.of(&PARENT, &sides[0], &sides[1]);
        assert!((found - orders[0].min(orders[1])).abs() < 1e-12);
        if (orders[0] - orders[1]).abs() > 1e-9 {
            let right_first = srdh.right_first(&PARENT, &sides[0], &sides[1]);
            assert_eq!(right_first, orders[1] < orders[0]);
            assert_eq!(right_first, right.key() > left.key());
        }
    }
}

/// The cost is the mean work of rays drawn from the model.
#[test]
fn srdh_predicts_the_work_of_rays_drawn_from_its_model() {
    let seed = 75;
    let mut rng = Rng::new(seed);
    let parent = Measure {
        entered: 1 << 30,
        ..PARENT
    };
    for _ in 0..10 {
        let sides = [(); 2].map(|()| random_measure(&mut rng, &parent));
        let chances = sides.map(|side| {
            let share = |count: usize| (count as f64 / parent.entered as f64) as f32;
            (share(side.entered), share(side.hits))
        });
        let srdh = SrdhCost::default();
        let weights = sides.map(|side| srdh.child(&parent, &side).cost);
        let first = usize::from(srdh.right_first(&parent, &sides[0], &sides[1]));
        let mut work = 0.0;
        const RAYS: usize = 100_000;
        for _ in 0..RAYS {
            for side in [first, 1 - first] {
                let (enter, hit) = chances[side];
                if rng.unit() < enter {
                    work += weights[side];
                }
                if rng.unit() < hit {
                    break;
                }
            }
        }
        let predicted = srdh.of(&parent, &sides[0], &sides[1]);
        let found = work / RAYS as f64;
        // Six standard errors.
        let error = 6.0 * (weights[0] + weights[1]) / (RAYS as f64).sqrt();
        assert!(
            (found - predicted).abs() < error,
            "seed {seed}: {found} {predicted}"
        );
    }
}

/// What is seen is the nearest on some ray, by brute force, in the world and in objects.
#[test]
fn seen_is_what_is_nearest() {
    let mut rng = Rng::new(77);
    let [object, world] = [(); 2].map(|()| mesh::soup(&mut rng, 200));
    let [object, world] =
        [&object, &world].map(|mesh| [Geometry::triangles(&mesh.positions[..], &mesh.indices[..])]);
    let here =
        std::array::from_fn(|row| std::array::from_fn(|column| f32::from(u8::from(row == column))));
    let levels = [&world, &object].map(|list| Primitives::new(list).expect("indices in range"));
    let primitives = Primitives::with_instances(&world, &[object], &[Instance::new(0, here)])
        .expect("indices in range");
    let rays = rays_between(&mut rng, 300);
    let tree = BinaryTree::build(&primitives, Builder::BinnedSah);
    let mut seen = Seen::none(&primitives);
    seen.follow(&primitives, &tree, &rays);
    for (level, seen) in levels.iter().zip([&seen.world, &seen.objects[0]]) {
        let brute = Brute::new(level);
        let mut expected = vec![false; level.len()];
        for hit in rays.iter().filter_map(|ray| brute.intersect(ray)) {
            expected[hit.prim_id as usize] = true;
        }
        assert_eq!(seen, &expected);
        let count = seen.iter().filter(|seen| **seen).count();
        assert!(count > 20 && count < level.len(), "{count}");
    }
}

/// The split that VDBVH makes costs what the formula says of its two sides, and no other candidate costs less.
#[test]
fn vdbvh_makes_the_split_of_least_cost() {
    let mut rng = Rng::new(78);
    let cost = Cost::default();
    for weight in [0.0, 0.5, 0.9, 1.0] {
        let mesh = mesh::soup(&mut rng, 400);
        let primitives = primitives(&mesh, 5, &mut rng);
        let seen: Vec<_> = (0..primitives.len()).map(|_| rng.below(4) == 0).collect();
        let prims: Vec<u32> = (0..primitives.len() as u32).collect();
        let boxes: Vec<_> = prims
            .iter()
            .map(|prim| primitives.bounds_of(*prim as usize))
            .collect();
        let union = |on: &dyn Fn(usize) -> bool| {
            let boxes = boxes.iter().enumerate().filter(|one| on(one.0));
            boxes.fold(Aabb::EMPTY, |all, one| all.union(one.1))
        };
        let whole = area(&union(&|_| true));
        let visible = seen.iter().filter(|seen| **seen).count() as f64;
        let of = |is_left: &dyn Fn(usize) -> bool| -> f64 {
            let side = |on: &dyn Fn(usize) -> bool| {
                let inside: Vec<_> = (0..boxes.len()).filter(|prim| on(*prim)).collect();
                let seen = inside.iter().filter(|prim| seen[**prim]).count() as f64;
                let chance = weight * seen / visible + (1.0 - weight) * area(&union(on)) / whole;
                chance * f64::from(cost.weight_of(inside.len()))
            };
            side(is_left) + side(&|prim| !is_left(prim))
        };
        let split = vdbvh::split_of(&primitives, &prims, &seen, weight).expect("a split");
        assert!((split.cost - of(&|prim| split.is_left[prim])).abs() < 1e-9);
        for axis in 0..3 {
            let candidates = Candidates::new(&boxes, axis).expect("splits");
            for place in candidates.splits() {
                let found = of(&|prim| usize::from(candidates.bins[prim]) < place);
                assert!(split.cost <= found + 1e-9, "weight {weight} axis {axis}");
            }
        }
    }
}
