//! Orders and logs in files.

use antumbra::parts::{Log, SlotOrder, Steps};
use antumbra::recipe::Order;
use antumbra::{Bvh, Recipe, Width};
use antumbra_testkit::Rng;

use super::damage::{opened, sealed};
use super::scene;

#[test]
#[cfg_attr(target_family = "wasm", ignore = "WebAssembly does not unwind")]
fn orders_come_back_and_forged_ones_are_refused() {
    let mut rng = Rng::new(11);
    let (primitives, rays) = scene(12, 60);
    let (mut refused, mut taken) = (0, 0);
    for order in [Order::Joint, Order::Ftob, Order::Random, Order::Simple] {
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
            let (magic, mut bytes) = opened(&good);
            let place = rng.below(bytes.len() - 1);
            if rng.bits() & 1 == 0 {
                bytes[place] = rng.bits() as u8;
            } else {
                // Often another permutation.
                bytes.swap(place, place + 1);
            }
            match SlotOrder::read(&sealed(&magic, &bytes)[..]) {
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
        for order in [Order::SortMinus, Order::Sort, Order::SortPlus, Order::Joint] {
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
                let (magic, mut bytes) = opened(&good);
                // Half of the time behind the counters, where visits are.
                let first = if rng.bits() & 1 == 0 {
                    0
                } else {
                    bytes.len() / 2
                };
                let place = first + rng.below(bytes.len() - first);
                bytes[place] = rng.bits() as u8;
                match Log::from_bytes(&sealed(&magic, &bytes)) {
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
