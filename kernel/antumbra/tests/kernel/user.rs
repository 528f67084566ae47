//! User geometry: what is asked of it, what it may answer, and what trees do with it. Scenes of other tests have it, too.

use antumbra::recipe::Engine;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use antumbra::shapes::{DropReason, Dropped, Sphere, UserGeometry, UserHit};
use antumbra::{
    Aabb, Brute, Bvh, Geometry, Instance, Object, PrimId, Primitives, Ray, Recipe, Width, World,
};
use antumbra_testkit::{Rng, mesh, rays};

use crate::support::{Odd, bits, for_every_tree, geometry, kernel_rays};
use crate::transforms::{IDENTITY, scale, transform, translation};

/// Balls as a user would write them.
#[derive(Debug)]
struct Balls(Vec<Sphere>);

impl UserGeometry for Balls {
    fn bounds(&self, prim_id: u32) -> Aabb {
        let Sphere { center, radius } = self.0[prim_id as usize];
        // A little too large, because `intersect` rounds.
        let radius = 1.001 * radius;
        Aabb {
            min: center.map(|x| x - radius),
            max: center.map(|x| x + radius),
        }
    }

    fn intersect(&self, prim_id: u32, ray: &Ray) -> Option<UserHit> {
        let Sphere { center, radius } = self.0[prim_id as usize];
        let to_center: [f64; 3] =
            core::array::from_fn(|axis| f64::from(center[axis]) - f64::from(ray.org[axis]));
        let dir = ray.dir.map(f64::from);
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (length2, middle) = (dot(dir, dir), dot(to_center, dir));
        let square =
            middle * middle - length2 * (dot(to_center, to_center) - f64::from(radius).powi(2));
        let half = (square >= 0.0).then(|| square.sqrt())?;
        [middle - half, middle + half]
            .map(|t| (t / length2) as f32)
            .into_iter()
            .find(|t| ray.tnear < *t && *t < ray.tfar)
            .map(|t| UserHit::new(t, 0.25, 0.5))
    }

    /// In the world, or where nothing is stretched.
    fn closest_point(
        &self,
        prim_id: u32,
        point: [f64; 3],
        world_from_object: &[[f64; 4]; 3],
    ) -> Option<[f64; 3]> {
        let Sphere { center, radius } = self.0[prim_id as usize];
        let [x, y, z] = center.map(f64::from);
        let center = world_from_object.map(|[a, b, c, d]| a * x + b * y + c * z + d);
        let way: [f64; 3] = core::array::from_fn(|axis| point[axis] - center[axis]);
        let length = way.iter().map(|x| x * x).sum::<f64>().sqrt();
        Some(core::array::from_fn(|axis| {
            center[axis] + f64::from(radius) * way[axis] / length
        }))
    }

    fn normal(&self, prim_id: u32, ray: &Ray, hit: &UserHit) -> Option<[f32; 3]> {
        assert_eq!((hit.u, hit.v), (0.25, 0.5));
        let Sphere { center, .. } = self.0[prim_id as usize];
        let at = ray.at(hit.t);
        Some(core::array::from_fn(|axis| at[axis] - center[axis]))
    }
}

