//! Trees in files: the same answers at the same cost, and no harm from files that are damaged or forged.

use std::io::{self, Write};

use antumbra::lab::{Cost, Laboratory, Log, SlotOrder};
use antumbra::recipe::Order;
use antumbra::{
    Brute, Bvh, Error, Geometry, Instance, Isa, Primitives, Ray, Recipe, Sphere, Width,
};
use antumbra_testkit::{Rng, mesh, rays};

use crate::support::{bits, cutouts, geometry, kernel_rays, quads, square};
use crate::transforms::transform;

/// Triangles, spheres, quads and instances; rays of all kinds.
fn scene(seed: u64, size: usize) -> (Primitives, Vec<Ray>) {
    let mut rng = Rng::new(seed);
    let soup = mesh::soup(&mut rng, size);
    let ball = mesh::icosphere(1);
    let spheres: Vec<_> = (0..size / 20)
        .map(|_| Sphere {
            center: rng.point(1.0),
            radius: 0.1 * rng.unit(),
        })
        .collect();
    let instances: Vec<_> = (0..size / 20)
        .map(|index| Instance::new(index as u32 % 2, transform(&mut rng)))
        .collect();
    let world = [
        geometry(&soup),
        Geometry::spheres(&spheres[..]),
        quads(&soup),
    ];
    let objects = [
        vec![geometry(&ball), quads(&ball)],
        vec![geometry(&soup), Geometry::spheres(&spheres[..])],
    ];
    let primitives = Primitives::with_instances(&world, &objects, &instances).expect("in range");
    let rays = kernel_rays(&rays::around(&mut rng, &soup, 300));
    (primitives, rays)
}

fn saved(bvh: &Bvh) -> Vec<u8> {
    let mut bytes = Vec::new();
    bvh.write(&mut bytes).expect("a vector takes anything");
    bytes
}

fn counts(bvh: &Bvh, rays: &[Ray]) -> Vec<Cost> {
    let mut occluded = vec![false; rays.len()];
    let mut costs = vec![Cost::default(); rays.len()];
    bvh.occluded_batch_counted(rays, &mut occluded, &mut costs);
    costs
}

#[test]
fn saved_trees_answer_as_built_ones_at_the_same_cost() {
    for (size, seed) in [(0, 1), (1, 2), (40, 3), (400, 4)] {
        let (primitives, rays) = scene(seed, size);
        let brute = Brute::new(&primitives);
        for width in Width::ALL {
            for order in [Order::Joint, Order::TwoWay, Order::Octants, Order::Ftob] {
                let recipe = Recipe::default().width(width).order(order);
                let built = Bvh::learn(&primitives, &rays, &recipe).expect("a tree");
                let bytes = saved(&built);
                let mut read = Bvh::read(&bytes[..]).expect("a file of ours");
                read.validate().expect("a sound tree");
                assert_eq!(saved(&read), bytes, "{size} x{width} {order}");
                assert_eq!(counts(&read, &rays), counts(&built, &rays));
                let (mut report, expected) = (read.report(), built.report());
                report.times = expected.times;
                // No level is deeper than the tree says, but the tree may say more.
                assert!(report.depth <= expected.depth);
                report.depth = expected.depth;
                assert_eq!(report, expected);
                for isa in Isa::available() {
                    read.set_isa(isa);
                    let mut occluded = vec![false; rays.len()];
                    read.occluded_batch(&rays, &mut occluded);
                    for (ray, occluded) in rays.iter().zip(occluded) {
                        assert_eq!(occluded, brute.occluded(ray));
                        assert_eq!(read.occluded(ray), occluded);
                        assert_eq!(bits(read.intersect(ray)), bits(brute.intersect(ray)));
                    }
                }
            }
        }
    }
}

#[test]
fn every_damage_is_found() {
    let (primitives, _) = scene(5, 20);
    let bytes =
        saved(&Bvh::build(&primitives, &Recipe::default().width(Width::W4)).expect("a tree"));
    for end in 0..bytes.len() {
        let error = Bvh::read(&bytes[..end]).expect_err("cut off");
        assert!(
            matches!(error, Error::Unreadable { what: "tree", .. }),
            "{error}"
        );
    }
    for place in 0..bytes.len() {
        let mut bytes = bytes.clone();
        bytes[place] ^= 1 << (place % 8);
        assert!(Bvh::read(&bytes[..]).is_err(), "byte {place}");
    }
    assert!(Bvh::read(&b"ANTUMBRA\x01\0\0\0"[..]).is_err());
    // A file that says it is longer than any.
    let mut endless = bytes[..20].to_vec();
    endless[12..20].fill(0xff);
    assert!(Bvh::read(&endless[..]).is_err());
    // Another version is named.
    let mut later = bytes.clone();
    later[8] = 9;
    let error = Bvh::read(&later[..])
        .expect_err("another version")
        .to_string();
    assert_eq!(error, "cannot read the tree: it has version 9, not 2");
}

