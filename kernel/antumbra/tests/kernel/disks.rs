//! Disks: every tree against brute force, and brute force against what is known on paper.

use std::sync::Arc;

use antumbra::shapes::{Disk, DropReason, Dropped, Sphere};
use antumbra::{
    Brute, Bvh, Error, Geometry, Hit, Instance, Masks, Object, PrimId, Primitives, Ray, Recipe,
    World,
};
use antumbra_testkit::{Rng, mesh, rays};
use proptest::prelude::*;

use crate::support::{
    Odd, Stripes, bits, config, cutouts, equals_brute, equals_brute_by_builders, for_every_tree,
    geometry, kernel_rays,
};
use crate::transforms::{IDENTITY, scale, transform, translation};

/// Disks around the origin: turned any way or along an axis, large and small, some that coincide, a few unsound.
fn disks(rng: &mut Rng, count: usize) -> Vec<Disk> {
    let mut disks: Vec<Disk> = Vec::new();
    for _ in 0..count {
        let mut disk = Disk {
            center: rng.point(1.0),
            normal: rng.direction().map(|x| 3.0 * x),
            radius: 0.01 + 0.4 * rng.unit(),
        };
        match rng.below(14) {
            0 => disk.normal = [[1.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 1e-30]][rng.below(3)],
            1 => disk.radius = 1e-6,
            2 => disk.radius = 20.0,
            3 => disk.normal = [0.0; 3],
            4 => disk.radius = [0.0, -1.0, f32::NAN, f32::INFINITY][rng.below(4)],
            5 => disk.center[rng.below(3)] = f32::NAN,
            6 => disk.normal[rng.below(3)] = f32::NEG_INFINITY,
            7 => disk = disks.last().copied().unwrap_or(disk),
            _ => {}
        }
        disks.push(disk);
    }
    disks
}

/// Rays around the disks, some of them through their centres, along their planes and from their surfaces.
fn rays_around(rng: &mut Rng, disks: &[Disk], count: usize) -> Vec<Ray> {
    let soup = mesh::soup(rng, 30);
    let mut rays = kernel_rays(&rays::around(rng, &soup, count));
    for disk in disks
        .iter()
        .filter(|disk| disk.center.iter().all(|x| x.is_finite()))
    {
        let from = rng.point(2.0);
        rays.push(Ray::between(from, disk.center));
        rays.push(Ray::new(
            from,
            core::array::from_fn(|axis| disk.center[axis] - from[axis]),
        ));
        rays.push(Ray::new(disk.center, rng.direction()));
        let [x, y, z] = disk.normal;
        rays.push(Ray::new(disk.center, [y - z, z - x, x - y]));
    }
    rays
}