/// Balls are spheres: the same rays hit them, at nearly the same distances, with the same normals, in the world and in
/// instances.
#[test]
fn balls_are_spheres() {
    let mut rng = Rng::new(71);
    let spheres: Vec<_> = (0..60)
        .map(|_| Sphere {
            center: rng.point(1.0),
            radius: 0.02 + 0.2 * rng.unit(),
        })
        .collect();
    let balls = Geometry::user(60, Arc::new(Balls(spheres.clone())));
    let instances = [
        IDENTITY,
        translation([2.0, 0.0, 0.0]),
        scale([1.0, -2.0, 0.5]),
    ]
    .map(|transform| Instance::new(0, transform));
    let build = |kind: Geometry<'_>| {
        let placed =
            Primitives::with_instances(core::slice::from_ref(&kind), &[[kind.clone()]], &instances);
        Bvh::build(&placed.expect("in range"), &Recipe::default()).expect("a tree")
    };
    let (spheres, balls) = (build(Geometry::spheres(spheres)), build(balls));
    let mut hits = 0;
    for _ in 0..3000 {
        let ray = Ray::between(rng.point(4.0), rng.point(2.0));
        let (Some(sphere), Some(ball)) = (spheres.intersect(&ray), balls.intersect(&ray)) else {
            continue;
        };
        if sphere.prim_id != ball.prim_id || sphere.inst_id != ball.inst_id {
            continue;
        }
        hits += 1;
        assert!((sphere.t - ball.t).abs() < 1e-4, "{sphere:?} {ball:?}");
        let normal = spheres.normal(&ray, &sphere).expect("a sphere has one");
        let found = balls.normal(&ray, &ball).expect("a ball has one");
        for axis in 0..3 {
            assert!((normal[axis] - found[axis]).abs() < 0.02, "{ray:?}");
        }
        assert!(balls.occluded(&ray));
        let id = PrimId::from(ball);
        assert_ne!(
            balls.query(&ray).except(id).intersect().map(PrimId::from),
            Some(id)
        );
    }
    assert!(hits > 700, "{hits}");
    // The third instance is stretched.
    let mut moved = 0;
    for _ in 0..1000 {
        let point = rng.point(4.0);
        let sphere = spheres.closest(point, f32::INFINITY).expect("something");
        let ball = balls.closest(point, f32::INFINITY).expect("something");
        if sphere.inst_id == 2 || ball.inst_id == 2 {
            continue;
        }
        moved += usize::from(ball.inst_id == 1);
        assert!((sphere.distance - ball.distance).abs() < 1e-5);
        assert_eq!(sphere.prim_id, ball.prim_id);
    }
    assert!(moved > 100, "{moved}");
}

/// What is dropped, what is kept, and what normals nobody tells.
#[test]
fn unsound_boxes_are_dropped_and_named() {
    let (low, high) = ([0.0, 0.0, 1.0], [1.0, 1.0, 2.0]);
    let aabb = |min, max| Aabb { min, max };
    let boxes = vec![
        aabb(low, high),
        aabb(high, low),
        aabb([f32::NAN; 3], high),
        aabb(low, [1.0, f32::INFINITY, 2.0]),
        // Flat.
        aabb(low, [1.0, 1.0, 1.0]),
        Aabb::EMPTY,
    ];
    let odd = Odd { boxes }.geometry();
    let list = [Geometry::spheres(vec![]), odd];
    let primitives = Primitives::new(&list).expect("no indices");
    let reason = |dropped: &Dropped| match dropped {
        Dropped::Primitive {
            geom_id: 1,
            prim_id,
            reason,
            object: None,
        } => (*prim_id, *reason),
        other => panic!("{other}"),
    };
    let dropped: Vec<_> = primitives.dropped_list().iter().map(reason).collect();
    let expected = [
        (1, DropReason::EmptyBounds),
        (2, DropReason::NotFinite),
        (3, DropReason::NotFinite),
        (5, DropReason::NotFinite),
    ];
    assert_eq!(dropped, expected);
    assert_eq!((primitives.len(), primitives.users()), (2, 2));
    let bvh = Bvh::build(&primitives, &Recipe::default()).expect("a tree");
    let ray = Ray::new([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]);
    let hit = bvh.intersect(&ray).expect("the first one");
    assert_eq!(hit.prim_id, 4);
    // It says 4.5, which is behind its flat box.
    assert!((hit.t - 1.0).abs() < 1e-5, "{}", hit.t);
    assert_eq!(bvh.normal(&ray, &hit), None);
}