/// The checksum of the book, worked out anew.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let len = bytes.len() - 8;
    let words = (len - 20) as u64 / 4;
    bytes[12..20].copy_from_slice(&words.to_le_bytes());
    let mut sum = 0u64;
    for word in bytes[..len].chunks_exact(4) {
        let word = u32::from_le_bytes(word.try_into().expect("four bytes"));
        let z = (sum ^ u64::from(word)).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        sum = z ^ (z >> 31);
    }
    bytes[len..].copy_from_slice(&sum.to_le_bytes());
    bytes
}

/// Files with a good checksum whose words are not those that were written: refused, or trees that answer something.
#[test]
fn forged_files_do_no_harm() {
    let mut rng = Rng::new(6);
    let telling = [
        0,
        1,
        2,
        3,
        0x3fff_ffff,
        0x4000_0000,
        0x4000_0001,
        0x6000_0000,
        0xc000_0000,
    ];
    let telling = telling
        .into_iter()
        .chain([0xe000_0000, 0xe000_0001, u32::MAX, u32::MAX - 1]);
    let telling: Vec<u32> = telling
        .chain([0x7f80_0000, 0x7fc0_0000, 0xff80_0000])
        .collect();
    let (mut refused, mut taken) = (0, 0);
    for (index, order) in [Order::Joint, Order::Octants, Order::TwoWay]
        .into_iter()
        .enumerate()
    {
        let (primitives, rays) = scene(7 + index as u64, 40);
        let recipe = Recipe::default().width(Width::ALL[index]).order(order);
        let good = saved(&Bvh::learn(&primitives, &rays, &recipe).expect("a tree"));
        assert_eq!(sealed(good.clone()), good);
        for _ in 0..3000 {
            let mut bytes = good.clone();
            for _ in 0..1 + rng.below(3) {
                // The first words are sizes.
                let words = bytes.len() / 4 - 7;
                let word = 5 + if rng.below(3) == 0 {
                    rng.below(24)
                } else {
                    rng.below(words)
                };
                let value = match rng.below(3) {
                    0 => telling[rng.below(telling.len())],
                    1 => rng.bits() as u32,
                    _ => {
                        let place = 5 + rng.below(words);
                        u32::from_le_bytes(bytes[4 * place..][..4].try_into().expect("a word"))
                    }
                };
                bytes[4 * word..][..4].copy_from_slice(&value.to_le_bytes());
            }
            if rng.below(4) == 0 {
                bytes.truncate(28 + 4 * rng.below(bytes.len() / 4 - 7));
            }
            match Bvh::read(&sealed(bytes)[..]) {
                Err(error) => {
                    assert!(matches!(error, Error::Unreadable { .. }), "{error}");
                    refused += 1;
                }
                Ok(bvh) => {
                    bvh.validate().expect("what was read is valid");
                    let mut occluded = vec![false; rays.len()];
                    let mut hits = vec![None; rays.len()];
                    bvh.occluded_batch(&rays, &mut occluded);
                    bvh.intersect_batch(&rays, &mut hits);
                    for (ray, hit) in rays.iter().zip(&hits) {
                        assert_eq!(bvh.occluded(ray), hit.is_some());
                        let _ = hit.map(|hit| bvh.normal(ray, &hit));
                    }
                    counts(&bvh, &rays);
                    taken += 1;
                }
            }
        }
    }
    assert!(refused > 1000 && taken > 100, "{refused} {taken}");
}

#[test]
fn files_can_follow_each_other() {
    let (primitives, _) = scene(9, 30);
    let first =
        saved(&Bvh::build(&primitives, &Recipe::default().width(Width::W4)).expect("a tree"));
    let second =
        saved(&Bvh::build(&primitives, &Recipe::default().width(Width::W8)).expect("a tree"));
    let both = [&first[..], &second, b"more"].concat();
    let mut input = &both[..];
    assert_eq!(Bvh::read(&mut input).expect("the first").width(), Width::W4);
    assert_eq!(
        Bvh::read(&mut input).expect("the second").width(),
        Width::W8
    );
    assert_eq!(input, b"more");
}

#[test]
fn filters_cannot_be_saved() {
    let mesh = square(0.0);
    let half: std::sync::Arc<dyn antumbra::cutout::Opacity> = std::sync::Arc::new(Half);
    let bvh = Bvh::build(&[cutouts(&mesh, half)], &Recipe::default()).expect("a mesh");
    assert_eq!(bvh.write(io::sink()), Err(Error::HasFilters { cutouts: 2 }));
}

#[derive(Debug)]
struct Half;

impl antumbra::cutout::Opacity for Half {
    fn opacity(&self, _: &antumbra::cutout::Candidate) -> f32 {
        0.5
    }
}