proptest! {
    #![proptest_config(config(4))]

    /// Among primitives of every other kind, in the world and in instances of any transform, by every query.
    #[test]
    fn every_tree_equals_brute_force(seed: u64) {
        let mut rng = Rng::new(seed);
        let size = 1 + rng.below(60);
        let flat = disks(&mut rng, size);
        let any = mesh::soup(&mut rng, 20);
        let spheres: Vec<_> = (0..5).map(|_| Sphere { center: rng.point(1.0), radius: 0.2 }).collect();
        let world = [
            Geometry::disks(&flat[..]),
            geometry(&any),
            Geometry::spheres(&spheres[..]),
            Odd::new(&mut rng, 5).geometry(),
            cutouts(&any, Arc::new(Stripes { count: 3.0 })),
        ];
        let object = [Geometry::spheres(&spheres[..]), Geometry::disks(&flat[..])];
        let instances: Vec<_> = (0..rng.below(4))
            .map(|_| Instance::new(0, transform(&mut rng)))
            .collect();
        let world = &world[..1 + rng.below(5)];
        let primitives = Primitives::with_instances(world, &[object], &instances).expect("in range");
        let rays = rays_around(&mut rng, &flat, 60);
        equals_brute(&format!("seed {seed}"), &primitives, &rays);
        let brute = Brute::new(&primitives);
        let points: Vec<_> = (0..4).map(|_| rng.point(1.5)).collect();
        for_every_tree(&primitives, &[], |bvh, tree| {
            let place = format!("seed {seed}, {tree}");
            for ray in rays.iter().step_by(7) {
                let Some(hit) = brute.intersect(ray) else { continue };
                let id = PrimId::from(hit);
                assert_eq!(bvh.query(ray).except(id).occluded(), brute.query(ray).except(id).occluded(), "{place}");
                let except = brute.query(ray).except(id).intersect();
                assert_eq!(bits(bvh.query(ray).except(id).intersect()), bits(except), "{place}");
                assert!(!bvh.query(ray).filter(&|_| false).occluded(), "{place}");
                let is_flat = |hit: &Hit| hit.geom_id == 0;
                let expected = brute.query(ray).filter(&is_flat).intersect();
                assert_eq!(bits(bvh.query(ray).filter(&is_flat).intersect()), bits(expected), "{place}");
                assert_eq!(bvh.query(ray).filter(&is_flat).occluded(), expected.is_some(), "{place}");
            }
            for &point in &points {
                let near = brute.closest(point, f32::INFINITY);
                assert_eq!(bvh.closest(point, f32::INFINITY), near, "{place}");
                assert_eq!(bvh.within(point, 0.5), brute.within(point, 0.5), "{place}");
                assert_eq!(bvh.winding_number(point), brute.winding_number(point), "{place}");
            }
        });
    }

    /// By every builder and collapse; in files; after a refit.
    #[test]
    fn builders_files_and_refits(seed: u64) {
        let mut rng = Rng::new(seed);
        let flat = disks(&mut rng, 40);
        let before = [Geometry::disks(&flat[..])];
        let primitives = Primitives::new(&before).expect("in range");
        let rays = rays_around(&mut rng, &flat, 60);
        equals_brute_by_builders(&format!("seed {seed}"), &primitives, &rays);

        let mut bvh = Bvh::build(&before, &Recipe::default()).expect("in range");
        let bytes = bvh.to_bytes();
        let read = Bvh::from_bytes(&bytes).expect("a file of ours");
        prop_assert_eq!(&read.to_bytes(), &bytes);

        let moved: Vec<_> = flat
            .iter()
            .map(|disk| Disk { center: disk.center.map(|x| 3.0 * x), radius: 2.0 * disk.radius, ..*disk })
            .collect();
        let after = [Geometry::disks(&moved[..])];
        bvh.refit(&after).expect("as sound as before");
        bvh.validate().expect("a refit keeps all promises");
        let again = Brute::new(&Primitives::new(&after).expect("in range"));
        let first = Brute::new(&primitives);
        for ray in &rays {
            prop_assert_eq!(bits(read.intersect(ray)), bits(first.intersect(ray)));
            prop_assert_eq!(bits(bvh.intersect(ray)), bits(again.intersect(ray)));
        }
    }
}

const UNIT: Disk = Disk {
    center: [0.0, 0.0, 1.0],
    normal: [0.0, 0.0, 2.0],
    radius: 1.0,
};

fn up(x: f32, y: f32) -> Ray {
    Ray::new([x, y, 0.0], [0.0, 0.0, 1.0])
}

/// Numbers that can be worked out by hand.
#[test]
fn hits_are_where_they_are_on_paper() {
    let bvh = Bvh::build(&[Geometry::disks(vec![UNIT])], &Recipe::default()).expect("one disk");
    let hit = bvh.intersect(&up(0.5, -0.5)).expect("inside");
    assert_eq!(
        (hit.t, hit.u, hit.v, hit.prim_id, hit.geom_id),
        (1.0, 0.0, 0.0, 0, 0)
    );
    // The edge belongs to the disk, what is outside does not.
    assert!(bvh.occluded(&up(1.0, 0.0)) && bvh.occluded(&up(0.0, -1.0)));
    assert!(!bvh.occluded(&up(1.0f32.next_up(), 0.0)) && !bvh.occluded(&up(0.8, 0.8)));
    // From above, and at an angle: t in multiples of the direction.
    let down = Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.5]);
    assert_eq!(bvh.intersect(&down).map(|hit| hit.t), Some(2.0));
    let slanted = Ray::new([-2.0, 0.0, 0.0], [2.0, 0.0, 1.0]);
    assert_eq!(bvh.intersect(&slanted).map(|hit| hit.t), Some(1.0));
    // Grazing, to either side of the edge; then in the plane and beside it.
    let grazing = |x: f32| Ray::new([x - 1000.0, 0.0, 0.0], [1000.0, 0.0, 1.0]);
    assert!(bvh.occluded(&grazing(-0.99)) && bvh.occluded(&grazing(0.99)));
    assert!(!bvh.occluded(&grazing(-1.01)) && !bvh.occluded(&grazing(1.01)));
    for z in [1.0, 0.5] {
        assert!(
            !bvh.occluded(&Ray::new([-2.0, 0.0, z], [1.0, 0.0, 0.0])),
            "{z}"
        );
    }
    // The interval is open.
    let until = |tfar| Ray {
        tfar,
        ..up(0.0, 0.0)
    };
    assert!(!bvh.occluded(&until(1.0)) && bvh.occluded(&until(1.0f32.next_up())));
    assert_eq!(bvh.query(&up(0.0, 0.0)).all_hits().len(), 1);
    let id = PrimId::from(hit);
    assert!(!bvh.query(&up(0.0, 0.0)).except(id).occluded());
}