/// A primitive is asked about only where its box is met, and with the whole interval of the ray.
#[test]
fn functions_are_asked_about_rays_that_meet_the_box() {
    #[derive(Debug, Default)]
    struct Asked {
        is_built: AtomicBool,
        intersect: AtomicUsize,
        occluded: AtomicUsize,
    }
    impl Asked {
        /// Rays that trees are learned from have other intervals.
        fn check(&self, ray: &Ray) {
            if self.is_built.load(Ordering::Relaxed) {
                assert_eq!((ray.tnear, ray.tfar), (-0.5, 50.0));
            }
        }
    }
    impl UserGeometry for Asked {
        fn bounds(&self, prim_id: u32) -> Aabb {
            let z = prim_id as f32;
            Aabb {
                min: [0.0, 0.0, z],
                max: [1.0, 1.0, z],
            }
        }
        fn intersect(&self, _: u32, ray: &Ray) -> Option<UserHit> {
            self.intersect.fetch_add(1, Ordering::Relaxed);
            self.check(ray);
            None
        }
        fn occluded(&self, _: u32, ray: &Ray) -> bool {
            self.occluded.fetch_add(1, Ordering::Relaxed);
            self.check(ray);
            false
        }
    }
    let asked = Arc::new(Asked::default());
    let bvh = Bvh::build(&[Geometry::user(200, asked.clone())], &Recipe::default());
    let bvh = bvh.expect("no indices");
    asked.is_built.store(true, Ordering::Relaxed);
    for counter in [&asked.intersect, &asked.occluded] {
        counter.store(0, Ordering::Relaxed);
    }
    let ray = |x| Ray {
        tnear: -0.5,
        tfar: 50.0,
        ..Ray::new([x, 0.5, 100.3], [0.0, 0.0, 1.0])
    };
    assert!(!bvh.occluded(&ray(0.5)) && !bvh.occluded(&ray(1.5)));
    assert_eq!(bvh.intersect(&ray(0.5)), None);
    assert_eq!(bvh.intersect(&ray(1.5)), None);
    let counts = [&asked.intersect, &asked.occluded].map(|counter| counter.load(Ordering::Relaxed));
    // 100 to 150.
    assert_eq!(counts, [51, 51]);
}

/// Functions that do not tell the same twice do no harm: every query ends, and every hit is in the interval.
#[test]
fn lies_do_no_harm() {
    #[derive(Debug, Default)]
    struct Liar(AtomicUsize, AtomicBool);
    impl Liar {
        fn next(&self) -> usize {
            self.0.fetch_add(0x9e37_79b9, Ordering::Relaxed) >> 7
        }
    }
    impl UserGeometry for Liar {
        fn bounds(&self, prim_id: u32) -> Aabb {
            let low = (prim_id % 17) as f32 / 17.0;
            let mut bounds = Aabb {
                min: [low; 3],
                max: [low + 0.2; 3],
            };
            if self.1.load(Ordering::Relaxed) && self.next().is_multiple_of(3) {
                bounds.min[0] = f32::NAN;
            }
            bounds
        }
        fn intersect(&self, _: u32, _: &Ray) -> Option<UserHit> {
            let t = f32::from_bits((self.next() as u32).wrapping_mul(0x85eb_ca6b));
            Some(UserHit::new(t, t, t))
        }
        fn occluded(&self, _: u32, _: &Ray) -> bool {
            self.next() & 1 == 0
        }
        fn normal(&self, _: u32, _: &Ray, _: &UserHit) -> Option<[f32; 3]> {
            Some([f32::MAX; 3].map(|x| x * (self.next() % 3) as f32))
        }
    }
    let mut rng = Rng::new(72);
    let liar = Arc::new(Liar::default());
    let soup = mesh::soup(&mut rng, 50);
    let list = [geometry(&soup), Geometry::user(100, liar.clone())];
    let rays = kernel_rays(&rays::around(&mut rng, &soup, 300));
    for width in Width::ALL {
        let mut bvh =
            Bvh::build(&list, &Recipe::default().engine(Engine::best(width))).expect("in range");
        for round in 0..3 {
            let mut hits = vec![None; rays.len()];
            let mut occluded = vec![false; rays.len()];
            bvh.batch(&rays).intersect_into(&mut hits);
            bvh.batch(&rays).occluded_into(&mut occluded);
            for (ray, hit) in rays.iter().zip(hits) {
                let hits = bvh.query(ray).all_hits().into_iter().chain(hit);
                for hit in hits {
                    assert!(ray.tnear < hit.t && hit.t < ray.tfar, "{ray:?} {hit:?}");
                    if let Some(normal) = bvh.normal(ray, &hit) {
                        assert!(normal.iter().all(|x| x.is_finite()));
                    }
                }
            }
            // From the second round on boxes lie as well.
            liar.1.store(round < 2, Ordering::Relaxed);
            let _ = bvh.refit(&list);
        }
        liar.1.store(false, Ordering::Relaxed);
    }
}