/// Takes so many bytes and no more.
struct Full(usize);

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = bytes.len().min(self.0);
        self.0 -= taken;
        if taken == 0 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_an_error() {
    let (primitives, _) = scene(10, 400);
    let bvh = Bvh::build(&primitives, &Recipe::fast()).expect("a tree");
    let len = saved(&bvh).len();
    assert!(bvh.write(Full(len)).is_ok());
    for room in [0, 10, len / 2, len - 1] {
        let error = bvh.write(Full(room)).expect_err("no room");
        let Error::Io { kind, .. } = error else {
            panic!("{error}");
        };
        assert_eq!(kind, io::ErrorKind::StorageFull);
    }
}

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly does not unwind")]
fn orders_come_back_and_forged_ones_are_refused() {
    let mut rng = Rng::new(11);
    let (primitives, rays) = scene(12, 60);
    let (mut refused, mut taken) = (0, 0);
    for order in [Order::Joint, Order::Octants, Order::Random, Order::Simple] {
        let recipe = Recipe::fast().order(Order::Simple).width(Width::W8);
        let bvh = Bvh::build(&primitives, &recipe).expect("a tree");
        let log = order.log_kind().map(|kind| bvh.log_of(&rays, kind, 1));
        let plan = bvh
            .plan(order, log.as_ref(), &recipe.costs)
            .expect("the log suits");
        let mut good = Vec::new();
        plan.write(&mut good).expect("a vector takes anything");
        assert_eq!(SlotOrder::read(&good[..]).expect("a file of ours"), plan);
        assert!(Bvh::read(&good[..]).is_err(), "no tree");
        for _ in 0..500 {
            let mut bytes = good.clone();
            let place = 20 + rng.below(bytes.len() - 28);
            if rng.bits() & 1 == 0 {
                bytes[place] = rng.bits() as u8;
            } else {
                // Often another permutation.
                bytes.swap(place, place + 1);
            }
            match SlotOrder::read(&sealed(bytes)[..]) {
                Err(_) => refused += 1,
                Ok(plan) => {
                    let fits = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                        let mut bvh = bvh.clone();
                        bvh.apply(&plan);
                        bvh.validate().expect("slots are permuted and no more");
                    }));
                    // Only a shape that is another one is a panic, as documented.
                    let other = fits.err().and_then(|panic| panic.downcast::<String>().ok());
                    assert!(other.is_none_or(|text| text.contains("does not fit a tree of")));
                    taken += 1;
                }
            }
        }
    }
    assert!(refused > 500 && taken > 20, "{refused} {taken}");
}

/// Logs of every kind come back and make the same order. Forged ones are refused, or make an order that answers as before.
#[test]
fn logs_come_back_and_forged_ones_do_no_harm() {
    let mut rng = Rng::new(13);
    let (primitives, rays) = scene(14, 60);
    let (mut refused, mut taken) = (0, 0);
    for width in Width::ALL {
        let recipe = Recipe::fast().order(Order::Simple).width(width);
        let bvh = Bvh::build(&primitives, &recipe).expect("a tree");
        for order in [
            Order::SortMinus,
            Order::Sort,
            Order::SortPlus,
            Order::Joint,
            Order::Octants,
        ] {
            let kind = order.log_kind().expect("these learn");
            let log = bvh.log_of(&rays, kind, 1);
            let good = log.to_bytes();
            let back = Log::from_bytes(&good).expect("a file of ours");
            assert_eq!(back, log);
            let plan = |log: &Log| bvh.plan(order, Some(log), &recipe.costs);
            assert_eq!(plan(&back), plan(&log));
            let mut written = Vec::new();
            log.write(&mut written).expect("a vector takes anything");
            assert_eq!(written, good);
            assert_eq!(Log::read(&written[..]).as_ref(), Ok(&log));
            assert!(SlotOrder::from_bytes(&good).is_err(), "no order");
            assert!(Log::from_bytes(&[&good[..], &[0; 4]].concat()).is_err());
            for _ in 0..100 {
                let mut bytes = good.clone();
                // Half of the time behind the counters, where visits are.
                let first = if rng.bits() & 1 == 0 {
                    20
                } else {
                    bytes.len() / 2
                };
                let place = first + rng.below(bytes.len() - 8 - first);
                bytes[place] = rng.bits() as u8;
                match Log::from_bytes(&sealed(bytes)) {
                    Err(_) => refused += 1,
                    Ok(log) => {
                        let mut forged = bvh.clone();
                        match plan(&log) {
                            Ok(plan) => forged.apply(&plan),
                            // Of another tree or another kind.
                            Err(_) => continue,
                        }
                        forged.validate().expect("slots are permuted and no more");
                        for ray in &rays[..20] {
                            assert_eq!(forged.occluded(ray), bvh.occluded(ray));
                        }
                        taken += 1;
                    }
                }
            }
        }
    }
    assert!(refused > 100 && taken > 300, "{refused} {taken}");
}