/// On both sides, mirrored or not, the normal is that of the disk, taken to the world.
#[test]
fn normals_are_those_of_the_disk() {
    let disk = Disk {
        normal: [0.0, 3.0, 3.0],
        ..UNIT
    };
    let object = [Geometry::disks(vec![disk])];
    let place = |transform| Instance::new(0, transform);
    let instances = [
        place(IDENTITY),
        place(translation([10.0, 0.0, 0.0])),
        place(crate::transforms::product(
            &translation([20.0, 0.0, 0.0]),
            &scale([1.0, -1.0, 1.0]),
        )),
        place(crate::transforms::product(
            &translation([30.0, 0.0, 0.0]),
            &scale([1.0, 1.0, 3.0]),
        )),
    ];
    let primitives = Primitives::with_instances(&[], &[object], &instances).expect("in range");
    let bvh = Bvh::build(&primitives, &Recipe::default()).expect("a tree");
    let half = 0.5f32.sqrt();
    let long = 10f32.sqrt();
    let expected = [
        [0.0, half, half],
        [0.0, half, half],
        [0.0, -half, half],
        [0.0, 3.0 / long, 1.0 / long],
    ];
    for (x, expected) in [0.0, 10.0, 20.0, 30.0].into_iter().zip(expected) {
        for ray in [up(x, 0.0), Ray::new([x, 0.0, 9.0], [0.0, 0.0, -1.0])] {
            let hit = bvh.intersect(&ray).expect("a disk");
            let normal = bvh.normal(&ray, &hit).expect("disks have one");
            for axis in 0..3 {
                assert!(
                    (normal[axis] - expected[axis]).abs() < 1e-6,
                    "{x} {normal:?}"
                );
            }
        }
    }
}

/// An instance that is scaled by axis makes an ellipse of a disk.
#[test]
fn scaled_disks_are_ellipses() {
    let object = [Geometry::disks(vec![Disk {
        center: [0.0; 3],
        ..UNIT
    }])];
    let transform =
        crate::transforms::product(&translation([0.0, 0.0, 1.0]), &scale([4.0, 0.5, 7.0]));
    let instances = [Instance::new(0, transform)];
    let primitives = Primitives::with_instances(&[], &[object], &instances).expect("in range");
    let bvh = Bvh::build(&primitives, &Recipe::default()).expect("a tree");
    let brute = Brute::new(&primitives);
    let mut rng = Rng::new(91);
    let mut inside = 0;
    for _ in 0..2000 {
        let [x, y, _] = rng.point(5.0);
        let y = 0.2 * y;
        let share = (x / 4.0).powi(2) + (y / 0.5).powi(2);
        if (share - 1.0).abs() < 1e-3 {
            continue;
        }
        let hit = bvh.intersect(&up(x, y));
        assert_eq!(hit.is_some(), share < 1.0, "{x} {y}");
        assert_eq!(bits(hit), bits(brute.intersect(&up(x, y))));
        inside += usize::from(hit.is_some());
        // Straight above the inside the nearest point is straight below; elsewhere it is the nearest of many on the edge.
        let point = [x, y, 3.0];
        let near = bvh.closest(point, f32::INFINITY).expect("a disk");
        if share < 1.0 {
            assert!((near.distance - 2.0).abs() < 1e-5, "{near:?}");
            continue;
        }
        let least = (0..3600).map(|step| {
            let (sin, cos) = (f64::from(step) * 0.1).to_radians().sin_cos();
            let (dx, dy) = (4.0 * cos - f64::from(x), 0.5 * sin - f64::from(y));
            (dx * dx + dy * dy + 4.0).sqrt()
        });
        let least = least.fold(f64::INFINITY, f64::min);
        let distance = f64::from(near.distance);
        assert!(
            distance < least + 1e-6 && distance > least - 1e-3,
            "{point:?} {distance} {least}"
        );
    }
    assert!(inside > 300, "{inside}");
}