/// Queries about points must not leave out what nobody has written.
#[test]
#[should_panic(expected = "Rays` does not implement")]
fn geometry_without_nearest_points_is_named() {
    #[derive(Debug)]
    struct Rays;
    impl UserGeometry for Rays {
        fn bounds(&self, _: u32) -> Aabb {
            Aabb::new([0.0; 3], [1.0; 3])
        }
        fn intersect(&self, _: u32, _: &Ray) -> Option<UserHit> {
            None
        }
    }
    let list = [Geometry::user(1, Arc::new(Rays))];
    let bvh = Bvh::build(&list, &Recipe::default()).expect("in range");
    assert!(!bvh.contains([0.5; 3]));
    assert_eq!(bvh.closest([3.0; 3], 1.0), None);
    let _ = bvh.closest([3.0; 3], f32::INFINITY);
}

/// A batch guesses that what was nearest to a point is about as near to the next one. Here it is gone.
#[test]
fn wrong_guesses_of_a_batch_miss_nothing() {
    /// A point that only points of negative x find, and another one.
    #[derive(Debug)]
    struct Shy;
    impl UserGeometry for Shy {
        fn bounds(&self, prim_id: u32) -> Aabb {
            let at = [0.0, 0.0, 3.0 * prim_id as f32];
            Aabb::new(at, at)
        }
        fn intersect(&self, _: u32, _: &Ray) -> Option<UserHit> {
            None
        }
        fn closest_point(
            &self,
            prim_id: u32,
            point: [f64; 3],
            _: &[[f64; 4]; 3],
        ) -> Option<[f64; 3]> {
            (prim_id == 1 || point[0] < 0.0).then_some([0.0, 0.0, 3.0 * f64::from(prim_id)])
        }
    }
    let far = Geometry::spheres(vec![Sphere {
        center: [0.0, 0.0, -9.0],
        radius: 1.0,
    }]);
    let list = [Geometry::user(2, Arc::new(Shy)), far];
    let points = [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.0, -6.0]];
    let primitives = Primitives::new(&list).expect("no indices");
    let brute = Brute::new(&primitives);
    for_every_tree(&primitives, &[], |bvh, tree| {
        let closest = bvh.points(&points).closest();
        for (point, near) in points.into_iter().zip(&closest) {
            assert_eq!(*near, brute.closest(point, f32::INFINITY), "{tree}");
        }
        let ids = [0, 1, 2].map(|i| closest[i].map(|near| (near.geom_id, near.prim_id)));
        assert_eq!(ids, [Some((0, 0)), Some((0, 1)), Some((1, 0))], "{tree}");
    });
}

/// Worlds hold functions of several objects.
#[test]
fn trees_with_user_geometry_join_worlds() {
    let mut rng = Rng::new(73);
    let odd = Odd::new(&mut rng, 40);
    let object = Object::build(&[odd.geometry()], &Recipe::default()).expect("no indices");
    let instances: Vec<_> = (0..6)
        .map(|index| Instance::new(index % 2, transform(&mut rng)))
        .collect();
    let world = World::on_ground(&object, &[&object, &object], &instances).expect("in range");
    let lists = [[odd.geometry()], [odd.geometry()]];
    let all = Primitives::with_instances(&lists[0], &lists, &instances).expect("in range");
    let brute = Brute::new(&all);
    let soup = mesh::soup(&mut rng, 40);
    let rays = kernel_rays(&rays::around(&mut rng, &soup, 300));
    for ray in &rays {
        assert_eq!(bits(world.intersect(ray)), bits(brute.intersect(ray)));
        assert_eq!(world.occluded(ray), brute.occluded(ray));
    }
    for_every_tree(&all, &rays, |bvh, tree| {
        let point = [0.1, 0.2, 0.3];
        let near = bvh.closest(point, f32::INFINITY);
        assert_eq!(near, brute.closest(point, f32::INFINITY), "{tree}");
        assert_eq!(bvh.within(point, 9.0), brute.within(point, 9.0), "{tree}");
        assert!(near.is_some() && !bvh.contains(point));
        assert_eq!(bvh.winding_number(point), 0);
    });
}