/// In the world: above the disk, beside it, in its plane and in its centre.
#[test]
fn nearest_points_are_on_the_disk() {
    let bvh = Bvh::build(&[Geometry::disks(vec![UNIT])], &Recipe::default()).expect("one disk");
    for (point, distance, position) in [
        ([0.5, 0.0, 3.0], 2.0, [0.5, 0.0, 1.0]),
        ([4.0, 0.0, 5.0], 5.0, [1.0, 0.0, 1.0]),
        ([0.0, -3.0, 1.0], 2.0, [0.0, -1.0, 1.0]),
        ([0.0, 0.0, 1.0], 0.0, [0.0, 0.0, 1.0]),
    ] {
        let near = bvh.closest(point, 10.0).expect("near enough");
        assert_eq!(
            (near.distance, near.position),
            (distance, position),
            "{point:?}"
        );
        assert!(!bvh.contains(point), "a disk has no inside");
    }
    assert_eq!(bvh.closest([0.0, 0.0, 4.0], 2.9), None);
}

#[test]
fn unsound_disks_are_dropped_and_named() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let list = vec![
        UNIT,
        Disk {
            center: [0.0, nan, 0.0],
            ..UNIT
        },
        Disk {
            normal: [0.0, inf, 0.0],
            ..UNIT
        },
        Disk {
            normal: [0.0, -0.0, 0.0],
            ..UNIT
        },
        Disk {
            radius: 0.0,
            ..UNIT
        },
        Disk {
            radius: -1.0,
            ..UNIT
        },
        Disk {
            radius: inf,
            ..UNIT
        },
        Disk {
            radius: nan,
            ..UNIT
        },
        Disk {
            center: [f32::MAX; 3],
            normal: [1.0, 1.0, 1.0],
            radius: f32::MAX,
        },
    ];
    let primitives = Primitives::new(&[Geometry::disks(list)]).expect("nothing to be out of range");
    assert_eq!(primitives.len(), 1);
    use DropReason::*;
    let reasons = [
        NotFinite, NotFinite, NoNormal, NoRadius, NoRadius, NotFinite, NotFinite, NotFinite,
    ];
    let expected = reasons
        .into_iter()
        .zip(1..)
        .map(|(reason, prim_id)| Dropped::Primitive {
            object: None,
            geom_id: 0,
            prim_id,
            reason,
        });
    assert_eq!(primitives.dropped_list(), expected.collect::<Vec<_>>());
    assert_eq!(NoNormal.to_string(), "the normal is zero");
}

/// A refit over disks of which one is sound no more fails and leaves the tree as it was.
#[test]
fn a_refit_needs_sound_disks() {
    let flat = [
        UNIT,
        Disk {
            center: [3.0; 3],
            ..UNIT
        },
    ];
    let mut bvh = Bvh::build(&[Geometry::disks(&flat[..])], &Recipe::default()).expect("two disks");
    let gone = [
        UNIT,
        Disk {
            normal: [0.0; 3],
            ..UNIT
        },
    ];
    let error = bvh.refit(&[Geometry::disks(&gone[..])]);
    assert!(
        matches!(
            error,
            Err(Error::OtherPrimitives {
                expected: 2,
                found: 1
            })
        ),
        "{error:?}"
    );
    assert!(bvh.occluded(&up(0.0, 0.0)));
}

/// Objects of disks in a world that changes, and masks.
#[test]
fn worlds_and_masks_know_disks() {
    let object = Object::build(&[Geometry::disks(vec![UNIT])], &Recipe::default()).expect("a disk");
    let place = |x| Instance::new(0, translation([x, 0.0, 0.0]));
    let world = World::new(&[object], &[place(0.0), place(5.0)]).expect("an object that is there");
    let hit = world.intersect(&up(5.5, 0.0)).expect("the second");
    assert_eq!((hit.inst_id, hit.t), (1, 1.0));

    let two = [
        Geometry::disks(vec![UNIT]),
        Geometry::disks(vec![Disk {
            center: [0.0, 0.0, 2.0],
            ..UNIT
        }]),
    ];
    let mut bvh = Bvh::build(&two, &Recipe::default()).expect("two disks");
    bvh.set_masks(Masks::new().world(vec![1, 2]));
    let of = |mask| {
        bvh.query(&up(0.0, 0.0))
            .mask(mask)
            .intersect()
            .map(|hit| hit.t)
    };
    assert_eq!(
        (of(1), of(2), of(3), of(4)),
        (Some(1.0), Some(2.0), Some(1.0), None)
    );
}
